"""What of the contract a check can be tried on: with this robot, and with the permission that was given."""

from __future__ import annotations

import random
import zlib
from typing import TYPE_CHECKING, TypeVar

import pytest

from conformance.http.calls import Call, example_call
from conformance.http.operations import operations_of

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from conformance.http.operations import Operation
    from conformance.session import Session

NO_MOTION = "it moves the robot, and --allow-motion was not given"
Item = TypeVar("Item")


def reads(session: Session) -> list[Call]:
    """A valid request for each operation that only reads, the optional ones last."""
    found = [item for item in operations_of(session.contract) if item.method == "GET" and allowed(session, item)]
    return [example_call(session, item) for item in sorted(found, key=lambda item: item.optional)]


def answered(session: Session) -> list[Call]:
    """Those of reads() that are answered 200 as things are: a robot may lack an extension, or have no goal."""
    found = []
    for call in reads(session):
        answer = call.send(session).response
        if answer is not None and answer.status == 200:  # noqa: PLR2004 - RFC 9110 15.3.1
            found.append(call)
    return found


def allowed(session: Session, operation: Operation) -> bool:
    """Whether the operation may be sent in this run."""
    return session.allow_motion or not operation.motion


def need(session: Session, ids: Sequence[str], wanted: Callable[[Operation], bool], what: str) -> list[Operation]:
    """The operations that a check is about.

    Where the contract has none, its requirements do not apply; where none may be sent, the check is skipped.

    Args:
        session: the run.
        ids: of the requirements.
        wanted: picks the operations.
        what: says what they are: "takes JSON".
    """
    found = [item for item in operations_of(session.contract) if wanted(item)]
    if not found:
        for id_ in ids:
            session.judge.unclaimed(id_, f"the contract has no operation that {what}")
        pytest.skip(f"the contract has no operation that {what}")
    usable = [item for item in found if allowed(session, item)]
    if not usable:
        pytest.skip(NO_MOTION)
    return usable


def sampled(session: Session, items: Sequence[Item], standard: int, name: str) -> list[Item]:
    """So many of the items as the effort allows (``standard`` at standard effort), the same ones for one seed."""
    count = session.effort.cases(standard)
    if len(items) <= count:
        return list(items)
    chooser = random.Random(zlib.crc32(f"{session.seed}/{name}".encode()))  # noqa: S311 - no secret
    return [items[index] for index in sorted(chooser.sample(range(len(items)), count))]
