"""Rules on states: the device accepts, refuses and changes state as its state map declares."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby

from conformance.scenarios.rule import Note, NotSeen, Outcome, rule
from conformance.scenarios.states import Step, Walk, walked
from conformance.statement.state_map import StateMap
from conformance.verdict.evidence import Case

# Times: a state that changes by itself may excuse a difference once.
_TWICE = 2


def _judged_steps(trace: Walk, state_map: StateMap) -> Iterator[Step]:
    """Yield the steps that must be accepted, without those that the device's own change of state may have overtaken.

    It has where it left the device in a state that follows by itself, while another try was in time, or was none.
    """
    taken = [one for one in trace.steps if one.taken and state_map.operations[one.operation].is_taken_in(one.state)]
    for step in taken:
        tries = [one for one in taken if (one.operation, one.state) == (step.operation, step.state)]
        changed = step.shown[-1] in state_map.following(step.state) - {step.state}
        if step.arrived or not changed or (len(tries) >= _TWICE and not any(one.arrived for one in tries)):
            yield step


def _status_text(step: Step) -> str:
    return f"status {step.exchange.response.status}" + ("" if step.taken else ", which is a refusal")


@rule("states/taken", on=(walked,))
def taken(trace: Walk, state_map: StateMap) -> Iterator[Outcome]:
    """Judge whether operations are accepted where they must be, unless the state may have ended before."""
    for step in trace.steps:
        ended = step.shown[0] != step.state and step.state in state_map.changes
        if state_map.operations[step.operation].is_taken_in(step.state) and (step.taken or not ended):
            expected = f"a 2xx for {step.operation} in {step.state}"
            yield Case(step.taken, step.exchange, expected, _status_text(step), f"{step.operation} in {step.state}")
    yield from _unseen(trace)


def _unseen(trace: Walk) -> Iterator[Outcome]:
    """Note which pairs the walk did not show, and where it ended."""
    seen = {(step.operation, step.state) for step in trace.steps}
    lacking = [state for state in trace.states if not any((name, state) in seen for name in trace.operations)]
    if lacking:
        yield Note(f"No operation was sent in the state {', '.join(lacking)}: the walk did not come there.")
    if strange := {state for step in trace.steps for state in step.shown} - set(trace.states):
        yield Note(f"The device showed {', '.join(sorted(strange))}, which the state map does not name.")
    if trace.last != trace.first:
        yield Note(f"The device is in the state {trace.last} now; it was {trace.first} before, and no way led back.")


@rule("states/refused", on=(walked,))
def refused(trace: Walk, state_map: StateMap) -> Iterator[Outcome]:
    """Judge whether operations are refused where they must be; in a state that changes by itself, each time."""

    def place(step: Step) -> tuple[str, str]:
        return step.operation, step.state

    for (name, state), steps in groupby(sorted(trace.steps, key=place), key=place):
        one, tries = state_map.operations[name], list(steps)
        if one.is_taken_in(state):
            continue
        wrong = [step for step in tries if step.taken or _status(step) not in (one.refusal or (_status(step),))]
        if state in state_map.changes and wrong and (len(tries) < _TWICE or len(wrong) < len(tries)):
            yield NotSeen(f"{state} may have ended before {name} came")
            continue
        wanted = " or ".join(map(str, one.refusal)) or "4xx"
        shown = (wrong or tries)[0]
        expected = f"{wanted} for {name} in {state}"
        yield Case(not wrong, shown.exchange, expected, f"status {_status(shown)}", f"{name} in {state}")


def _status(step: Step) -> int:
    return step.exchange.response.status


@rule("states/keeps", on=(walked,))
def keeps(trace: Walk, state_map: StateMap) -> Iterator[Outcome]:
    """Judge whether refused operations leave the state unchanged."""
    for step in trace.steps:
        if not step.taken:
            may, expected = state_map.following(step.state), f"the state kept by {step.operation} in {step.state}"
            others = [state for state in step.shown if state not in may]
            found = f"{', then '.join(step.shown)}"
            yield Case(not others, step.exchange, expected, found, f"{step.operation} in {step.state}")


@rule("states/leads", on=(walked,))
def leads(trace: Walk, state_map: StateMap) -> Iterator[Outcome]:
    """Judge whether operations that were taken have their effect, and whether it lasts."""
    for step in _judged_steps(trace, state_map):
        one = state_map.operations[step.operation]
        wanted, within_s = one.leads(step.state), one.within_s or state_map.within_s
        lasts = step.shown[-1] in state_map.following(wanted)
        expected = f"the state {wanted} within {within_s:g} s after {step.operation} in {step.state}, and afterwards"
        found = f"{', then '.join(step.shown)}" + ("" if step.arrived else f" after {within_s:g} s")
        yield Case(step.arrived and lasts, step.exchange, expected, found, f"{step.operation} in {step.state}")


@rule("states/order", on=(walked,))
def order(trace: Walk, state_map: StateMap) -> Iterator[Outcome]:
    """Judge whether the states on the way are those of the map, in its order, and none of rest while it moves."""
    for step in _judged_steps(trace, state_map):
        one = state_map.operations[step.operation]
        if not one.to:
            continue
        to, at = one.leads(step.state), 0
        way = [state_map.following(step.state) - {to}, *({state} for state in one.via), state_map.following(to)]
        for state in step.shown:
            if state in trace.states:
                at = next((index for index in range(at, len(way)) if state in way[index]), len(way))
        named = ", ".join((step.state, *one.via, to))
        expected = f"of {named} each at most once, in this order, after {step.operation}"
        yield Case(
            at < len(way), step.exchange, expected, ", then ".join(step.shown), f"{step.operation} in {step.state}"
        )
    for rest in trace.rests:
        moved = [f"{name} moved by {way:.3g}" for name, (way, most) in rest.ways.items() if way > most]
        expected = f"no motion in the state {rest.state}, a second after it was shown"
        found = f"{rest.state} before and after {' and '.join(moved)} in half a second" if moved else ""
        yield Case(not moved, rest.exchange, expected, found, f"at rest in {rest.state}")
