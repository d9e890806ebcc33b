"""Rules on attempts at rest, which must not move a device, and on whether its position is up to date (motion map)."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator

from conformance.measures.samples import SEVERAL
from conformance.rules.motion.judging import ALL, at, follows, judge_goal, legs_of, off, usable
from conformance.scenarios.motion.attempts import attempts_at_rest
from conformance.scenarios.motion.moves import clamped_targets
from conformance.scenarios.motion.resting import fastest
from conformance.scenarios.motion.trace import Drive, Leg, Quiet, Tried, is_refusal, is_soap
from conformance.scenarios.motion.velocities import clamped_velocities
from conformance.scenarios.rule import NotClaimed, NotTested, Outcome, rule
from conformance.statement.motion_map import MotionMap
from conformance.verdict.evidence import Case


def _movement(quiet: Quiet, motion: MotionMap) -> str | None:
    """Return how the device moved in a watch; empty if it stayed, None if it could not be read.

    It may rest anywhere within the tolerance of its last target, so two places of rest may be twice that apart.
    """
    seen = tuple(reading for reading in quiet.readings if reading.values or (reading.speeds and not motion.state.axes))
    if len(seen) < SEVERAL:
        return None
    windows = (seen[index : index + SEVERAL] for index in range(len(seen) - SEVERAL + 1))
    places = [at(window, motion) for window in windows]
    if quiet.home:
        places = [place for place in places if off(place, quiet.home, motion)]
    elsewhere = next(filter(None, (off(place, quiet.where, motion) for place in places)), "")
    return elsewhere or fastest(seen, motion, rested=True) or quiet.beside


def nothing_moved(trace: Quiet, motion: MotionMap, *kinds: str) -> Iterator[Outcome]:
    """Judge that attempts of some kinds moved nothing: together, or, where the device moved, each alone."""
    tried = [attempt for attempt in trace.tried if attempt.kind in kinds]
    together = _movement(trace, motion)
    if not tried:
        yield NotClaimed("of the map and the description no such request can be made")
    elif together is None:
        yield NotTested("the state could not be read")
    elif _moves_anyway(trace, motion):
        yield NotTested("the device also moved at rest while the suite sent only reads")
    elif together == "":
        yield from (Case(True, attempt.exchange, f"rest after {attempt.what}") for attempt in tried)
    else:
        yield from _alone(trace, motion, kinds)


def _moves_anyway(trace: Quiet, motion: MotionMap) -> bool:
    """Return whether the device also moved without an attempt, because its position or velocity drifts or lags."""
    return trace.idle is not None and bool(_movement(trace.idle, motion))


def _alone(trace: Quiet, motion: MotionMap, kinds: tuple[str, ...]) -> Iterator[Outcome]:
    """Judge attempts that were repeated singly, because the device moved after all of them."""
    for quiet in trace.alone:
        moved = _movement(quiet, motion)
        last = (
            [attempt for attempt in quiet.tried if attempt.exchange and not is_refusal(attempt.exchange)]
            or list(quiet.tried)
        )[-1:]
        for attempt in quiet.tried:
            # Of several, the last that it did not refuse has moved it, or else the last one.
            if attempt.kind in kinds and moved is not None and not (moved and attempt not in last):
                yield Case(
                    not moved, attempt.exchange, f"rest after {attempt.what}", observed=moved, cause=attempt.kind
                )
    if trace.idle is None:
        yield NotTested("the device moved after several attempts, and did not come back for each of them alone")


def judge_refused(tried: Iterable[Tried], *statuses: int) -> Iterator[Outcome]:
    """Judge whether attempts are refused, with a given status if there are any; over SOAP by a fault."""
    for attempt in tried:
        soap = attempt.exchange is not None and is_soap(attempt.exchange)
        expected = "a fault" if soap else " or ".join(map(str, statuses)) or "4xx"
        found = attempt.exchange
        sure = soap or attempt.failed or not statuses or (found is not None and found.response.status in statuses)
        holds = found is not None and sure and (attempt.failed or is_refusal(found))
        yield Case(holds, found, f"{expected} for {attempt.what}", cause=attempt.kind)


@rule("motion/beyond-limits", on=(clamped_targets, clamped_velocities, attempts_at_rest))
def beyond_limits(trace: Quiet | tuple[Leg, ...] | tuple[Drive, ...], motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether targets and velocities beyond the limits are refused or clamped, as the map declares."""
    if not isinstance(trace, Quiet):
        yield from follows(tuple(drive for drive in trace if isinstance(drive, Drive)), motion)
        for leg in trace:
            if isinstance(leg, Leg):
                yield from judge_goal(leg, leg.commands[-1], motion)
        return
    if all(one is None or one.beyond_limits == "undefined" for one in (motion.goto, motion.velocity)):
        yield NotClaimed("the map does not say what becomes of a target beyond the limits")
    yield from judge_refused(attempt for attempt in trace.tried if attempt.kind == "beyond")


