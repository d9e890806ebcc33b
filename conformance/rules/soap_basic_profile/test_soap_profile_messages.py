"""Messages by the Basic Profile: dispatch, encodings, and messages that break the WSDL."""

import codecs

import pytest

from conformance.api.soap.callable_services import SoapServices, accepted_messages, callable_services, is_gone
from conformance.api.soap.calls import call, expect_answer, send
from conformance.api.soap.envelope import envelope
from conformance.api.soap.service import SoapService
from conformance.api.soap.valid_messages import candidates, example, require_valid_document, with_xsi_types
from conformance.api.soap.xml_style import XmlStyle, serialize
from conformance.documents.xml import Node, clark
from conformance.verdict.effort import Effort
from conformance.verdict.evidence import Judge

pytestmark = pytest.mark.phase("acting")
_STRANGE = "urn:example:strange"
_REPEATED = (
    "soap-basic-profile/R2712",
    "soap-basic-profile/R1017",
    "soap-basic-profile/R1111",
    "soap-basic-profile/R1124",
)


@pytest.mark.requirement(*_REPEATED)
def test_answers(soap: SoapServices, judge: Judge, effort: Effort) -> None:
    """Send valid messages without xsi:type: the response is 200 with the element that the description declares."""
    for service in callable_services(soap, *_REPEATED):
        good = accepted_messages(soap, service)
        for id_ in _REPEATED if not good else ():
            judge.skip(id_, f"the {service.name} service accepted none of the messages tried")
        _send_typed(judge, service)
        for operation, message in good:
            for _ in range(effort.cases(15)):
                answer = call(service, message)
                if is_gone(soap, service, (operation, message), answer):
                    break
                if expect_answer(judge, "soap-basic-profile/R1017", answer).succeeds("a valid message has no xsi:type"):
                    same = answer.payload == operation.response
                    expected = f"the element {operation.response} in the Body"
                    expect_answer(judge, "soap-basic-profile/R2712", answer).that(same, expected)


def _send_typed(judge: Judge, service: SoapService) -> None:
    """Send messages with xsi:type to operations that refuse them without it: they must refuse these too."""
    for operation in service.contract.operations:
        declared = service.contract.shape(operation.request) if operation.request else None
        if declared is None or example(service, operation) is not None:
            continue
        plain = next(candidates(service, operation, declared))
        answer = send(service, with_xsi_types(envelope([plain]), declared, plain))
        # Once more without: what was refused before may be there by now, as a goal that has begun.
        needs_type = answer.is_taken and not send(service, envelope([plain])).is_taken
        expected = f"status 2xx for {operation.name} without xsi:type, as with it"
        found = "a refusal without xsi:type"
        expect_answer(judge, "soap-basic-profile/R1017", answer).that(not needs_type, expected, found)


@pytest.mark.requirement("soap-basic-profile/R1127", "xml-security/soapaction-spoofing")
def test_dispatch(soap: SoapServices, judge: Judge, effort: Effort) -> None:
    """Send messages with the SOAPAction of other operations: the Body's element chooses the operation."""
    ids = ("soap-basic-profile/R1127", "xml-security/soapaction-spoofing")
    for service in callable_services(soap, *ids):
        for operation, message in accepted_messages(soap, service, *ids):
            others = [other for other in service.contract.operations if other.name != operation.name]
            spoofed = [f'"{other.input_action}"' for other in others if other.input_action]
            spoofed += [f'"{other.name}"' for other in others] + ['"urn:example:strange"']
            for action in spoofed[: effort.cases(len(spoofed))]:
                answer = call(service, message, soap_action=action)
                # A robot may refuse an action that nothing declares; it must not run the other operation.
                right = answer.is_refused or (answer.is_taken and answer.payload == operation.response)
                for id_ in ids:
                    expected = f"the element {operation.response} or a refusal when SOAPAction is {action}"
                    expect_answer(judge, id_, answer).that(right, expected)


@pytest.mark.requirement("soap-basic-profile/unknown-operation")
def test_unknown_operation(soap: SoapServices, judge: Judge, effort: Effort) -> None:
    """Send Body elements that no operation has."""
    id_ = "soap-basic-profile/unknown-operation"
    for service in callable_services(soap, id_):
        space = service.contract.target_namespace
        known = [operation for operation in service.contract.operations if operation.request]
        tags = [clark(space, "NoSuchOperation"), clark(_STRANGE, "NoSuchOperation"), "NoSuchOperation"]
        tags += [clark(_STRANGE, operation.name) for operation in known]
        tags += [str(operation.response) for operation in known if operation.response]
        for tag in tags[: effort.cases(len(tags))]:
            for action in ('""', f'"{known[0].input_action or known[0].name}"') if known else ('""',):
                answer = call(service, Node(tag), soap_action=action)
                expected = f"a fault or status 4xx when the Body has the unknown element {tag}"
                expect_answer(judge, id_, answer).that(answer.is_refused, expected)


@pytest.mark.requirement("soap-basic-profile/R4001", "soap-basic-profile/utf-16")
def test_encodings(soap: SoapServices, judge: Judge, effort: Effort) -> None:
    """Send a byte order mark, and UTF-16."""
    ids = ("soap-basic-profile/R4001", "soap-basic-profile/utf-16")
    for service in callable_services(soap, *ids):
        for operation, message in accepted_messages(soap, service, *ids)[: effort.cases(6)]:
            plain = serialize(envelope([message]), XmlStyle())
            declared = '<?xml version="1.0" encoding="UTF-16"?>' + plain
            utf8 = serialize(envelope([message]), XmlStyle(declaration='<?xml version="1.0" encoding="UTF-8"?>'))
            for id_, what, body, charset in (
                ("R4001", "UTF-8 with a byte order mark", codecs.BOM_UTF8 + plain.encode(), "utf-8"),
                ("R4001", "UTF-8 with mark and declaration", codecs.BOM_UTF8 + utf8.encode(), "utf-8"),
                ("utf-16", "UTF-16, little end first", codecs.BOM_UTF16_LE + declared.encode("utf-16-le"), "utf-16"),
                ("utf-16", "UTF-16, big end first", codecs.BOM_UTF16_BE + declared.encode("utf-16-be"), "utf-16"),
            ):
                valid = require_valid_document(service, body)
                answer = send(service, valid, content_type=f"text/xml; charset={charset}")
                if is_gone(soap, service, (operation, message), answer):
                    break
                right = answer.is_taken and answer.payload == operation.response
                expect_answer(judge, f"soap-basic-profile/{id_}", answer).that(
                    right, f"status 2xx for a message in {what}"
                )
