"""Check that each interface that the claimed classes need responds at all."""

import pytest

from conformance.api.expectation import expect
from conformance.api.interfaces import Interfaces
from conformance.api.soap.envelope import EMPTY
from conformance.api.soap.service import NO_SERVICE
from conformance.contract.classes import Interface
from conformance.transport.exchange import Attempt, NoAnswerError
from conformance.verdict.evidence import Judge
from conformance.verdict.run import Run

pytestmark = pytest.mark.phase("reach")


@pytest.mark.requirement("*/reachable")
def test_interfaces_answer(run: Run, interfaces: Interfaces, judge: Judge) -> None:
    """Send a request to each interface that a claimed class needs.

    A requirement that binds several classes is about the interfaces of its own one, which all of them need. A class
    whose prerequisite is missing fails; it is not skipped.
    """
    found = {name: _look(interfaces, name) for name in run.contract.interfaces}
    for id_, requirement in run.contract.ledger.items():
        if not id_.endswith("/reachable") or not requirement.binds(run.claims):
            continue
        needed, any_of = _interfaces_of(run, requirement.class_), run.contract.classes[requirement.class_].one_is_enough
        problems = {name: found[name] for name in needed if found[name][0]}
        missing = len(problems) == len(needed) if any_of else bool(problems)
        shown = problems if missing else {name: found[name] for name in needed if not found[name][0]}
        problem, attempt = next(iter(shown.values()), ("", None))
        expected = f"a response from {(' or ' if any_of else ' and ').join(needed)}"
        expect(judge, id_, attempt).that(not missing, expected, problem)


def _interfaces_of(run: Run, class_: str) -> tuple[Interface, ...]:
    """Return the interfaces that a class needs of a robot."""
    there = run.contract.interfaces
    return tuple(name for name in run.contract.classes[class_].interfaces if name in there)


def _look(interfaces: Interfaces, name: Interface) -> tuple[str, Attempt | None]:
    """Return why an interface does not respond, or an empty text, and the exchange."""
    try:
        if name is Interface.REST:
            if interfaces.rest is None:
                return f"no address of the {name} interface", None
            return "", interfaces.rest.client.send("GET", interfaces.rest.path)
        service = interfaces.soap.there.get(name)
        problem = service.mistaken if service else f"no address of the {name} interface"
        if service is None or problem:
            return problem, service.published.attempt if service else None
        if service.client.refusal("POST", service.path):
            # Any response to GET shows that the address exists; only GET is permitted.
            return "", service.client.send("GET", service.path)
        exchange = service.post(EMPTY)
    except NoAnswerError as none:
        return f"{name}: {none}", none.unanswered
    # Any response shows a handler of POST: a fault, a 4xx for the empty Body, even a server error.
    status = exchange.response.status
    return (f"status {status} for POST at the {name} interface" if status in NO_SERVICE else ""), exchange
