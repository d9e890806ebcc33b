"""Header blocks and versions: what a SOAP 1.1 node has to understand, may let be, and in which order it looks."""

from dataclasses import replace

import pytest

from conformance.api.soap.callable_services import SoapServices, callable_services, repetitions
from conformance.api.soap.calls import SoapResponse, call, judge_answer, send
from conformance.api.soap.envelope import envelope
from conformance.api.soap.service import SoapService
from conformance.api.soap.valid_messages import example, quiet_example
from conformance.documents.xml_names import ENVELOPE, NEXT_ACTOR, clark
from conformance.documents.xml_node import Node
from conformance.verdict.effort import Effort
from conformance.verdict.evidence import Judge

pytestmark = pytest.mark.phase("delivery")
_STRANGE = "urn:example:strange"
_OTHER_VERSION = "urn:example:soap-of-another-version"
_SOAP_12 = "http://www.w3.org/2003/05/soap-envelope"
_UNKNOWN = Node(clark(_STRANGE, "no_such_operation"))


def _block(flag: str | None = None, actor: str | None = None, space: str = ENVELOPE) -> Node:
    """A header block that no robot knows."""
    given = (("mustUnderstand", flag), ("actor", actor))
    attributes = tuple((clark(space, name), value) for name, value in given if value is not None)
    return Node(clark(_STRANGE, "Transaction"), "5", (), attributes)


def _messages(service: SoapService) -> list[Node]:
    """A message that the robot takes for each operation."""
    found = [example(service, operation) for operation in service.contract.operations]
    return [message for message in found if message is not None]


def _is_fault(judge: Judge, id_: str, answer: SoapResponse, code: str, what: str) -> bool:
    return judge_answer(judge, id_, answer.code == code, answer, f"a fault with the code {code} for {what}")


@pytest.mark.requirement("soap-basic-profile/R1015", "soap-basic-profile/version-mismatch")
def test_other_versions(soap: SoapServices, judge: Judge, effort: Effort) -> None:
    """An Envelope of another namespace is answered with a fault, VersionMismatch."""
    for service in callable_services(soap, "soap-basic-profile/R1015", "soap-basic-profile/version-mismatch"):
        messages = _messages(service)[: effort.cases(10)] or [_UNKNOWN]
        for message in messages:
            answer = send(service, envelope([message], space=_OTHER_VERSION))
            judge_answer(
                judge,
                "soap-basic-profile/R1015",
                answer.fault is not None,
                answer,
                "a fault for an Envelope of another namespace",
            )
            _is_fault(judge, "soap-basic-profile/version-mismatch", answer, "VersionMismatch", "another envelope")
        answer = send(service, envelope([messages[0]], space=_SOAP_12))
        # A robot that speaks SOAP 1.2 as well answers in it, and has no other version before it.
        speaks_both = _SOAP_12.encode() in answer.exchange.response.body
        judge_answer(
            judge,
            "soap-basic-profile/R1015",
            speaks_both or answer.fault is not None,
            answer,
            "a fault for an Envelope of SOAP 1.2",
        )


@pytest.mark.requirement("soap-basic-profile/R1025", "soap-basic-profile/R1027", "soap-basic-profile/R1028")
def test_must_understand(soap: SoapServices, judge: Judge, effort: Effort) -> None:
    """A mandatory header block that is not understood is answered with MustUnderstand, and nothing else is done."""
    ids = ("soap-basic-profile/R1025", "soap-basic-profile/R1027", "soap-basic-profile/R1028")
    for service in callable_services(soap, *ids):
        for message in _messages(service)[: effort.cases(10)] or [_UNKNOWN]:
            for what, headers in (
                ("a mandatory block", (_block("1"),)),
                ("a mandatory block for the next actor", (_block("1", NEXT_ACTOR),)),
                ("a mandatory block after an optional one", (_block("0"), _block("1"))),
            ):
                answer = call(service, message, headers=headers)
                _is_fault(judge, "soap-basic-profile/R1027", answer, "MustUnderstand", what)
                if answer.code == "MustUnderstand" and answer.envelope is not None:
                    for id_ in ("soap-basic-profile/R1025", "soap-basic-profile/R1028"):
                        judge.check(
                            id_,
                            len(answer.envelope.payload) == 1,
                            answer.exchange,
                            "the fault, and no response beside it",
                            found=f"{len(answer.envelope.payload)} children of Body",
                        )


@pytest.mark.requirement("soap-basic-profile/mustunderstand-actor", "soap-basic-profile/R2739")
def test_other_headers(soap: SoapServices, judge: Judge, effort: Effort) -> None:
    """Mandatory blocks for somebody else, and optional ones that the description does not have, change nothing."""
    for service in callable_services(soap, "soap-basic-profile/mustunderstand-actor", "soap-basic-profile/R2739"):
        for message in _messages(service)[: effort.cases(10)]:
            for id_, what, headers in (
                ("mustunderstand-actor", "a mandatory block for another actor", (_block("1", "http://example.com/a"),)),
                ("R2739", "a block that the description does not have", (_block(),)),
                ("R2739", "a block with mustUnderstand 0", (_block("0"),)),
                ("R2739", "an optional block for the next actor", (_block("0", NEXT_ACTOR), _block())),
                ("R2739", "an empty Header", ()),
            ):
                answer = call(service, message, headers=headers)
                judge_answer(judge, f"soap-basic-profile/{id_}", answer.accepted, answer, f"2xx with {what}")


@pytest.mark.requirement("soap-basic-profile/R2725")
def test_order_of_faults(soap: SoapServices, judge: Judge, effort: Effort) -> None:
    """VersionMismatch comes before MustUnderstand, and MustUnderstand before Client."""
    for service in callable_services(soap, "soap-basic-profile/R2725"):
        good = quiet_example(service)
        message = good[1] if good else _UNKNOWN
        broken = replace(message, children=(*message.children, Node("no_such_element", "x")))
        for payload, what in (
            (_UNKNOWN, "an unknown operation"),
            (broken, "an invalid message"),
            (None, "an empty Body"),
        ):
            body = [payload] if payload is not None else []
            for space in (_OTHER_VERSION,) * repetitions(effort, 3):
                old = envelope(body, (_block("1", space=space),), space=space)
                answer = send(service, old)
                _is_fault(
                    judge,
                    "soap-basic-profile/R2725",
                    answer,
                    "VersionMismatch",
                    f"another envelope with a mandatory block and {what}",
                )
            for _ in range(repetitions(effort, 3)):
                answer = call(service, *body, headers=(_block("1"),))
                _is_fault(judge, "soap-basic-profile/R2725", answer, "MustUnderstand", f"a mandatory block and {what}")
