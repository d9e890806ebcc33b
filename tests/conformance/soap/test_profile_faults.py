"""Breaches of SOAP 1.1 and the Basic Profile are seen."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest
from spoiling import BP, answer, asked, cleaned, done, instead, renamed, to_fault, to_response, unreadable

from conformance.checks.soap_basic_profile import test_soap_profile_headers as headers
from conformance.checks.soap_basic_profile import test_soap_profile_http as over_http
from conformance.checks.soap_basic_profile import test_soap_profile_messages as messages

CASES = [
    (
        "any envelope",
        cleaned(rb"urn:example:soap-of-another-version", b"http://schemas.xmlsoap.org/soap/envelope/"),
        headers.test_other_versions,
        BP + "R1015",
    ),
    (
        "VersionMismatch as Client",
        to_fault(renamed(b":VersionMismatch", b":Client")),
        headers.test_other_versions,
        BP + "version-mismatch",
    ),
    ("mustUnderstand ignored", cleaned(rb'\w+:mustUnderstand="1"'), headers.test_must_understand, BP + "R1027"),
    ("mustUnderstand for all", cleaned(rb'\w+:actor="[^"]*"'), headers.test_other_headers, BP + "mustunderstand-actor"),
    ("headers refused", unreadable(lambda a: b"Transaction" in a.body), headers.test_other_headers, BP + "R2739"),
    (
        "MustUnderstand first",
        instead(
            lambda a: b"mustUnderstand" in a.body, lambda a, f: f(a).swapped(b":VersionMismatch", b":MustUnderstand")
        ),
        headers.test_order_of_faults,
        BP + "R2725",
    ),
    (
        "Client first",
        instead(lambda a: b"no_such_op" in a.body, lambda a, f: f(a).swapped(b":MustUnderstand", b":Client")),
        headers.test_order_of_faults,
        BP + "R2725",
    ),
    (
        "SOAPAction must be empty",
        unreadable(lambda a: a.headers.get("SOAPAction", '""') != '""'),
        over_http.test_soap_action,
        BP + "R1109",
    ),
    (
        "dispatch by SOAPAction",
        instead(
            lambda a: "GetVelocity" in a.headers.get("SOAPAction", ""),
            lambda a, f: f(replace(a, body=re.sub(rb"GetPose", b"GetVelocity", a.body))),
        ),
        messages.test_dispatch,
        BP + "R1127",
    ),
    (
        "dispatch by SOAPAction, secured",
        instead(
            lambda a: "GetVelocity" in a.headers.get("SOAPAction", ""),
            lambda a, f: f(replace(a, body=re.sub(rb"GetPose", b"GetVelocity", a.body))),
        ),
        messages.test_dispatch,
        "xml-security/soapaction-spoofing",
    ),
    (
        "malformed is 200",
        answer(lambda r: r.having(status=200) if r.status == 400 else r),
        over_http.test_malformed,
        BP + "R1125",
    ),
    (
        "malformed is 502",
        answer(lambda r: r.having(status=502) if r.status == 400 else r),
        over_http.test_malformed,
        BP + "R1125",
    ),
    (
        "any media type",
        asked(lambda a: replace(a, headers=a.headers | {"Content-Type": "text/xml"})),
        over_http.test_media_types,
        BP + "R1115",
    ),
    ("any method", lambda a, f: f(replace(a, method="POST")), over_http.test_methods, BP + "R1114"),
    (
        "unknown is done",
        instead(lambda a: b"NoSuchOperation" in a.body, done),
        messages.test_unknown_operation,
        BP + "unknown-operation",
    ),
    ("no byte order mark", unreadable(lambda a: a.body[:3] == b"\xef\xbb\xbf"), messages.test_encodings, BP + "R4001"),
    ("no UTF-16", unreadable(lambda a: a.body[:2] == b"\xff\xfe"), messages.test_encodings, BP + "utf-16"),
    ("Server for Client", to_fault(renamed(b":Client", b":Server")), messages.test_invalid_messages, BP + "R2724"),
    (
        "xsi:type wanted",
        instead(
            lambda a: b"XMLSchema-instance" not in a.body and b"GetPose" in a.body,
            lambda a, f: f(a).having(status=500, body=b""),
        ),
        messages.test_answers,
        BP + "R1017",
    ),
    (
        "another element answers",
        to_response(renamed(rb"GetVelocityResponse", b"GetPoseResponse")),
        messages.test_answers,
        BP + "R2712",
    ),
]


@pytest.mark.parametrize(("fault", "check", "id_"), [case[1:] for case in CASES], ids=[case[0] for case in CASES])
def test_caught(judged, run, fault, check, id_):
    # Quickly first; what is rare shows at standard effort.
    assert id_ in run(judged(fault), check) or id_ in run(judged(fault, effort="standard"), check)
