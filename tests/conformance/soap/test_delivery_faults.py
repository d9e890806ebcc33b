"""Faults of the publishers service are seen."""

from __future__ import annotations

import re

import pytest
from spoiling import cleaned, one_in, renamed, to_response, unreadable

from conformance.checks.soap_delivery import test_soap_delivery as delivery
from conformance.checks.soap_delivery import test_soap_interop as interop

CASES = [
    (
        "a response of SOAP 1.2",
        to_response(renamed(rb"http://schemas.xmlsoap.org/soap/envelope/", b"http://www.w3.org/2003/05/soap-envelope")),
        delivery.test_operations,
        "soap-delivery/response-valid",
    ),
    (
        "response of the other operation",
        to_response(renamed(b"DeliveryRequestResponse", b"CoffeeRequestResponse")),
        delivery.test_operations,
        "soap-delivery/delivery",
    ),
    (
        "response in no namespace",
        to_response(renamed(rb' xmlns(:\w+)?="http://soap.turtlebot[^"]*"', b"")),
        delivery.test_operations,
        "soap-delivery/delivery",
    ),
    ("no plus signs", unreadable(lambda a: b">+" in a.body), delivery.test_range, "soap-delivery/range"),
    (
        "no exponents",
        unreadable(lambda a: re.search(rb"\de[-+\d]", a.body)),
        delivery.test_range,
        "soap-delivery/range",
    ),
    (
        "no spaces around values",
        unreadable(lambda a: re.search(rb"<depot_x>\s|\d\s+</", a.body)),
        delivery.test_range,
        "soap-delivery/range",
    ),
    (
        "prefixes matter",
        unreadable(lambda a: b"soapenv:Envelope" not in a.body),
        delivery.test_syntax,
        "soap-delivery/syntax",
    ),
    ("no CDATA", unreadable(lambda a: b"CDATA" in a.body), delivery.test_syntax, "soap-delivery/syntax"),
    (
        "no addressing",
        unreadable(lambda a: b"addressing" in a.body),
        delivery.test_addressing,
        "soap-delivery/addressing",
    ),
    ("any code", cleaned(rb"(<message_code>)[^<]*", rb"\g<1>4"), delivery.test_codes, "strict-input/soap-code"),
    (
        "any code, warned",
        cleaned(rb"(<message_code>)[^<]*", rb"\g<1>4"),
        delivery.test_codes,
        "soap-delivery/refuses-code",
    ),
    (
        "one refusal in 50",
        one_in(50, lambda r: r.having(status=503, body=b"")),
        delivery.test_operations,
        "soap-delivery/coffee",
    ),
    ("no zeep", to_response(lambda r: r.having(body=b"<a/>")), interop.test_publishers, "soap-delivery/interop"),
]


@pytest.mark.parametrize(("fault", "check", "id_"), [case[1:] for case in CASES], ids=[case[0] for case in CASES])
def test_caught(judged, run, fault, check, id_):
    # Quickly first; what is rare shows at standard effort.
    assert id_ in run(judged(fault), check) or id_ in run(judged(fault, effort="standard"), check)
