"""Whether a device moves as its motion map says (statement, tables ``[motion.*]``)."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from statistics import median

from conformance.scenarios.motion.plays import (
    attempts_at_rest,
    clamped_targets,
    many_commands,
    new_targets,
    repeated,
    several_clients,
    stops,
    targets,
)
from conformance.scenarios.motion.trace import SEVERAL, Command, Leg, Quiet, Reading, Tried, place
from conformance.scenarios.rule import Case, NotTested, Outcome, rule
from conformance.statement.motion_map import MotionMap

# A reading between two others that a device needs for a step of its own, s.
_APART_S = 0.15
_FASTER = 1.1
_ALL = (targets, clamped_targets, stops, new_targets, many_commands, repeated, several_clients)


def _legs(trace: Leg | tuple[Leg, ...]) -> tuple[Leg, ...]:
    return (trace,) if isinstance(trace, Leg) else trace


def _at(readings: tuple[Reading, ...], motion: MotionMap) -> dict[str, float]:
    """Return where the device is by the median of some readings."""
    return {axis: place(readings, axis) for axis in motion.state.axes} if readings else {}


def _off(here: dict[str, float], there: dict[str, float], motion: MotionMap, share: float = 1.0) -> str:
    """Return by how much and along which axis a position is off another; empty if it is within the tolerances."""
    for axis, wanted in there.items():
        if abs(here[axis] - wanted) > share * motion.tolerance(axis):
            return f"{axis} {here[axis]:.4g} in place of {wanted:.4g}"
    return ""


def _usable(leg: Leg) -> tuple[Reading, ...]:
    return tuple(one for one in leg.readings if one.values)


def _reached(leg: Leg, goal: Command, motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether the device was at a target when its time was over."""
    expected = f"{leg.what}: {_named(goal.targets)} reached in time"
    if not goal.accepted:
        yield Case(holds=False, exchange=goal.attempt, expected=f"a 2xx for {_named(goal.targets)}, within the limits")
        return
    usable = _usable(leg)
    last = usable[-SEVERAL:]
    if len(last) < SEVERAL:
        yield NotTested("the state could not be read")
        return
    # What the device shows when its time is over counts, or, where it was there before, what it showed last.
    late = tuple(one for one in usable if one.sent >= leg.due)[:SEVERAL]
    last = late if len(late) == SEVERAL else last
    off = _off(_at(last, motion), goal.targets, motion)
    found = f"{off}, {last[-1].sent - goal.answered:.2f} s after the response"
    yield Case(not off, goal.attempt, expected, observed=found)


def _named(position: dict[str, float]) -> str:
    return ", ".join(f"{axis} {value:.4g}" for axis, value in position.items())


