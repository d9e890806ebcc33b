"""Whether the interfaces that the claimed classes need are there at all: the prerequisite of everything else."""

import pytest

from conformance.api.interfaces import Interfaces
from conformance.api.soap.envelope import EMPTY
from conformance.contract.interfaces import Interface
from conformance.transport.exchange import Attempt, NoAnswerError
from conformance.verdict.evidence import Judge
from conformance.verdict.run import Run

pytestmark = pytest.mark.phase("reach")


@pytest.mark.requirement("*/reachable")
def test_interfaces_answer(run: Run, interfaces: Interfaces, judge: Judge) -> None:
    """Each interface that a claimed class needs has an address and answers there.

    A class whose prerequisite is missing fails; it is not skipped.
    """
    found = {name: _look(interfaces, name) for name in run.contract.interfaces}
    for class_ in run.claims:
        needed, any_of = _needed(run, class_), run.contract.classes[class_].one_is_enough
        problems = {name: found[name] for name in needed if found[name][0]}
        missing = len(problems) == len(needed) if any_of else bool(problems)
        shown = (
            next(iter(problems.values()), ("", None))
            if missing
            else next((found[name] for name in needed if not found[name][0]), ("", None))
        )
        judge.check(
            f"{class_}/reachable",
            not missing,
            shown[1],
            f"an answer from {' or '.join(needed) if any_of else ' and '.join(needed)}",
            found=shown[0],
        )


def _needed(run: Run, class_: str) -> tuple[Interface, ...]:
    """The interfaces that a class needs of a robot."""
    there = run.contract.interfaces
    return tuple(name for name in run.contract.classes[class_].interfaces if name in there)


def _look(interfaces: Interfaces, name: Interface) -> tuple[str, Attempt | None]:
    """Why an interface is not there, or an empty text; with the evidence."""
    try:
        if name is Interface.REST:
            if interfaces.rest is None:
                return f"the {name} interface has no address", None
            return "", interfaces.rest.client.send("GET", interfaces.rest.path)
        service = interfaces.soap.there.get(name)
        if service is None:
            return f"the {name} interface has no address", None
        exchange = service.post(EMPTY)
    except NoAnswerError as none:
        return f"{name}: {none}", none.unanswered
    # Anything that handles POST will do here: a fault, a 4xx for the empty Body, even a server error.
    status = exchange.response.status
    return (f"{name}: POST is answered {status}" if status in {404, 405, 501} else ""), exchange
