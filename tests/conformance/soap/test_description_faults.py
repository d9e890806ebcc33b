"""Wrong descriptions are seen."""

from __future__ import annotations

import pytest
from spoiling import described

from conformance.checks.describe import test_wsdl as wsdl

CASES = [
    ("no WSDL", lambda a, f: f(a).having(status=404) if a.method == "GET" else f(a), "describe/wsdl"),
    ("broken WSDL", described(rb"(?s)</[\w:]*definitions>", b""), "describe/wsdl"),
    ("other service name", described(rb'(<[\w:]*service name=")', rb"\1X"), "describe/wsdl-names"),
    (
        "other namespace",
        described(rb"http://soap.turtlebot.mybot.org/", b"http://soap.example.org/"),
        "describe/wsdl-names",
    ),
    ("operation renamed", described(rb"ExecuteCoffeeRequest|GetGoal", b"Other"), "describe/wsdl-operations"),
    ("soapAction", described(rb'soapAction=""', b'soapAction="urn:x"'), "describe/wsdl-operations"),
    ("int for double", described(rb":double", b":int"), "describe/wsdl-types"),
    ("optional field", described(rb'(name="(depot_x|header)")', rb'\1 minOccurs="0"'), "describe/wsdl-types"),
    (
        "qualified fields",
        described(rb"<([\w:]*schema )", rb'<\1elementFormDefault="qualified" '),
        "describe/wsdl-types",
    ),
    ("other actions", described(rb'Action="[^"]*"', b'Action="urn:x"'), "describe/wsdl-action"),
    (
        "address of nobody",
        described(rb'(address location=")[^"]*', rb"\1http://127.0.0.1:9/x"),
        "describe/wsdl-address",
    ),
    ("no transport", described(rb' transport="[^"]*"', b""), "describe/wsdl-R2701"),
    ("transport SMTP", described(rb'transport="[^"]*"', b'transport="urn:smtp"'), "describe/wsdl-R2702"),
    ("rpc", described(rb'style="document"', b'style="rpc"'), "describe/wsdl-R2705"),
    ("encoded", described(rb'use="literal"', b'use="encoded"'), "describe/wsdl-R2706"),
    ("namespace on body", described(rb'use="literal"', b'use="literal" namespace="urn:x"'), "describe/wsdl-R2716"),
    ("part by type", described(rb'(<[\w:]*part [^>]*)element="', rb'\1type="'), "describe/wsdl-R2204"),
    ("dangling element", described(rb'(<[\w:]*part [^>]*element="\w+:)', rb"\1No"), "describe/wsdl-R2206"),
    (
        "portType twice",
        described(rb"(?s)(<([\w:]*)operation .*?</\2operation>)(?=.*portType>)", rb"\1\1"),
        "describe/wsdl-R2304",
    ),
    ("latin-1", described(rb"encoding=.[\w-]+.", b"encoding='iso-8859-1'"), "describe/wsdl-R4003"),
]


@pytest.mark.parametrize(("fault", "id_"), [case[1:] for case in CASES], ids=[case[0] for case in CASES])
def test_wrong_description_is_caught(judged, run, fault, id_):
    failed = run(judged(fault), wsdl.test_served, wsdl.test_same_as_contract, wsdl.test_address, wsdl.test_profile)
    assert id_ in failed