@rule("motion/reaches", on=(targets,))
def reaches(trace: tuple[Leg, ...], motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether each target within the limits is reached in time."""
    for leg in trace:
        yield from _reached(leg, leg.commands[-1], motion)


@rule("motion/stays", on=(targets,))
def stays(trace: tuple[Leg, ...], motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether the device stays at a target that it has reached."""
    for leg in trace:
        usable, goal = _usable(leg), leg.commands[-1]
        arrived = _first_at(usable, goal.targets, motion)
        if arrived is None:
            continue
        last = usable[-SEVERAL:]
        off = _off(_at(last, motion), goal.targets, motion, 1.5)
        yield Case(not off, goal.attempt, f"{_named(goal.targets)} kept", observed=f"{off} after it was reached")


def _first_at(readings: tuple[Reading, ...], goal: dict[str, float], motion: MotionMap) -> int | None:
    """Return the index of the first of several readings in a row at a position."""
    for index in range(len(readings) - SEVERAL + 1):
        if not any(_off(one.values, goal, motion) for one in readings[index : index + SEVERAL]):
            return index
    return None


@rule("motion/way", on=_ALL)
def way(trace: Leg | tuple[Leg, ...], motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether the device stays within its limits on all its ways; where it begins beyond them is its affair."""
    for leg in _legs(trace):
        usable = _usable(leg)
        for name, axis in motion.state.axes.items():
            room = motion.tolerance(name)
            least, greatest = axis.limits[0] - room, axis.limits[1] + room
            places = [place(usable[i : i + SEVERAL], name) for i in range(len(usable) - SEVERAL + 1)]
            inside = next((i for i, one in enumerate(places) if least <= one <= greatest), len(places))
            beyond = [one for one in places[inside:] if not least <= one <= greatest]
            if places:
                found = f"{name} {max(beyond, key=abs):.4g}" if beyond else ""
                yield Case(
                    not beyond,
                    leg.commands[-1].attempt,
                    f"{name} from {axis.limits[0]:g} to {axis.limits[1]:g} on the way to {leg.what}",
                    observed=found,
                    cause=name,
                )


@rule("motion/speed", on=_ALL)
def speed(trace: Leg | tuple[Leg, ...], motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether an axis moves no faster than declared."""
    limited = {name: axis.speed for name, axis in motion.state.axes.items() if axis.speed is not None}
    if not limited:
        yield NotTested("the map declares no greatest speed")
    for leg, (name, most) in itertools.product(_legs(trace), limited.items()):
        usable = _usable(leg)
        fastest = 0.0
        for index, one in enumerate(usable):
            later = next((two for two in usable[index:] if two.sent - one.received > _APART_S), None)
            if later is not None:
                moved = abs(later.values[name] - one.values[name]) - motion.tolerance(name)
                fastest = max(fastest, moved / (later.received - one.sent))
        yield Case(
            fastest <= _FASTER * most,
            leg.commands[-1].attempt,
            f"{name} at {most:g} a second at most",
            observed=f"{fastest:.3g} a second on the way to {leg.what}",
            cause=name,
        )


def _usual_s(leg: Leg) -> float:
    return median(one.received - one.sent for one in leg.readings) if leg.readings else 0.0


def _stopped(leg: Leg, motion: MotionMap) -> tuple[tuple[Reading, ...], NotTested | Case | None]:
    """Return the readings from when the device must rest, or why they cannot be judged."""
    stop, (goal, order) = motion.stop, leg.commands[:2]
    if stop is None or not order.accepted:
        return (), Case(holds=False, exchange=order.attempt, expected="a 2xx for a stop under way")
    before = [one for one in _usable(leg) if one.received <= order.sent]
    axis = max(goal.targets, key=lambda name: abs(goal.targets[name] - leg.start.get(name, 0.0)))
    left = abs(goal.targets[axis] - before[-1].values[axis]) if before else 0.0
    if left < 4 * motion.tolerance(axis) or abs(before[-1].values[axis] - leg.start[axis]) < motion.tolerance(axis):
        return (), NotTested("the device was not under way when it was stopped")
    due = order.sent + stop.rests_within_s + _usual_s(leg)
    readings = leg.after(due)
    return readings, None if len(readings) > 2 * SEVERAL else NotTested("the state could not be read after the stop")


@rule("motion/stop", on=(stops,))
def stop_rests(trace: tuple[Leg, ...], motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether a stop under way stops the device in time, before its target."""
    for leg in trace:
        readings, unusable = _stopped(leg, motion)
        if unusable is not None:
            yield unusable
            continue
        goal, order = leg.commands[:2]
        where = _at(readings[:SEVERAL], motion)
        soon = [one for one in readings if one.sent < readings[0].sent + 0.5][-SEVERAL:]
        moved = _off(_at(tuple(soon), motion), where, motion)
        arrived = not _off(where, goal.targets, motion)
        rests_s = motion.stop.rests_within_s if motion.stop else 0.0
        yield Case(
            not moved and not arrived,
            order.attempt,
            f"rest {rests_s:g} s after {leg.what}",
            observed=f"{moved}, {soon[-1].sent - order.sent:.2f} s after the stop"
            if moved
            else f"the target reached all the same: {_named(where)}",
            cause="moves" if moved else "arrived",
        )


@rule("motion/stop-lasts", on=(stops,))
def stop_lasts(trace: tuple[Leg, ...], motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether a device that was stopped stays where it is, and does not resume its way."""
    for leg in trace:
        readings, unusable = _stopped(leg, motion)
        if unusable is None:
            where, last = _at(readings[:SEVERAL], motion), _at(readings[-SEVERAL:], motion)
            moved = _off(last, where, motion)
            after = readings[-1].sent - leg.commands[1].sent
            yield Case(
                not moved, leg.commands[1].attempt, f"rest after {leg.what}", f"{moved}, {after:.1f} s after the stop"
            )


@rule("motion/new-target", on=(new_targets,))
def new_target(trace: tuple[Leg, ...], motion: MotionMap) -> Iterator[Outcome]:
    """Judge what a second target under way does: it displaces the first for good, or is refused, as declared."""
    for leg in trace:
        first, second = leg.commands[:2]
        if motion.goto.while_moving == "refused":
            yield Case(second.refused, second.attempt, "4xx for a second move under way")
            if second.refused:
                yield from _reached(leg, first, motion)
        else:
            yield from _reached(leg, second, motion)
            yield from _given_up(leg, motion)


def _given_up(leg: Leg, motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether a device that has another target gives up the first one within the time to settle."""
    first, second = leg.commands[:2]
    axis = max(first.targets, key=lambda name: abs(first.targets[name] - leg.start.get(name, 0.0)))
    ahead = 1 if first.targets[axis] > leg.start[axis] else -1
    readings = leg.after(second.answered + motion.goto.settle_s)
    if not second.accepted or len(readings) < SEVERAL:
        return
    places = [ahead * place(readings[i : i + SEVERAL], axis) for i in range(len(readings) - SEVERAL + 1)]
    farther = max(places) - places[0]
    yield Case(
        farther <= motion.tolerance(axis),
        second.attempt,
        f"{axis} no nearer to the first target {motion.goto.settle_s:g} s after a second one was accepted",
        observed=f"{farther:.3g} nearer after that",
        cause="first target",
    )


@rule("motion/last-of-many", on=(many_commands,))
def last_of_many(trace: Leg, motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether the device ends at the last accepted of many targets."""
    accepted = [one for one in trace.commands if one.accepted]
    if not accepted:
        yield Case(holds=False, exchange=trace.commands[-1].attempt, expected="a 2xx for one of many moves at least")
    else:
        yield from _reached(trace, accepted[-1], motion)


@rule("motion/repeated", on=(repeated,))
def repetition(trace: Leg, motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether a move that is sent twice ends where it ends when it is sent once."""
    accepted = [one for one in trace.commands if one.accepted]
    yield from _reached(trace, (accepted or list(trace.commands))[-1], motion)


@rule("motion/one-client", on=(several_clients,))
def one_client(trace: tuple[Leg, ...], motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether of several clients' targets one is reached, and no mix of two."""
    for leg in trace:
        accepted = [one for one in leg.commands if one.accepted]
        usable = _usable(leg)[-SEVERAL:]
        if not accepted or len(usable) < SEVERAL:
            yield NotTested("no client's move was accepted" if not accepted else "the state could not be read")
            continue
        here = _at(usable, motion)
        fits = any(not _off(here, one.targets, motion) for one in accepted)
        yield Case(fits, accepted[-1].attempt, "the target of one client", observed=_named(here))


def _still(quiet: Quiet, motion: MotionMap) -> str:
    """Return how the device moved in a watch; empty if it stayed."""
    usable = tuple(one for one in quiet.readings if one.values)
    for index in range(len(usable) - SEVERAL + 1):
        off = _off(_at(usable[index : index + SEVERAL], motion), quiet.where, motion)
        if off:
            return off
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
            yield from _reached(leg, leg.commands[-1], motion)
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


@rule("motion/fresh", on=_ALL)
def fresh(trace: Leg | tuple[Leg, ...], motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether the position that is read changes as often as declared while the device moves."""
    for leg in _legs(trace):
        usable = _usable(leg)
        changed = [i for i in range(1, len(usable)) if usable[i].values != usable[i - 1].values]
        if len(changed) < SEVERAL or leg.commands[-1].targets == {}:
            continue
        edges = [changed[0], *changed[1:]]
        still_s = max(usable[b - 1].sent - usable[a].received for a, b in itertools.pairwise(edges))
        yield Case(
            still_s <= motion.state.fresh_s,
            usable[-1].exchange,
            f"another position at least every {motion.state.fresh_s:g} s under way",
            observed=f"the same one for {still_s:.2f} s",
            cause="stale",
        )


@rule("motion/stamp", on=_ALL)
def stamp(trace: Leg | tuple[Leg, ...], motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether the stamp of the state goes on, and never back."""
    if not motion.state.stamp:
        yield NotTested("the map names no stamp")
        return
    for leg in _legs(trace):
        usable = [one for one in leg.readings if one.values]
        stamps = [one.stamp for one in usable if one.stamp is not None]
        if len(stamps) < len(usable):
            yield Case(holds=False, exchange=usable[0].exchange, expected=f"a time at {motion.state.stamp}")
        elif len(stamps) > SEVERAL:
            back = any(two < one for one, two in itertools.pairwise(stamps))
            stuck = stamps[-1] == stamps[0] and usable[-1].sent - usable[0].received > motion.state.fresh_s
            found = "it went back" if back else "it stood still" if stuck else ""
            yield Case(not found, usable[-1].exchange, "a stamp that goes on", observed=found, cause=found)
