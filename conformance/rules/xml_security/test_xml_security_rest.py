"""XML attacks in request bodies over REST, on every resource that takes XML by the contract's OpenAPI."""

import statistics
from collections.abc import Iterator

import pytest
from lxml import etree

from conformance.api.interfaces import Interfaces
from conformance.api.rest.interface import RestInterface
from conformance.api.soap.attack_runner import ALL, HALF, AttackRunner, judge_calls, outcome
from conformance.api.soap.attacks import VALUE_SLOT, Attack, Template, attacks
from conformance.api.soap.callback_server import CallbackServer
from conformance.contract.classes import Interface, Level
from conformance.contract.pack import Contract
from conformance.documents.xml import Node, NotXmlError, elements, parse, text_of
from conformance.transport.client import HttpClient
from conformance.transport.exchange import Attempt, Exchange
from conformance.verdict.effort import Effort
from conformance.verdict.evidence import Judge

# Attacks over REST have no late effects, so they run while the suite waits for those of other requests.
pytestmark = pytest.mark.phase("aside")
_REST = "xml-security/rest"
_XML = "application/xml"
_BODIES = ("put", "post", "patch")
_DEADLINE_S = 10.0
# Attacks that have no meaning for XML bodies over REST.
_NOT_HERE = frozenset({"no-callback"})


def _targets(contract: Contract) -> Iterator[tuple[str, str]]:
    """Yield method and path of each operation that takes XML and needs no values in its path."""
    for path, operations in contract.openapi.get("paths", {}).items():
        if "{" in path or not isinstance(operations, dict):
            continue
        for method in _BODIES:
            body = operations.get(method, {}).get("requestBody", {})
            if isinstance(body, dict) and _XML in body.get("content", {}):
                yield method.upper(), path


def _template(rest: HttpClient, path: str) -> Template:
    """Return the resource's own XML with a slot in place of its first value; else a minimal document with a slot."""
    exchange = rest.send("GET", path, headers=(("Accept", _XML),))
    answer = exchange.response
    plain = Template(f"<message>{VALUE_SLOT}</message>", "message", "1")
    if not answer.ok:
        return plain
    try:
        root = parse(answer.body)
    except NotXmlError:
        return plain
    value: list[str] = []
    node = _node(root, value)
    written = node.serialize().decode()
    name = written[1:].split(">", 1)[0].split(" ", 1)[0].rstrip("/")
    return Template(written, name, value[0]) if value else plain


def _node(element: etree._Element, value: list[str]) -> Node:
    """Return an element as a node with VALUE_SLOT in place of its first text, which is appended to ``value``."""
    children = tuple(_node(child, value) for child in elements(element))
    text = text_of(element).strip() if not children else ""
    if text and not value:
        value.append(text)
        text = VALUE_SLOT
    return Node(str(element.tag), text, children)


@pytest.mark.motion
@pytest.mark.requirement(_REST, "xml-security/responsive", "xml-security/no-callback")
def test_attacks(interfaces: Interfaces, judge: Judge, effort: Effort) -> None:
    """Send each attack in the body of each operation that takes XML."""
    api, soap = interfaces.rest, interfaces.soap
    targets = list(_targets(soap.run.contract))
    if api is None or not targets:
        judge.note_unclaimed(_REST, "there is no REST interface that takes XML")
        return
    if Interface.REST in api.run.unreachable:
        pytest.skip(f"the robot's REST interface does not answer: {api.run.unreachable[Interface.REST]}")
    rest, alone = api.client, not soap.there
    quick = effort.factor < HALF
    with CallbackServer(rest.host, rest.port) as callbacks:
        runners = []
        for number, (method, path) in enumerate(targets[:1] if quick else targets):
            runner = _runner(api, method, path, alone=alone)
            runners.append(runner)
            for attack in attacks(_template(rest, path), callbacks.url, 1 if quick else ALL, f"rest{number}"):
                if runner.ids(attack):
                    runner.attack(attack)
        judge_calls(judge, callbacks, runners)


def _runner(api: RestInterface, method: str, path: str, *, alone: bool) -> AttackRunner:
    rest = api.client

    def send(attack: Attack) -> Attempt:
        apart = HttpClient(rest.base_url, rest.connection)
        headers = (("Content-Type", _XML), ("Accept", "*/*"), *attack.headers)
        deadline = min(_DEADLINE_S, rest.connection.timeout_s)
        try:
            return outcome(
                lambda: apart.send(method, path, headers=headers, body=attack.body, fresh=True, timeout_s=deadline)
            )
        finally:
            apart.close()

    def ask() -> Exchange:
        return rest.send("GET", path)

    def ids(attack: Attack) -> tuple[str, ...]:
        own = f"xml-security/{attack.name}"
        requirement = api.run.contract.requirement(own)
        must = requirement is not None and requirement.level is Level.MUST and attack.name not in _NOT_HERE
        return (*((own,) if alone else ()), *((_REST,) if must else ()))

    times = [ask().response.elapsed_ms for _ in range(5)]
    return AttackRunner(api.run.judge, send, ask, statistics.median(times), ids)
