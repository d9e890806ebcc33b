"""Accepted garbage and accepted attacks are seen."""

from __future__ import annotations

import itertools
import re
import time
import urllib.request
from dataclasses import replace

import pytest
from spoiling import asked, cleaned, done, instead, to_fault

from conformance.checks.strict_input import test_soap_strict as strict
from conformance.checks.xml_security import test_xml_security_soap as security

STRICT = [
    ("unknown", rb"<[\w:]*no_such_element[^>]*>1</[\w:]*no_such_element>", b""),
    ("duplicate", rb"(<(\w+)>[^<]*</\2>)\1", rb"\1"),
    ("nil", rb'<(\w+) [^>]*nil="true"[^>]*/>', rb"<\1>1</\1>"),
    ("range", rb"<message_code>-?\d{2,}", b"<message_code>4"),
    ("lexical", rb"<(depot_x|x)>[^<0-9]*<", rb"<\1>1<"),
    ("non-finite", rb">-?(INF|NaN)<", b">1<"),
]

SECURED = [
    ("doctype", rb"<!DOCTYPE [^\[>]*(\[.*?\])?>", b"", "doctype"),
    ("instruction", rb"<\?[^?]*\?>", b"", "processing-instruction"),
]


@pytest.mark.parametrize(("kind", "pattern", "new"), STRICT, ids=[case[0] for case in STRICT])
def test_accepted_garbage_is_caught(judged, run, kind, pattern, new):
    session = judged(cleaned(pattern, new), effort="standard")
    assert f"strict-input/soap-{kind}" in run(session, strict.test_single_mutations)


def test_refusal_without_fault_is_caught(judged, run):
    session = judged(to_fault(lambda reply: reply.having(status=400, body=b"no")))
    assert "strict-input/soap-fault" in run(session, strict.test_single_mutations)


@pytest.mark.parametrize(("pattern", "new", "name"), [case[1:] for case in SECURED], ids=[case[0] for case in SECURED])
def test_accepted_attack_is_caught(judged, run, pattern, new, name):
    session = judged(asked(lambda ask: replace(ask, body=re.sub(pattern, new, ask.body, flags=re.DOTALL))))
    assert f"xml-security/{name}" in run(session, security.test_attacks)


ACCEPTED = [
    ("missing", lambda ask: b"Execute" in ask.body and b"<source_x>" not in ask.body),
    ("order", lambda ask: re.search(rb"<source_x>.*<depot_x>", ask.body)),
    ("namespace", lambda ask: re.search(rb"<\w+:(depot_x|x)>", ask.body)),
    ("body", lambda ask: re.search(rb"<\w+:Body/>", ask.body)),
]


@pytest.mark.parametrize(("kind", "when"), ACCEPTED, ids=[case[0] for case in ACCEPTED])
def test_success_for_garbage_is_caught(judged, run, kind, when):
    session = judged(instead(when, done), effort="standard")
    assert f"strict-input/soap-{kind}" in run(session, strict.test_single_mutations)


def test_one_accepted_message_in_fifty_is_caught(judged, run):
    turn = itertools.count(1)
    session = judged(instead(lambda _: next(turn) % 50 == 0, done), effort="standard")
    assert any(id_.startswith("strict-input/soap-") for id_ in run(session, strict.test_single_mutations))


def leaking(ask, forward):
    reply = forward(ask)
    return reply.having(body=b"root:x:0:0:root:/root:/bin/sh") if b"etc/passwd" in ask.body else reply


def expanding(ask, forward):
    return forward(ask).having(body=b"is roaas-expanded-4711") if b"&b;" in ask.body else forward(ask)


def calling(ask, forward):
    for url in re.findall(rb'http://127[^"<]*', ask.body):
        if b"turtlesim" not in url:
            urllib.request.urlopen(url.decode(), timeout=2).read()  # noqa: S310 - the trap's own
    return forward(ask)


def slowed(ask, forward):
    """Be slow for a while after the first attack."""
    if b"DOCTYPE" in ask.body and not slowed.until:
        slowed.until = time.monotonic() + 3.2
    elif b"DOCTYPE" not in ask.body and time.monotonic() < slowed.until:
        time.sleep(1.1)
    return forward(ask)


slowed.until = 0.0
ATTACKED = [
    ("a file", leaking, security.test_attacks, "external-entity"),
    ("XInclude of a file", leaking, security.test_attacks, "xinclude"),
    ("an entity", expanding, security.test_attacks, "internal-entity"),
    ("a call", calling, security.test_attacks, "no-callback"),
    ("a spoofed call", calling, security.test_addressing, "addressing-spoofing"),
    ("a slow robot", slowed, security.test_attacks, "responsive"),
    ("size", instead(lambda ask: len(ask.body) > 10_000_000, done), security.test_attacks, "size"),
    ("compression", instead(lambda ask: ask.body[:2] == b"\x1f\x8b", done), security.test_attacks, "compressed"),
    ("depth", instead(lambda ask: b"<d><d>" in ask.body, done), security.test_attacks, "depth"),
    ("many attributes", instead(lambda ask: b"q:a1=" in ask.body, done), security.test_attacks, "attributes"),
    ("long names", instead(lambda ask: b"<nnnn" in ask.body, done), security.test_attacks, "long-name"),
    ("laughs", instead(lambda ask: b"&l9;" in ask.body, done), security.test_attacks, "expansion"),
    ("repetition", instead(lambda ask: b"aaaaaa" in ask.body, done), security.test_attacks, "quadratic"),
    (
        "parameter entities",
        instead(lambda ask: b"/publishersdtd" in ask.body, done),
        security.test_attacks,
        "parameter-entity",
    ),
]


@pytest.mark.parametrize(("fault", "check", "name"), [c[1:] for c in ATTACKED], ids=[c[0] for c in ATTACKED])
def test_what_comes_of_attacks_is_caught(judged, run, fault, check, name):
    assert f"xml-security/{name}" in run(judged(fault), check)
