"""Every successful SOAP response of a run is judged by the XSD."""

import pytest

from conformance.api.soap.service import SoapService
from conformance.contract.interfaces import Interface
from conformance.packs.table1.checkers.soap_responses import SoapResponses
from conformance.papers_robot.files import CONTRACT_DIR
from conformance.transport.client import Connection, HttpClient
from conformance.transport.exchange import Exchange, Request, Response
from conformance.verdict.observers import Observers
from conformance.verdict.run import Run

_URL = "http://robot:5555/turtlesim_subscriber_ws"
_POINT = "<x>{}</x><y>0.0</y><z>0.0</z>"
_VELOCITY = (
    '<s:Envelope xmlns:s="http://schemas.xmlsoap.org/soap/envelope/"><s:Body>'
    '<t:GetVelocityResponse xmlns:t="http://soap.turtlebot.mybot.org/"><return>'
    f"<linear>{_POINT}</linear><angular>{_POINT.format('0.0')}</angular>"
    "</return></t:GetVelocityResponse></s:Body></s:Envelope>"
)


@pytest.mark.parametrize(
    ("body", "status", "refuted"),
    [
        (_VELOCITY.format("0.5"), 200, False),
        (_VELOCITY.format("0,5"), 200, True),
        (_VELOCITY.format("0.5").replace("<linear>", "<linear/><linear>"), 200, True),
        (_VELOCITY.format("0,5"), 500, False),
        ("no XML", 200, False),
        ("", 200, True),
        ("", 202, False),
        ("", 413, False),
    ],
)
def test_an_invalid_response_is_found_whoever_asked(body, status, refuted):
    base, path = _URL.rsplit("/", 1)
    client, wsdl = HttpClient(base, Connection()), CONTRACT_DIR / "subscribers.wsdl"
    service = SoapService(Interface.SUBSCRIBERS, client, f"/{path}", contract_wsdl_path=wsdl)
    vars(service)["described"] = service.contract  # as a check has found it
    run = Run()
    response = Response(status, (("Content-Type", "text/xml"),), body.encode(), 1.0)
    Observers(run.judge, [SoapResponses([service])]).answered(Exchange(Request("POST", _URL, (), b"<a/>"), response))
    assert set(run.judge.refuted()) == ({"soap-subscribers/response-valid"} if refuted else set())
