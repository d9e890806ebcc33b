"""Faults of any answer are seen, whatever was asked, also when they are rare."""

from __future__ import annotations

import pytest
from spoiling import BP, answer, one_in, renamed, to_fault, to_response

from conformance.checks.soap_basic_profile import test_soap_observed as observed
from conformance.checks.soap_basic_profile import test_soap_profile_messages as messages

CASES = [
    ("fault with status 200", to_fault(lambda r: r.having(status=200)), "R1126"),
    ("fault with status 400", to_fault(lambda r: r.having(status=400)), "R1126"),
    ("fault code unqualified", to_fault(renamed(rb"(faultcode[^>]*>)[\w-]+:", rb"\1")), "faultcode-qualified"),
    ("fault code of its own", to_fault(renamed(rb":Client<", b":Sender<")), "R1004"),
    ("no fault string", to_fault(renamed(rb"<faultstring.*?</faultstring>", b"")), "fault-complete"),
    ("fault with a further child", to_fault(renamed(rb"</faultstring>", b"</faultstring><time>1</time>")), "R1000"),
    (
        "traceback",
        to_fault(renamed(rb"</faultstring>", b"Traceback (most recent call last): </faultstring>")),
        "fault-no-traceback",
    ),
    ("wrong media type", answer(lambda r: r.having(headers={"Content-Type": "application/soap+xml"})), "content-type"),
    ("latin-1", answer(lambda r: r.having(headers={"Content-Type": "text/xml; charset=iso-8859-1"})), "R1012"),
    ("instruction", answer(renamed(rb"(?s)(.*)", rb"\1<?a b?>")), "R1009"),
    ("element after Body", answer(renamed(rb"(</[\w-]+:Envelope>)", rb'<x xmlns="urn:x"/>\1')), "R1011"),
    ("status 204 for success", to_response(lambda r: r.having(status=302)), "R1124"),
    ("status 201 for success", to_response(lambda r: r.having(status=201)), "R1111"),
    (
        "one traceback in 50",
        one_in(50, lambda r: r.having(body=b"Traceback (most recent call last):")),
        "fault-no-traceback",
    ),
    ("HTML one time in 50", one_in(50, lambda r: r.having(body=b"<html/>", status=200)), "content-type"),
]


@pytest.mark.parametrize(("fault", "name"), [case[1:] for case in CASES], ids=[case[0] for case in CASES])
def test_watched(judged, run, fault, name):
    failed = run(judged(fault, effort="standard"), observed.test_every_answer_is_watched, messages.test_answers)
    assert BP + name in failed
