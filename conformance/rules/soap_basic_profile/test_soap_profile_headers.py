"""Header blocks and versions: what a SOAP 1.1 node must understand, may ignore, and tests first."""

from dataclasses import replace

import pytest

from conformance.api.soap.callable_services import (
    SoapServices,
    accepted_messages,
    callable_services,
    is_gone,
    repetitions,
)
from conformance.api.soap.calls import call, expect_answer, send
from conformance.api.soap.envelope import envelope
from conformance.api.soap.valid_messages import quiet_example
from conformance.documents.xml import ENVELOPE, NEXT_ACTOR, Node, clark
from conformance.verdict.effort import Effort
from conformance.verdict.evidence import Judge

pytestmark = pytest.mark.phase("acting")
_STRANGE = "urn:example:strange"
_OTHER_VERSION = "urn:example:soap-of-another-version"
_SOAP_12 = "http://www.w3.org/2003/05/soap-envelope"
_UNKNOWN = Node(clark(_STRANGE, "no_such_operation"))


def _block(flag: str | None = None, actor: str | None = None, space: str = ENVELOPE) -> Node:
    """Return a header block in a namespace that no robot knows."""
    given = (("mustUnderstand", flag), ("actor", actor))
    attributes = tuple((clark(space, name), value) for name, value in given if value is not None)
    return Node(clark(_STRANGE, "Transaction"), "5", (), attributes)


@pytest.mark.requirement("soap-basic-profile/R1015", "soap-basic-profile/version-mismatch")
def test_other_versions(soap: SoapServices, judge: Judge, effort: Effort) -> None:
    """Send an Envelope of another namespace."""
    for service in callable_services(soap, "soap-basic-profile/R1015", "soap-basic-profile/version-mismatch"):
        messages = [message for _, message in accepted_messages(soap, service)][: effort.cases(10)] or [_UNKNOWN]
        for message in messages:
            answer = send(service, envelope([message], space=_OTHER_VERSION))
            when = "the Envelope has another namespace"
            expect_answer(judge, "soap-basic-profile/R1015", answer).that(
                answer.fault is not None, f"a fault when {when}"
            )
            expect_answer(judge, "soap-basic-profile/version-mismatch", answer).fault("VersionMismatch", when)
        answer = send(service, envelope([messages[0]], space=_SOAP_12))
        # A robot that speaks SOAP 1.2 as well responds in it.
        speaks_both = _SOAP_12.encode() in answer.exchange.response.body
        is_fault = speaks_both or answer.fault is not None
        expect_answer(judge, "soap-basic-profile/R1015", answer).that(is_fault, "a fault for an Envelope of SOAP 1.2")


@pytest.mark.requirement("soap-basic-profile/R1025", "soap-basic-profile/R1027", "soap-basic-profile/R1028")
def test_must_understand(soap: SoapServices, judge: Judge, effort: Effort) -> None:
    """Send mandatory header blocks that no robot understands."""
    ids = ("soap-basic-profile/R1025", "soap-basic-profile/R1027", "soap-basic-profile/R1028")
    for service in callable_services(soap, *ids):
        messages = [message for _, message in accepted_messages(soap, service)]
        for message in messages[: effort.cases(10)] or [_UNKNOWN]:
            for what, headers in (
                ("a mandatory block", (_block("1"),)),
                ("a mandatory block for the next actor", (_block("1", NEXT_ACTOR),)),
                ("a mandatory block after an optional one", (_block("0"), _block("1"))),
            ):
                answer = call(service, message, headers=headers)
                is_fault = expect_answer(judge, ids[1], answer).fault("MustUnderstand", f"there is {what}")
                children = len(answer.envelope.payload) if answer.envelope is not None else 0
                for id_ in (ids[0], ids[2]) if is_fault else ():
                    expected = "the fault alone in the Body"
                    expect_answer(judge, id_, answer).that(children == 1, expected, f"{children} children of the Body")


@pytest.mark.requirement("soap-basic-profile/mustunderstand-actor", "soap-basic-profile/R2739")
def test_other_headers(soap: SoapServices, judge: Judge, effort: Effort) -> None:
    """Send mandatory blocks for another actor, and optional ones that the description does not have."""
    ids = ("soap-basic-profile/mustunderstand-actor", "soap-basic-profile/R2739")
    for service in callable_services(soap, *ids):
        for operation, message in accepted_messages(soap, service, *ids)[: effort.cases(10)]:
            for id_, what, headers in (
                ("mustunderstand-actor", "a mandatory block for another actor", (_block("1", "http://example.com/a"),)),
                ("R2739", "a block that the description does not have", (_block(),)),
                ("R2739", "a block with mustUnderstand 0", (_block("0"),)),
                ("R2739", "an optional block for the next actor", (_block("0", NEXT_ACTOR), _block())),
                ("R2739", "an empty Header", ()),
            ):
                answer = call(service, message, headers=headers)
                if is_gone(soap, service, (operation, message), answer):
                    break
                expect_answer(judge, f"soap-basic-profile/{id_}", answer).succeeds(f"there is {what}")


@pytest.mark.requirement("soap-basic-profile/R2725")
def test_order_of_faults(soap: SoapServices, judge: Judge, effort: Effort) -> None:
    """Send messages with several faults: VersionMismatch comes before MustUnderstand, and that before Client."""
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
                when = f"the Envelope has another namespace, a mandatory block and {what}"
                expect_answer(judge, "soap-basic-profile/R2725", answer).fault("VersionMismatch", when)
            for _ in range(repetitions(effort, 3)):
                answer = call(service, *body, headers=(_block("1"),))
                when = f"there is a mandatory block and {what}"
                expect_answer(judge, "soap-basic-profile/R2725", answer).fault("MustUnderstand", when)
