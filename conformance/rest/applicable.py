"""What of the contract a check can be tried on: with this robot, and with the permission that was given."""

from __future__ import annotations

from typing import TYPE_CHECKING

from conformance.documents.json_schema import kind_of
from conformance.documents.openapi import operations_of
from conformance.rest.calls import Call, example_call

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from conformance.documents.openapi import Operation
    from conformance.engine.session import Session

NO_MOTION = "it moves the robot, and --allow-motion was not given"


def reads(session: Session) -> list[Call]:
    """A valid request for each operation that only reads, the optional ones last."""
    found = [item for item in operations_of(session.contract) if item.method == "GET" and allowed(session, item)]
    return [readable(session, item) for item in sorted(found, key=lambda item: item.optional)]


def readable(session: Session, operation: Operation) -> Call:
    """A request for an operation that reads, which is answered 200 if any is.

    Where the contract's example makes no sense to this robot (a place outside its map), small numbers are tried.
    """
    call = example_call(session, operation)
    numbers = [item.name for item in operation.parameter("query") if kind_of(item.schema) in {"number", "integer"}]
    required = [item.name for item in operation.parameter("query") if item.name in numbers and item.required]
    if not required or session.rest is None:
        return call
    key = (session.rest.base_url, operation.id)
    if key not in _SMALL:
        _SMALL[key] = ""
        for text in ("", "0", "1", "0.5"):
            answer = _with(call, required, text).send(session).response
            if answer.ok:
                _SMALL[key] = text
                break
    return _with(call, required, _SMALL[key])


# What readable() has found out, by robot and operation: the text for its numbers, or nothing for the example's.
_SMALL: dict[tuple[str, str], str] = {}


def _with(call: Call, names: list[str], text: str) -> Call:
    for name in names if text else ():
        call = call.having(name, text)
    return call


def answered(session: Session) -> list[Call]:
    """Those of reads() that are answered 200 as things are: a robot may lack an extension, or have no goal."""
    found = []
    for call in reads(session):
        answer = call.send(session).response
        if answer.status == 200:  # noqa: PLR2004 - RFC 9110 15.3.1
            found.append(call)
    return found


def allowed(session: Session, operation: Operation) -> bool:
    """Whether the operation may be sent in this run."""
    return session.allow_motion or not operation.motion


def applicable_operations(
    session: Session, ids: Sequence[str], wanted: Callable[[Operation], bool], what: str
) -> list[Operation]:
    """The operations that a check is about.

    Where the contract has none, its requirements do not apply; where none may be sent, they are skipped. Requirements
    that other checks judge as well are left as they are.

    Args:
        session: the run.
        ids: of the requirements that depend on it.
        wanted: picks the operations.
        what: says what they are: "takes JSON".
    """
    found = [item for item in operations_of(session.contract) if wanted(item)]
    usable = [item for item in found if allowed(session, item)]
    for id_ in ids if not usable else ():
        if found:
            session.judge.skip(id_, NO_MOTION)
        else:
            session.judge.unclaimed(id_, f"the contract has no operation that {what}")
    return session.effort.subsample(usable, 2)
