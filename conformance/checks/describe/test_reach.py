"""Whether the interfaces that the claimed classes need are there at all: the prerequisite of everything else."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from conformance.engine.session import INTERFACES
from conformance.transport.exchange import NoAnswerError

if TYPE_CHECKING:
    from conformance.engine.session import Session
    from conformance.transport.exchange import Attempt
    from conformance.verdict.evidence import Judge

pytestmark = pytest.mark.phase("reach")
_ENVELOPE = b'<e:Envelope xmlns:e="http://schemas.xmlsoap.org/soap/envelope/"><e:Body/></e:Envelope>'


# rest-formats and describe have no such requirement of their own: theirs say what has to answer.
@pytest.mark.requirement(
    *(f"{class_}/reachable" for class_ in INTERFACES if class_ not in {"rest-formats", "describe"})
)
def test_interfaces_answer(roaas: Session, judge: Judge) -> None:
    """Each interface that a claimed class needs has an address and answers there.

    A class whose prerequisite is missing fails; it is not skipped.
    """
    found: dict[str, tuple[str, Attempt | None]] = {name: _look(roaas, name) for name in roaas.interfaces}
    for class_ in roaas.claims:
        needed, any_of = _needed(roaas, class_)
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


def _needed(session: Session, class_: str) -> tuple[tuple[str, ...], bool]:
    """The interfaces that a class needs, and whether one of them is enough."""
    named = INTERFACES[class_]
    there = session.interfaces
    if session.statement.claims is None:
        there = tuple(name for name in there if getattr(session, name) is not None)
    if named == ("all",):
        return there, False
    if named == ("any",):
        return there, True
    if named == ("any-soap",):
        return tuple(name for name in there if name != "rest"), True
    return tuple(name for name in named if name in session.interfaces), False


def _look(session: Session, name: str) -> tuple[str, Attempt | None]:
    """Why an interface is not there, or an empty text; with the evidence."""
    target = getattr(session, name)
    if target is None:
        return f"the {name} interface has no address", None
    try:
        if name == "rest":
            exchange = target.send("GET", session.rest_path())
            return "", exchange
        exchange = target.post(_ENVELOPE)
    except NoAnswerError as none:
        return f"{name}: {none}", none.unanswered
    # Anything that handles POST will do here: a fault, a 4xx for the empty Body, even a server error.
    status = exchange.response.status
    return (f"{name}: POST is answered {status}" if status in {404, 405, 501} else ""), exchange
