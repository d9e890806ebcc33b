"""What is watched in every SOAP answer: each breach is held against its requirement, and a good answer against none."""

import re

import pytest

from conformance.checkers.soap import SoapCheckers
from conformance.contract.pack import Contract
from conformance.transport.exchange import Exchange, Request, Response
from conformance.verdict.evidence import CheckerListener, Judge

URL = "http://robot/ws"
SPACE = "http://soap.turtlebot.mybot.org/"
XML = "text/xml; charset=utf-8"
OPEN = '<s:Envelope xmlns:s="http://schemas.xmlsoap.org/soap/envelope/"><s:Body>'
CLOSE = "</s:Body></s:Envelope>"
RESPONSE = f'{OPEN}<t:GetGoalResponse xmlns:t="{SPACE}"/>{CLOSE}'
FAULT = f"{OPEN}<s:Fault><faultcode>s:Client</faultcode><faultstring>no</faultstring></s:Fault>{CLOSE}"


def broken(body: str, status: int, media_type: str = XML, version: str = "HTTP/1.1") -> set[str]:
    """Names of the requirements that an answer breaks."""
    judge = Judge(Contract.load().ledger)
    observer = CheckerListener(judge, [SoapCheckers({URL: {f"{{{SPACE}}}GetGoalResponse"}})])
    response = Response(status, (("Content-Type", media_type),), body.encode(), 1.0, version)
    observer.on_response(Exchange(Request("POST", URL), response))
    return {id_.rpartition("/")[2] for id_, evidence in judge.evidence.items() if evidence.findings}


def present(name: str) -> str:
    """Return the present name of a requirement that was merged into another one."""
    id_ = f"soap-basic-profile/{name}"
    return Contract.load().ids_by_alias.get(id_, id_).rpartition("/")[2]


@pytest.mark.parametrize(("body", "status"), [(RESPONSE, 200), (FAULT, 500), ("", 202)])
def test_a_good_answer_breaks_nothing(body, status):
    assert broken(body, status) == set()


def test_what_is_no_soap_answer_is_none_to_judge():
    assert broken("<html/>", 404, "text/html") == set()
    assert broken("not found", 404, "text/plain") == set()


FAULTS = [
    (r"(faultcode>)s:", r"\1", "faultcode-qualified"),
    (r"(faultcode>)s:", r"\1nowhere:", "faultcode-qualified"),
    (":Client<", ":Sender<", "R1004"),
    (":Client<", ":Sender<", "fault-code"),
    ("<faultcode>s:", '<faultcode xmlns:o="urn:own">o:', "fault-code"),
    ("<faultstring>.*?</faultstring>", "", "fault-complete"),
    ("<faultcode>.*?</faultcode>", "", "fault-complete"),
    ("(</faultstring>)", r"\1<time>1</time>", "R1000"),
    ("faultstring>", "s:faultstring>", "R1001"),
    ("(</faultstring>)", r"Traceback (most recent call last): \1", "fault-no-traceback"),
    ("(<s:Fault)", r"<?a b?>\1", "R1009"),
]
RESPONSES = [
    ("$", "<?a b?>", "R1009"),
    ("^", "<?a b?>", "R1009"),
    ("^", "<!DOCTYPE s:Envelope>", "R1008"),
    ("(</s:Envelope>)", r'<x xmlns="urn:x"/>\1', "R1011"),
    ("(<s:Body)", r'<s:Header><a xmlns="urn:a" s:mustUnderstand="true"/></s:Header>\1', "R1013"),
    ("t:GetGoalResponse xmlns:t=.*?/>", "GetGoalResponse/>", "R1014"),
    ("(GetGoalResponse) ", r'\1 s:encodingStyle="urn:a" ', "R1006"),
    ("(<s:Body)", r'\1 s:encodingStyle="urn:a"', "R1005"),
    ("GetGoalResponse", "GetGoal", "R2712"),
    ("(?s).*", "<html/>", "content-type"),
    ("(?s).*", "done", "content-type"),
]


@pytest.mark.parametrize(
    ("answer", "status", "old", "new", "name"),
    [*((FAULT, 500, *row) for row in FAULTS), *((RESPONSE, 200, *row) for row in RESPONSES)],
)
def test_breaches_of_an_answer(answer, status, old, new, name):
    assert present(name) in broken(re.sub(old, new, answer, count=0 if answer is FAULT else 1), status)


@pytest.mark.parametrize(
    ("body", "status", "media_type", "version", "name"),
    [
        (FAULT, 200, XML, "HTTP/1.1", "R1126"),
        (FAULT, 400, XML, "HTTP/1.1", "R1126"),
        (RESPONSE, 302, XML, "HTTP/1.1", "R1124"),
        (RESPONSE, 201, XML, "HTTP/1.1", "R1111"),
        (RESPONSE, 200, "application/soap+xml", "HTTP/1.1", "content-type"),
        (RESPONSE, 200, "text/xml; charset=iso-8859-1", "HTTP/1.1", "R1012"),
        (RESPONSE, 200, "text/xml; charset=utf-16", "HTTP/1.1", "R1018"),
        (RESPONSE, 200, XML, "HTTP/1.2", "R1141"),
    ],
)
def test_breaches_of_http(body, status, media_type, version, name):
    assert present(name) in broken(body, status, media_type, version)
