"""Whether attempts at rest move a device, and whether what it tells of its position is fresh (motion map)."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator

from conformance.rules.motion.judging import ALL, at, legs_of, off, reached, usable
from conformance.scenarios.motion.plays import attempts_at_rest, clamped_targets
from conformance.scenarios.motion.trace import SEVERAL, Command, Leg, Quiet, Tried
from conformance.scenarios.rule import Case, NotTested, Outcome, rule
from conformance.statement.motion_map import MotionMap


def _still(quiet: Quiet, motion: MotionMap) -> str:
    """Return how the device moved in a watch; empty if it stayed."""
    seen = tuple(one for one in quiet.readings if one.values)
    for index in range(len(seen) - SEVERAL + 1):
        apart = off(at(seen[index : index + SEVERAL], motion), quiet.where, motion)
        if apart:
            return apart
    return ""


def _nothing_moved(trace: Quiet, motion: MotionMap, *kinds: str) -> Iterator[Outcome]:
    """Judge that attempts of some kinds moved nothing."""
    for quiet in trace.alone or (trace,):
        moved = _still(quiet, motion)
        for one in quiet.tried:
            if one.kind in kinds and (trace.alone or not moved):
                yield Case(not moved, one.attempt, f"rest after {one.what}", observed=moved, cause=one.kind)


def _refused(tried: Iterable[Tried], expected: str) -> Iterator[Outcome]:
    for one in tried:
        attempt = one.attempt
        holds = attempt is not None and Command(0, 0, {}, attempt).refused
        yield Case(holds, attempt, f"{expected} for {one.what}", cause=one.kind)


@rule("motion/beyond-limits", on=(clamped_targets, attempts_at_rest))
def beyond_limits(trace: Quiet | tuple[Leg, ...], motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether a target beyond the limits is refused or clamped, as the map says."""
    if not isinstance(trace, Quiet):
        for leg in trace:
            yield from reached(leg, leg.commands[-1], motion)
        return
    yield from _refused((one for one in trace.tried if one.kind == "beyond"), "4xx")


@rule("motion/refused-still", on=(attempts_at_rest,))
def refused_still(trace: Quiet, motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether a target beyond the limits, or an invalid one, moves nothing."""
    yield from _nothing_moved(trace, motion, "beyond", "invalid")


@rule("motion/incomplete-still", on=(attempts_at_rest,))
def incomplete_still(trace: Quiet, motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether an incomplete request moves nothing."""
    yield from _nothing_moved(trace, motion, "incomplete")


@rule("motion/unauthorised-still", on=(attempts_at_rest,))
def unauthorised_still(trace: Quiet, motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether a move without credentials is refused, and moves nothing."""
    tried = [one for one in trace.tried if one.kind == "unauthorised"]
    if not tried:
        yield NotTested("the statement has no credentials")
    yield from _refused(tried, "401 or 403")
    yield from _nothing_moved(trace, motion, "unauthorised")


@rule("motion/fresh", on=ALL)
def fresh(trace: Leg | tuple[Leg, ...], motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether the position that is read changes as often as declared while the device moves."""
    for leg in legs_of(trace):
        seen = usable(leg)
        changed = [i for i in range(1, len(seen)) if seen[i].values != seen[i - 1].values]
        if len(changed) < SEVERAL or leg.commands[-1].targets == {}:
            continue
        edges = [changed[0], *changed[1:]]
        still_s = max(seen[b - 1].sent - seen[a].received for a, b in itertools.pairwise(edges))
        yield Case(
            still_s <= motion.state.fresh_s,
            seen[-1].exchange,
            f"another position at least every {motion.state.fresh_s:g} s under way",
            observed=f"the same one for {still_s:.2f} s",
            cause="stale",
        )


@rule("motion/stamp", on=ALL)
def stamp(trace: Leg | tuple[Leg, ...], motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether the stamp of the state goes on, and never back."""
    if not motion.state.stamp:
        yield NotTested("the map names no stamp")
        return
    for leg in legs_of(trace):
        seen = [one for one in leg.readings if one.values]
        stamps = [one.stamp for one in seen if one.stamp is not None]
        if len(stamps) < len(seen):
            yield Case(holds=False, exchange=seen[0].exchange, expected=f"a time at {motion.state.stamp}")
        elif len(stamps) > SEVERAL:
            back = any(two < one for one, two in itertools.pairwise(stamps))
            stuck = stamps[-1] == stamps[0] and seen[-1].sent - seen[0].received > motion.state.fresh_s
            found = "it went back" if back else "it stood still" if stuck else ""
            yield Case(not found, seen[-1].exchange, "a stamp that goes on", observed=found, cause=found)