@rule("motion/refused-still", on=(attempts_at_rest,))
def refused_still(trace: Quiet, motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether a target beyond the limits, or an invalid one, moves nothing."""
    yield from nothing_moved(trace, motion, "beyond", "invalid", "unactuated")
    together = _movement(trace, motion)
    alone = trace.idle is not None and not any(_movement(quiet, motion) for quiet in trace.alone)
    if together and alone and not _moves_anyway(trace, motion):
        # It moves rarely, or only after several attempts, so no single attempt can be named.
        last = next((attempt.exchange for attempt in reversed(trace.tried) if attempt.exchange is not None), None)
        yield Case(False, last, f"rest after {len(trace.tried)} attempts in a row", observed=together, cause="together")


@rule("motion/incomplete-still", on=(attempts_at_rest,))
def incomplete_still(trace: Quiet, motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether an incomplete request moves nothing."""
    yield from nothing_moved(trace, motion, "incomplete")


@rule("motion/unauthorised-still", on=(attempts_at_rest,))
def unauthorised_still(trace: Quiet, motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether a move without credentials is refused, and moves nothing."""
    tried = [attempt for attempt in trace.tried if attempt.kind == "unauthorised"]
    # 409, 423 and 428 refuse a client without the lease (RFC 9110 15.5.10, RFC 4918 11.3, RFC 6585 3), as others do
    # whose description has its header or member.
    leased = [attempt for attempt in tried if attempt.what.endswith("the lease")]
    yield from judge_refused([attempt for attempt in tried if attempt not in leased], 401, 403, 423, 428)
    yield from judge_refused(leased)
    yield from nothing_moved(trace, motion, "unauthorised")


@rule("motion/fresh", on=ALL)
def fresh(trace: Leg | tuple[Leg, ...], motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether the position that is read changes as often as declared while the device moves.

    A device that pauses on its way, or turns on the spot, goes on from where it was. One whose position is old jumps.
    """
    for leg in legs_of(trace):
        seen = usable(leg)
        changed = [i for i in range(1, len(seen)) if seen[i].values != seen[i - 1].values]
        if len(changed) < 2 or not leg.commands[-1].targets:
            continue
        still = [
            seen[b - 1].sent - seen[a].received
            for a, b in itertools.pairwise(changed)
            if off(seen[b].values, seen[b - 1].values, motion)
            # Of few positions, one may be a target, at which a fast device rested until it got the next one.
            and (
                len(changed) >= SEVERAL or all(off(seen[a].values, command.targets, motion) for command in leg.commands)
            )
        ]
        longest_s = max(still, default=0.0)
        yield Case(
            longest_s <= motion.state.fresh_s,
            seen[-1].exchange,
            f"another position at least every {motion.state.fresh_s:g} s under way",
            observed=f"the same position for {longest_s:.2f} s, then another one",
            cause="stale",
        )


@rule("motion/stamp", on=ALL)
def stamp(trace: Leg | tuple[Leg, ...], motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether the state's stamp increases, and never decreases."""
    if not motion.state.stamp:
        yield NotClaimed("the map names no stamp")
        return
    for leg in legs_of(trace):
        seen = [reading for reading in leg.readings if reading.values]
        stamps = [reading.stamp for reading in seen if reading.stamp is not None]
        if len(stamps) < len(seen):
            yield Case(holds=False, exchange=seen[0].exchange, expected=f"a time at {motion.state.stamp}")
        elif len(stamps) > SEVERAL:
            back = any(two < one for one, two in itertools.pairwise(stamps))
            stuck = stamps[-1] == stamps[0] and seen[-1].sent - seen[0].received > motion.state.fresh_s
            found = "it went back" if back else "it stood still" if stuck else ""
            yield Case(not found, seen[-1].exchange, "a stamp that goes on", observed=found, cause=found)
