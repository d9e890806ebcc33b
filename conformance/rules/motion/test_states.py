"""Rules on whether a device's move states and positions agree, and whether its switches work (motion map)."""

from __future__ import annotations

from collections.abc import Iterator

from conformance.measures.samples import SEVERAL
from conformance.rules.motion.judging import halts, off, usable
from conformance.scenarios.motion.moves import stops, targets
from conformance.scenarios.motion.states import agreement, switched
from conformance.scenarios.motion.trace import Leg, Reading, Switched, Told
from conformance.scenarios.rule import NotClaimed, NotTested, Outcome, rule
from conformance.statement.motion_map import MotionMap
from conformance.verdict.evidence import Case

_NO_ACTION = NotClaimed("the map has no [motion.action]")


@rule("motion/agrees", on=(agreement,))
def agrees(trace: tuple[Told, ...], motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether all operations return the same position and velocity, in one of several readings."""
    own = motion.state.read
    for index in range(0, len(trace) - SEVERAL + 1, SEVERAL):
        rounds = [told for told in trace[index : index + SEVERAL] if told.values[own]]
        for call in motion.state.agrees if rounds else ():
            if call in rounds[-1].exchanges:
                apart = [_apart(told.values[call], told.values[own], motion) for told in rounds]
                expected = f"what {own} tells also from {call}, {rounds[-1].when}"
                yield Case(not all(apart), rounds[-1].exchanges[call], expected, observed=apart[-1], cause=call)


def _apart(values: dict[str, float], own: dict[str, float], motion: MotionMap) -> str:
    if not values:
        return "no numbers at the map's pointers"
    for name, value in values.items():
        axis = motion.state.axes.get(name)
        room = motion.tolerance(name) if axis else motion.speed_tolerance(name)
        if not abs(axis.apart(value, own[name]) if axis else value - own[name]) <= room:
            return f"{name} {value:.4g} in place of {own[name]:.4g}"
    return ""


@rule("motion/action-succeeds", on=(targets,))
def action_succeeds(trace: tuple[Leg, ...], motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether a move reports success once it has arrived, and not before."""
    action = motion.action
    if action is None or not action.succeeded:
        yield _NO_ACTION
        return
    for leg in trace:
        goal, seen = leg.commands[-1], usable(leg)
        early = [
            seen[index]
            for index in range(len(seen) - SEVERAL)
            if seen[index].action in action.succeeded
            and all(off(reading.values, goal.targets, motion, 2) for reading in seen[index : index + SEVERAL])
        ]
        if goal.is_ok and seen:
            words = " or ".join(action.succeeded)
            expected = f"{words} at {action.at} when {leg.what} is reached, and not before"
            found = f"{early[0].action} under way" if early else f"{seen[-1].action or 'nothing'} at the end"
            yield Case(not early and seen[-1].action in action.succeeded, goal.exchange, expected, observed=found)


@rule("motion/action-runs", on=(targets,))
def action_runs(trace: tuple[Leg, ...], motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether a move is reported as running while it runs."""
    action = motion.action
    if action is None or not action.running:
        yield _NO_ACTION
        return
    for leg in trace:
        goal = leg.commands[-1]
        under_way = [reading for reading in usable(leg) if _is_between(reading, leg, motion)]
        if goal.is_ok and len(under_way) >= SEVERAL:
            words = {reading.action for reading in under_way}
            found = " and ".join(sorted(words)) or "nothing"
            expected = f"{' or '.join(action.running)} at {action.at} under way ({leg.what})"
            yield Case(bool(words & set(action.running)), goal.exchange, expected, observed=found)


def _is_between(one: Reading, leg: Leg, motion: MotionMap) -> bool:
    """Return whether a reading shows the device off its start and off its target."""
    return bool(off(one.values, leg.start, motion) and off(one.values, leg.commands[-1].targets, motion, 3))


@rule("motion/action-canceled", on=(stops,))
def action_canceled(trace: tuple[Leg, ...], motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether a stopped move is reported as canceled."""
    action = motion.action
    if action is None or not action.canceled:
        yield _NO_ACTION
        return
    for leg, readings, unusable in halts(trace, motion):
        if isinstance(unusable, NotTested):
            yield unusable
        elif readings:
            yield Case(
                leg.readings[-1].action in action.canceled,
                leg.commands[-1].exchange,
                f"{' or '.join(action.canceled)} at {action.at} after {leg.what}",
                observed=leg.readings[-1].action or "nothing",
            )


@rule("motion/switches", on=(switched,))
def switches(trace: tuple[Switched, ...]) -> Iterator[Outcome]:
    """Judge whether each switch takes each of its values, and keeps it."""
    for switch in trace:
        expected = f"{switch.switch} {switch.value!r} shown, and kept"
        found = f"{switch.shown!r}" + (" a moment later" if switch.arrived else "")
        holds = switch.command.response.ok and switch.arrived and switch.stayed
        yield Case(
            holds,
            switch.command,
            expected,
            observed="" if not switch.command.response.ok else found,
            cause=switch.switch,
        )
