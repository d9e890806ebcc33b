"""XML attacks on the SOAP services: the robot must reject them, leak nothing, call no address, and stay responsive."""

import statistics
from collections.abc import Iterator
from dataclasses import replace

import pytest

from conformance.api.soap.attack_runner import ALL, HALF, AttackRunner, judge_calls, outcome
from conformance.api.soap.attacks import IGNORED_SLOT, VALUE_SLOT, Attack, Template, attacks
from conformance.api.soap.callable_services import SoapServices, callable_services
from conformance.api.soap.callback_server import CallbackServer
from conformance.api.soap.envelope import envelope
from conformance.api.soap.messages import simple_leaves, with_text
from conformance.api.soap.service import SoapService
from conformance.api.soap.valid_messages import example
from conformance.documents.xml import ADDRESSING, Node, clark
from conformance.transport.exchange import Attempt, Exchange
from conformance.verdict.effort import Effort
from conformance.verdict.evidence import Judge

pytestmark = pytest.mark.phase("attack")
_NAMES = (
    "doctype internal-entity external-entity no-callback parameter-entity expansion quadratic depth attributes "
    "long-name size compressed processing-instruction xinclude responsive"
)
_SPOOFING = "xml-security/addressing-spoofing"
_IDS = tuple(f"xml-security/{name}" for name in _NAMES.split())
_DEADLINE_S = 10.0


def _harmless(service: SoapService) -> tuple[Node, Node, str] | None:
    """Return a message that the robot accepts, the same with VALUE_SLOT for one value, and that value."""
    found: tuple[Node, Node, str] | None = None
    for operation in service.contract.operations:
        message = example(service, operation)
        declared = service.contract.shape(operation.request) if operation.request else None
        if message is None or declared is None:
            continue
        leaves = simple_leaves(declared, message)
        if leaves:
            path = leaves[0][0]
            return message, with_text(message, path, VALUE_SLOT), message.at(path).text
        found = found or (message, replace(message, text=VALUE_SLOT), "")
    return found


def _runner(judge: Judge, service: SoapService, message: Node) -> AttackRunner:
    document = envelope([message]).serialize()

    def send(attack: Attack) -> Attempt:
        apart = service.apart()
        try:
            deadline = min(_DEADLINE_S, service.client.connection.timeout_s)
            return outcome(lambda: apart.post(attack.body, headers=attack.headers, fresh=True, timeout_s=deadline))
        finally:
            apart.client.close()

    def ask() -> Exchange:
        return service.post(document)

    times = [ask().response.elapsed_ms for _ in range(5)]
    return AttackRunner(judge, send, ask, statistics.median(times))


@pytest.mark.requirement(_SPOOFING, *_IDS)
def test_attacks(soap: SoapServices, judge: Judge, effort: Effort) -> None:
    """Send each attack in a message that is otherwise accepted, in the Body and in Header blocks."""
    if not soap.there:
        # The class is then judged over REST alone.
        for id_ in (_SPOOFING, "xml-security/soapaction-spoofing"):
            judge.note_unclaimed(id_, "the robot has no SOAP service")
        return
    services = callable_services(soap, _SPOOFING, *_IDS)
    with CallbackServer(services[0].client.host, services[0].client.port) as callbacks:
        runners: list[AttackRunner] = []
        for service in services:
            harmless = _harmless(service)
            if harmless is None:
                for id_ in _IDS:
                    judge.skip(id_, f"the {service.name} service took none of the messages tried")
                continue
            # Addresses first: a robot that calls them has time until the other attacks are over.
            spoofed = list(_spoofing(service, harmless[0], callbacks))
            others = _attacks(service, harmless, callbacks, 1 if effort.factor < HALF else ALL)
            for chosen in (spoofed[: effort.cases(len(spoofed))], others):
                runners.append(_runner(judge, service, harmless[0]))
                for attack in chosen:
                    runners[-1].attack(attack)
        judge_calls(judge, callbacks, runners)


def _attacks(
    service: SoapService, harmless: tuple[Node, Node, str], callbacks: CallbackServer, each: int
) -> Iterator[Attack]:
    """Yield the attacks on a harmless message: in a value, and in a Header block that must be ignored."""
    _, marked, value = harmless
    aside = Node(clark("urn:example:strange", "Note"), IGNORED_SLOT)
    document = envelope([marked], (aside,)).serialize().decode()
    template = Template(document, document[1:].split(" ", 1)[0], value)
    yield from attacks(template, callbacks.url, each, service.name)


def _spoofing(service: SoapService, message: Node, callbacks: CallbackServer) -> Iterator[Attack]:
    action = next((item.input_action for item in service.contract.operations if item.request == message.tag), None)
    broken = Node(clark("urn:example:strange", "no_such_operation"))
    valid, invalid = ("a valid message", message), ("an invalid one", broken)
    # The likeliest first: a response goes to ReplyTo, a fault to FaultTo.
    for first, then in ((valid, invalid), (invalid, valid)):
        for name, (what, payload) in (("ReplyTo", first), ("FaultTo", then), ("From", first)):
            canary = f"{service.name}-{name.lower()}-{payload.name}"
            headers = (
                Node(clark(ADDRESSING, "Action"), action or "urn:example:action"),
                Node(clark(ADDRESSING, "MessageID"), "urn:uuid:0b7d3c1e-6f43-4a2e-8f57-3c1d2f6f9a01"),
                Node(clark(ADDRESSING, "To"), service.endpoint),
                Node(clark(ADDRESSING, name), "", (Node(clark(ADDRESSING, "Address"), callbacks.url(canary)),)),
            )
            yield Attack(
                "addressing-spoofing",
                f"{name} of {what}",
                envelope([payload], headers).serialize(),
                must_refuse=False,
                canary=canary,
            )
