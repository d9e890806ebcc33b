"""SOAP over HTTP by the Basic Profile: methods, media types, SOAPAction, and malformed bodies."""

from typing import Final

import pytest

from conformance.api.expectation import expect
from conformance.api.permission import permitted_methods
from conformance.api.soap.callable_services import SoapServices, callable_services, repetitions
from conformance.api.soap.calls import SoapResponse, call, expect_answer, read_exchange, send
from conformance.api.soap.envelope import envelope
from conformance.api.soap.messages import padded
from conformance.api.soap.service import SoapService
from conformance.api.soap.valid_messages import candidates, quiet_example, require_valid_document
from conformance.contract.classes import TAKEN_OCTETS
from conformance.documents.xml import WSDL, XSD, Node, NotXmlError, clark, parse
from conformance.transport import raw
from conformance.transport.exchange import Exchange, NoAnswer, NoAnswerError
from conformance.transport.parallel import until_taken
from conformance.verdict.effort import Effort
from conformance.verdict.evidence import Judge

pytestmark = pytest.mark.phase("acting")
_ANY = Node(clark("urn:example:strange", "no_such_operation"))
_TRUNCATED_S = 5.0
_TEXT_XML: Final = {
    "media-type-case": ("Text/XML; charset=utf-8", "TEXT/XML; CHARSET=UTF-8"),
    # As in the examples of SOAP 1.1 itself, and without a charset.
    "charset-forms": ('text/xml; charset="utf-8"', "text/xml;charset=utf-8", "text/xml"),
}


def _message(service: SoapService) -> Node:
    """Return a message that the robot accepts, if known; else a well-formed message of no operation."""
    good = quiet_example(service)
    return good[1] if good else _ANY


@pytest.mark.requirement("soap-basic-profile/R1109")
def test_soap_action(soap: SoapServices, judge: Judge, effort: Effort) -> None:
    """Send SOAPAction as the description declares it; another value would break R2744 or R2745."""
    for service in callable_services(soap, "soap-basic-profile/R1109"):
        good = quiet_example(service)
        message = good[1] if good else _taken_otherwise(service)
        if message is None:
            judge.skip("soap-basic-profile/R1109", f"the {service.name} service took none of the messages tried")
            continue
        for _ in range(repetitions(effort, 3)):
            expect_answer(judge, "soap-basic-profile/R1109", call(service, message)).succeeds('SOAPAction is ""')


def _taken_otherwise(service: SoapService) -> Node | None:
    """Return a message that the robot accepts with an undeclared SOAPAction or without one, or None."""
    for operation in service.contract.operations:
        declared = service.contract.shape(operation.request) if operation.request else None
        if declared is None:
            continue
        message = next(candidates(service, operation, declared))
        for action in (f'"{operation.input_action or operation.name}"', f'"{operation.name}"', None):
            if call(service, message, soap_action=action).is_taken:
                return message
    return None


def _malformed_bodies(message: Node) -> list[tuple[str, bytes]]:
    """Return bodies that are not well-formed XML, complete enough that no parser waits for more."""
    good = envelope([message]).serialize()
    end = good.rindex(b"</")
    return [
        ("an end tag of another name", good[:end] + b"</wrong>"),
        ("text after the end", good + b"<"),
        ("no XML at all", b"no message"),
        ("JSON", b'{"Envelope": {"Body": {}}}'),
        ("a prefix that is not bound", good.replace(b"xmlns:soap", b"xmlns:other", 1)),
        ("an entity that is not declared", good.replace(b"</", b"&nothing;</", 1)),
        ("a bare ampersand", good.replace(b"</", b" & </", 1)),
        ("an attribute twice", good.replace(b" xmlns", b" a='1' a='2' xmlns", 1)),
        ("a control character", good.replace(b"</", b"\x01</", 1)),
        ("octets that are no UTF-8", good.replace(b"</", b"\xff\xfe\xfd</", 1)),
        ("two roots", good + good),
        ("an empty body", b""),
    ]


@pytest.mark.requirement("soap-basic-profile/R1125", "soap-basic-profile/R1113")
def test_malformed(soap: SoapServices, judge: Judge, effort: Effort) -> None:
    """Send malformed XML: the response is 4xx without a fault (best 400), or 500 with one."""
    for service in callable_services(soap, "soap-basic-profile/R1125", "soap-basic-profile/R1113"):
        cases = _malformed_bodies(_message(service))
        apart = service.apart()
        for what, body in cases[: effort.cases(len(cases))]:
            try:
                answer = send(apart, body)
            except NoAnswerError as none:
                if none.kind is not NoAnswer.TIMEOUT:
                    raise
                expect(judge, "soap-basic-profile/R1125", none.unanswered).that(
                    False, f"a response when there is {what}"
                )
                break  # the next one would cost another deadline
            _judge_malformed(judge, answer, what)
        apart.client.close()
        _send_truncated(judge, service)


def _judge_malformed(judge: Judge, answer: SoapResponse, what: str) -> None:
    fits = (answer.fault is None and 400 <= answer.status < 500) or (answer.fault is not None and answer.status == 500)
    expected = f"status 4xx without a fault or 500 with one when there is {what}"
    expect_answer(judge, "soap-basic-profile/R1125", answer).that(fits, expected)
    expect_answer(judge, "soap-basic-profile/R1113", answer).status(400, when=f"there is {what}")


