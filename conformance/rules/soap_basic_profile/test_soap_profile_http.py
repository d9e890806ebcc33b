"""SOAP over HTTP by the Basic Profile: methods, media types, SOAPAction, and bodies that are no XML."""

from typing import Final

import pytest

from conformance.api.soap.callable_services import SoapServices, callable_services, repetitions
from conformance.api.soap.calls import SoapResponse, call, judge_answer, read_exchange, send
from conformance.api.soap.envelope import envelope
from conformance.api.soap.messages import padded
from conformance.api.soap.service import SoapService
from conformance.api.soap.valid_messages import candidates, quiet_example, require_valid_document
from conformance.contract.sizes import TAKEN_OCTETS
from conformance.documents.xml import NotXmlError, parse
from conformance.documents.xml_names import WSDL, XSD, clark
from conformance.documents.xml_node import Node
from conformance.transport import raw
from conformance.transport.exchange import Exchange, NoAnswer, NoAnswerError
from conformance.verdict.effort import Effort
from conformance.verdict.evidence import Judge

pytestmark = pytest.mark.phase("delivery")
_ANY = Node(clark("urn:example:strange", "no_such_operation"))
_TRUNCATED_S = 5.0
_TEXT_XML: Final = {
    "media-type-case": ("Text/XML; charset=utf-8", "TEXT/XML; CHARSET=UTF-8"),
    # As in the examples of SOAP 1.1 itself, and with nothing else said.
    "charset-forms": ('text/xml; charset="utf-8"', "text/xml;charset=utf-8", "text/xml"),
}


def _message(service: SoapService) -> Node:
    """A message that the robot takes, if there is one; else one that any robot can tell from no message."""
    good = quiet_example(service)
    return good[1] if good else _ANY


@pytest.mark.requirement("soap-basic-profile/R1109")
def test_soap_action(soap: SoapServices, judge: Judge, effort: Effort) -> None:
    """SOAPAction is taken as the description asks for it; another one breaks R2744 or R2745 itself."""
    for service in callable_services(soap, "soap-basic-profile/R1109"):
        good = quiet_example(service)
        message = good[1] if good else _taken_otherwise(service)
        if message is None:
            judge.skip("soap-basic-profile/R1109", f"the {service.name} service took none of the messages tried")
            continue
        for _ in range(repetitions(effort, 3)):
            answer = call(service, message)
            judge_answer(judge, "soap-basic-profile/R1109", answer.accepted, answer, '2xx with SOAPAction: ""')


def _taken_otherwise(service: SoapService) -> Node | None:
    """A message that the robot takes with a SOAPAction that the description does not ask for, or with none."""
    for operation in service.contract.operations:
        declared = service.contract.shape(operation.request) if operation.request else None
        if declared is None:
            continue
        message = next(candidates(service, operation, declared))
        for action in (f'"{operation.input_action or operation.name}"', f'"{operation.name}"', None):
            if call(service, message, soap_action=action).accepted:
                return message
    return None


