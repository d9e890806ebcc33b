"""Records of a robot that must stay at rest, as data that rules can judge without a robot."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from conformance.scenarios.rule import NotTested
from conformance.transport.exchange import Exchange, Unanswered
from conformance.verdict.evidence import Case

#: The word for a robot that rests and has a goal.
GOAL: Final = "an active goal"


def rest(after: str, exchange: Exchange | Unanswered | None, found: str, cause: str = "moves") -> Case:
    """Return what a robot shows after requests that must leave the robot at rest.

    Args:
        after: the requests, as the end of a sentence "rest after …".
        exchange: the reading that shows motion or a goal, the request that caused them, or the last reading.
        found: the velocity or the goal that the robot shows; empty: it is at rest without a goal.
        cause: as in Case.
    """
    return Case(not found, exchange, f"rest after {after}", found, cause)


@dataclass(frozen=True)
class Attempt:
    """Requests that must leave the robot at rest.

    Attributes:
        requirement: id of the requirement that says so.
        after: the requests, as the end of a sentence "rest after …".
        alone: readings after the same requests were repeated with a watch of their own; empty: not repeated.
    """

    requirement: str
    after: str
    alone: tuple[Case, ...] = ()


@dataclass(frozen=True)
class Standing:
    """One watch after several attempts.

    Attributes:
        rest: the readings of the watch.
        attempts: all attempts before the watch. If the robot moved in the watch, each was repeated alone.
    """

    rest: Case
    attempts: tuple[Attempt, ...]


def stays(trace: tuple[Standing, ...], requirement: str) -> Iterator[Case | NotTested]:
    """Yield the cases of a requirement: the robot stays at rest after the attempts for that requirement.

    Where the robot moved in the common watch, and no attempt moved it when repeated, any of the attempts may have
    caused the motion, and so may a push. That is one failure: it counts for the first attempt, and the others are not
    tested.
    """
    for one in trace:
        mine = [attempt for attempt in one.attempts if attempt.requirement == requirement]
        for attempt in mine:
            yield from attempt.alone
        if all(seen.holds for attempt in one.attempts for seen in attempt.alone):
            seen, first = one.rest, one.attempts[0]
            if seen.holds or first.requirement == requirement:
                after = "" if seen.holds else " and after ".join(dict.fromkeys(one.after for one in one.attempts))
                yield from (rest(after or attempt.after, seen.exchange, seen.observed) for attempt in mine)
            elif mine:
                yield NotTested(
                    "the robot moved once after several attempts, and none of them moved it when repeated alone: "
                    f"this counts for {first.requirement}"
                )