def _send_truncated(judge: Judge, service: SoapService) -> None:
    """Send two thirds of a document over a separate connection.

    A server that parses XML as it arrives may wait for the rest until its timeout (gSOAP does); that is no violation.
    """
    document = envelope([_message(service)]).serialize()
    apart = service.apart()
    try:
        answer = send(
            apart,
            document[: len(document) * 2 // 3],
            fresh=True,
            timeout_s=min(_TRUNCATED_S, service.client.connection.timeout_s),
        )
    except NoAnswerError as none:
        if none.kind is NoAnswer.REFUSED:
            raise
        expect(judge, "soap-basic-profile/R1113", none.unanswered).status(400, when="the document is truncated")
        return
    finally:
        apart.client.close()
    _judge_malformed(judge, answer, "a truncated document")


@pytest.mark.requirement("soap-basic-profile/R1114")
def test_methods(soap: SoapServices, judge: Judge, effort: Effort) -> None:
    """Send methods other than POST; GET may return a description."""
    for service in callable_services(soap, "soap-basic-profile/R1114"):
        body = envelope([_message(service)]).serialize()
        methods = permitted_methods(soap.run, service.client, ("PUT", "GET", "DELETE", "PATCH"), service.path)
        for method in methods * repetitions(effort, 3):
            exchange = service.client.send(
                method,
                service.path,
                headers=(("Content-Type", "text/xml; charset=utf-8"), ("SOAPAction", '""')),
                body=body if method in {"PUT", "PATCH"} else b"",
            )
            described = method == "GET" and _is_description(exchange)
            expect_answer(judge, "soap-basic-profile/R1114", read_exchange(exchange)).status(405, or_else=described)


def _is_description(exchange: Exchange) -> bool:
    """Return whether a response is a WSDL or a schema."""
    try:
        root = parse(exchange.response.body, doctype=True)
    except NotXmlError:
        return False
    return root.tag in {clark(WSDL, "definitions"), clark(XSD, "schema")}


@pytest.mark.requirement("soap-basic-profile/R1115")
def test_media_types(soap: SoapServices, judge: Judge, effort: Effort) -> None:
    """Send messages as other media types than text/xml."""
    types = ("text/plain", "application/json", "application/octet-stream", "text/html", "application/xml")
    for service in callable_services(soap, "soap-basic-profile/R1115"):
        body = envelope([_message(service)]).serialize()
        for media_type in types * repetitions(effort, 3):
            answer = send(service, body, content_type=media_type)
            expect_answer(judge, "soap-basic-profile/R1115", answer).status(415, when=f"Content-Type is {media_type}")


@pytest.mark.requirement(*(f"soap-basic-profile/{name}" for name in _TEXT_XML))
def test_forms_of_the_media_type(soap: SoapServices, judge: Judge) -> None:
    """Send text/xml in other letters, and its charset in other forms."""
    for service in callable_services(soap, *(f"soap-basic-profile/{name}" for name in _TEXT_XML)):
        good = quiet_example(service)
        for name, forms in _TEXT_XML.items():
            if good is None:
                judge.note(f"soap-basic-profile/{name}", f"the {service.name} service took none of the messages tried")
                continue
            for media_type in forms:
                answer = send(service, envelope([good[1]]).serialize(), content_type=media_type)
                expect_answer(judge, f"soap-basic-profile/{name}", answer).succeeds(f"Content-Type is {media_type}")


@pytest.mark.requirement("soap-basic-profile/chunked")
def test_messages_in_chunks(soap: SoapServices, judge: Judge) -> None:
    """Send messages in chunks, as clients do that write while they serialize."""
    for service in callable_services(soap, "soap-basic-profile/chunked"):
        good = quiet_example(service)
        if good is None:
            judge.note("soap-basic-profile/chunked", f"the {service.name} service took none of the messages tried")
            continue
        small = require_valid_document(service, envelope([good[1]]).serialize())
        large = require_valid_document(service, padded(small, TAKEN_OCTETS))
        for document, size in ((small, 7), (large, 4096), (large, TAKEN_OCTETS)):
            _judge_chunked(judge, service, document, size)


def _judge_chunked(judge: Judge, service: SoapService, document: bytes, size: int) -> None:
    fields = ("Content-Type: text/xml; charset=utf-8", 'SOAPAction: ""', "Transfer-Encoding: chunked")
    octets = raw.head(service.client, "POST", service.path, *fields) + raw.chunked(document, size)
    client = service.client
    *_, attempt = until_taken(
        client.connection, lambda: raw.read_one(client, octets, raw.talk(client, octets, answers=1), "POST")[0]
    )
    answer = read_exchange(attempt) if isinstance(attempt, Exchange) else None
    expect(judge, "soap-basic-profile/chunked", attempt).that(
        raw.refuses_chunks(attempt) or (answer is not None and answer.is_taken),
        f"status 2xx with a SOAP message when {len(document):,} bytes come in chunks of {size:,}",
        answer.describe() if answer is not None else "",
        cause=attempt.came,
    )