def _malformed(message: Node) -> list[tuple[str, bytes]]:
    """Bodies that are no well-formed XML, none of which leaves a reader waiting for more."""
    good = envelope([message]).written()
    end = good.rindex(b"</")
    return [
        ("an end tag of another name", good[:end] + b"</wrong>"),
        ("text after the end", good + b"<"),
        ("no XML at all", b"delivery please"),
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
    """Malformed XML is answered 4xx without a fault (best 400), or 500 with one."""
    for service in callable_services(soap, "soap-basic-profile/R1125", "soap-basic-profile/R1113"):
        cases = _malformed(_message(service))
        apart = service.apart()
        for what, body in cases[: effort.cases(len(cases))]:
            try:
                answer = send(apart, body)
            except NoAnswerError as none:
                if none.kind is not NoAnswer.TIMEOUT:
                    raise
                judge.check("soap-basic-profile/R1125", False, none.unanswered, f"an answer to {what}")
                # One deadline is enough to know it.
                break
            _judge_malformed(judge, answer, what)
        apart.client.close()
        _truncated(judge, service)


def _judge_malformed(judge: Judge, answer: SoapResponse, what: str) -> None:
    fits = (answer.fault is None and 400 <= answer.status < 500) or (answer.fault is not None and answer.status == 500)
    expected = f"4xx without a fault or 500 with one, for {what}"
    judge_answer(judge, "soap-basic-profile/R1125", fits, answer, expected)
    judge_answer(judge, "soap-basic-profile/R1113", answer.status == 400, answer, f"status 400 for {what}")


def _truncated(judge: Judge, service: SoapService) -> None:
    """Send half a document, in a connection that ends with it.

    A server that reads XML as it comes may wait for the rest until its own deadline (gSOAP does): that is no breach.
    """
    document = envelope([_message(service)]).written()
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
        judge.check("soap-basic-profile/R1113", False, none.unanswered, "status 400 for a truncated document")
        return
    finally:
        apart.client.close()
    _judge_malformed(judge, answer, "a truncated document")


@pytest.mark.requirement("soap-basic-profile/R1114")
def test_methods(soap: SoapServices, judge: Judge, effort: Effort) -> None:
    """Methods other than POST are answered 405; GET may be answered with a description."""
    for service in callable_services(soap, "soap-basic-profile/R1114"):
        body = envelope([_message(service)]).written()
        for method in ("PUT", "GET", "DELETE", "PATCH") * repetitions(effort, 3):
            exchange = service.client.send(
                method,
                service.path,
                headers=(("Content-Type", "text/xml; charset=utf-8"), ("SOAPAction", '""')),
                body=body if method in {"PUT", "PATCH"} else b"",
            )
            status = exchange.response.status
            judge.check(
                "soap-basic-profile/R1114",
                status == 405 or (method == "GET" and _is_description(exchange)),
                exchange,
                f"405 for {method}",
                found=read_exchange(exchange).describe() if status == 500 else "",
            )


def _is_description(exchange: Exchange) -> bool:
    """Whether an answer is a WSDL or a schema."""
    try:
        root = parse(exchange.response.body, doctype=True)
    except NotXmlError:
        return False
    return root.tag in {clark(WSDL, "definitions"), clark(XSD, "schema")}


@pytest.mark.requirement("soap-basic-profile/R1115")
def test_media_types(soap: SoapServices, judge: Judge, effort: Effort) -> None:
    """A message that comes as anything but text/xml is answered 415."""
    types = ("text/plain", "application/json", "application/octet-stream", "text/html", "application/xml")
    for service in callable_services(soap, "soap-basic-profile/R1115"):
        body = envelope([_message(service)]).written()
        for media_type in types * repetitions(effort, 3):
            answer = send(service, body, content_type=media_type)
            judge_answer(judge, "soap-basic-profile/R1115", answer.status == 415, answer, f"415 for {media_type}")


@pytest.mark.requirement(*(f"soap-basic-profile/{name}" for name in _TEXT_XML))
def test_forms_of_the_media_type(soap: SoapServices, judge: Judge) -> None:
    """text/xml is the same in other letters, and its charset is the same in quotation marks."""
    for service in callable_services(soap, *(f"soap-basic-profile/{name}" for name in _TEXT_XML)):
        good = quiet_example(service)
        for name, forms in _TEXT_XML.items():
            if good is None:
                judge.note(f"soap-basic-profile/{name}", f"the {service.name} service took none of the messages tried")
                continue
            for media_type in forms:
                answer = send(service, envelope([good[1]]).written(), content_type=media_type)
                judge_answer(
                    judge, f"soap-basic-profile/{name}", answer.accepted, answer, f"2xx for Content-Type: {media_type}"
                )


@pytest.mark.requirement("soap-basic-profile/chunked")
def test_messages_in_chunks(soap: SoapServices, judge: Judge) -> None:
    """A message is the same in chunks as in one piece, as clients send it that write while they serialize."""
    for service in callable_services(soap, "soap-basic-profile/chunked"):
        good = quiet_example(service)
        if good is None:
            judge.note("soap-basic-profile/chunked", f"the {service.name} service took none of the messages tried")
            continue
        small = require_valid_document(service, envelope([good[1]]).written())
        large = require_valid_document(service, padded(small, TAKEN_OCTETS))
        for document, size in ((small, 7), (large, 4096), (large, TAKEN_OCTETS)):
            _judge_chunked(judge, service, document, size)


def _judge_chunked(judge: Judge, service: SoapService, document: bytes, size: int) -> None:
    fields = ("Content-Type: text/xml; charset=utf-8", 'SOAPAction: ""', "Transfer-Encoding: chunked")
    octets = raw.head(service.client, "POST", service.path, *fields) + raw.chunked(document, size)
    attempt, _ = raw.read_one(service.client, octets, raw.talk(service.client, octets, answers=1), "POST")
    judge.check(
        "soap-basic-profile/chunked",
        isinstance(attempt, Exchange) and (read_exchange(attempt).accepted or _knows_no_chunks(attempt)),
        attempt,
        f"2xx for a message of {len(document):,} octets in chunks of {size:,}",
        found=read_exchange(attempt).describe() if isinstance(attempt, Exchange) else attempt.came,
        cause=attempt.came,
    )


def _knows_no_chunks(exchange: Exchange) -> bool:
    """Whether a server of HTTP/1.0, which has no chunks, asks for a length (RFC 9112 6.1)."""
    return exchange.response.http_version == "HTTP/1.0" and exchange.response.status == 411
