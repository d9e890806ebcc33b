"""Rules on goals of a gateway: it sends and cancels them as requested, and reports their state."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Final

from conformance.rules.ros_gateway.judging import change_text, differing, fails_as, judge_retry, statuses
from conformance.scenarios.ros.actions import Course, Goal, Goals, Look, action_goals, is_end
from conformance.scenarios.ros.web import is_success
from conformance.scenarios.rule import NotClaimed, NotTested, Outcome, rule
from conformance.statement.ros_map import RosMap
from conformance.transport.exchange import Exchange
from conformance.verdict.evidence import Case

_ACCEPTED: Final = (
    Course.SUCCEEDS, Course.ABORTS, Course.CANCELED, Course.GOES_ON, Course.FIRST, Course.SECOND,
)  # fmt: skip
_ENDS: Final = {
    Course.SUCCEEDS: "succeeded", Course.GOES_ON: "succeeded", Course.ABORTS: "aborted", Course.CANCELED: "canceled",
    Course.FIRST: "canceled",
}  # fmt: skip
# Time in which several reads must show what a server sent, s.
_SHOWN_S: Final = 0.3
_SEVERAL: Final = 2
_NO_STATE: Final = NotClaimed("the map has no state of goals")


@rule("ros-gateway/goal-once", on=(action_goals,))
def once(trace: Goals) -> Iterator[Outcome]:
    """Judge whether an accepted goal reached the server unchanged, and exactly once."""
    for goal in trace.probes:
        if goal.course not in _ACCEPTED or goal.course is Course.SECOND:
            continue
        if not goal.is_ok:
            # A response without a state to read may be that of the goal's end.
            if goal.body.state is not None or goal.course is Course.SUCCEEDS:
                yield Case(False, goal.exchange, f"2xx for a goal {goal.course}", cause="refused")
            continue
        wanted = 2 if goal.course is Course.FIRST else 1
        goals = [heard for heard in goal.heard if heard.what == "goal"]
        expected = f"{wanted} goal{'s' * (wanted > 1)} at {goal.body.action} for {wanted} accepted"
        cause = "lost" if len(goals) < wanted else "doubled"
        yield Case(len(goals) == wanted, goal.exchange, expected, f"{len(goals)} goals", cause)
        found = change_text(goals[0].content, goal.value, goal.body) if goals else ""
        yield Case(not found, goal.exchange, "the goal's fields at its server", found, "changed")


@rule("ros-gateway/goal-once", on=(action_goals,))
def goal_repeats(trace: Goals) -> Iterator[Outcome]:
    """Judge whether of equal requests each is one goal, and a retry with its key none."""
    yield from map(judge_retry, trace.retries)


@rule("ros-gateway/goal-rejected", on=(action_goals,))
def rejected(trace: Goals) -> Iterator[Outcome]:
    """Judge whether a goal that its server rejects is reported as that."""
    for goal in trace.probes:
        if goal.course is not Course.REJECTED or not any(heard.what == "rejected" for heard in goal.heard):
            continue
        body, declared = goal.body, goal.body.rejected
        expected = f"{statuses(declared)} for a goal {goal.course}"
        if not goal.is_ok:
            yield Case(fails_as(goal.exchange, body, declared), goal.exchange, expected, cause="status")
            continue
        last = goal.looks[-1] if goal.looks else None
        state = body.state
        if declared or last is None or state is None:
            yield Case(holds=False, exchange=goal.exchange, expected=expected, cause="accepted")
            continue
        others = {*state.running, *state.succeeded, *state.canceled}
        holds = last.word in state.rejected if state.rejected else last.word not in others
        expected = f"the state {' or '.join(state.rejected)}" if state.rejected else "no state of an accepted goal"
        yield Case(holds, last.exchange, f"{expected} for a goal {goal.course}", observed=last.word, cause="state")


@rule("ros-gateway/goal-outcome", on=(action_goals,))
def outcomes(trace: Goals) -> Iterator[Outcome]:
    """Judge whether a goal's state is that of its server: running until the end, then how it ended, for good."""
    for goal in trace.probes:
        state, name = goal.body.state, _ENDS.get(goal.course, "")
        if state is None:
            yield _NO_STATE
            continue
        if not name or not goal.looks or (goal.course is not Course.ABORTS and _end_of(goal) is None):
            continue
        words: tuple[str, ...] = getattr(state, name)
        if not words:
            continue
        last, end = goal.looks[-1], _end_of(goal)
        # Another end is wrong at once; a goal that still runs may have been ended just now.
        runs_on = last.word not in words and not is_end(goal.body, last.word)
        if runs_on and end is not None and last.sent < end + goal.body.within_s:
            yield NotTested(f"the server ended a goal {goal.course} too late to see what becomes of it")
            continue
        end_of = f"the end of a goal {goal.course}"
        expected = f"the state {' or '.join(words)} within {goal.body.within_s:g} s after {end_of}"
        yield Case(last.word in words, last.exchange, expected, observed=f"{last.word!r}", cause=goal.course)
        yield from _steady(goal)


def _end_of(one: Goal) -> float | None:
    """Return when the first of the server's goals ended, or None."""
    return next((heard.at for heard in one.heard if heard.what == "end"), None)


def _steady(one: Goal) -> Iterator[Outcome]:
    end, state = _end_of(one), one.body.state
    # A cancellation that the server has accepted is as good as its end.
    taken = min((heard.at for heard in one.heard if heard.what == "cancel" and heard.content["accepted"]), default=end)
    ends = dict.fromkeys(state.canceled if state else (), taken)
    looks = [(look, ends.get(look.word, end)) for look in one.looks if is_end(one.body, look.word)]
    early = [(look, due) for look, due in looks if due is not None and look.received < due]
    if early:
        look, due = early[0]
        found = f"{look.word!r} {due - look.received:.2f} s before it"
        yield Case(False, look.exchange, f"no end before that of a goal {one.course}", found, "early")
    ended = [look for look, _ in looks]
    left = next((late for first, late in pairwise(ended) if late.word != first.word), None)
    if ended:
        found = f"{ended[0].word!r}, then {left.word!r}" if left else ""
        yield Case(not left, (left or ended[0]).exchange, "the same state after the end", found, cause="changes")


@rule("ros-gateway/goal-result", on=(action_goals,))
def results(trace: Goals, ros: RosMap) -> Iterator[Outcome]:
    """Judge whether the result of a goal that succeeded is exact, and that of another one is not another's."""
    for goal in trace.probes:
        body = goal.body
        if body.result is None:
            yield NotClaimed("the map has no result of goals")
            continue
        ended = [look for look in goal.looks if is_end(body, look.word)]
        if not goal.result or not ended or goal.course not in _ENDS:
            continue
        last, definition = ended[-1], trace.definitions[f"{goal.operation}#Result"]
        if last.result or _ENDS[goal.course] == "succeeded":
            found = differing(last.exchange, goal.result, definition, body, body.result, ros)
            expected = f"the result of a goal {goal.course}"
            yield Case(not found, last.exchange, expected, observed=found, cause=f"{goal.course} {found.split(' ')[0]}")


@rule("ros-gateway/goal-feedback", on=(action_goals,))
def feedback(trace: Goals, ros: RosMap) -> Iterator[Outcome]:
    """Judge whether feedback is the server's, exact, in order, and the last one."""
    for goal in trace.probes:
        if goal.body.feedback is None:
            yield NotClaimed("the map has no feedback of goals")
            continue
        if goal.course is Course.SUCCEEDS and goal.is_ok and goal.looks:
            yield from _feedback(goal, trace, ros)


def _feedback(one: Goal, trace: Goals, ros: RosMap) -> Iterator[Outcome]:
    given = [heard.at for heard in one.heard if heard.what == "feedback"]
    numbered = [(look, _number_of(look, one, trace, ros)) for look in one.looks if look.feedback]
    if not given:
        yield NotTested("the server gave no feedback")
        return
    if not numbered:
        yield Case(holds=False, exchange=one.looks[-1].exchange, expected="feedback of the server", cause="none")
        return
    strange = next((look for look, number in numbered if number is None), None)
    yield Case(strange is None, (strange or numbered[0][0]).exchange, "feedback as the server gave it", cause="strange")
    known = [(look, number) for look, number in numbered if number is not None]
    back = next((late for first, late in pairwise(known) if late[1] < first[1]), None)
    yield Case(back is None, (back or known[0])[0].exchange if known else None, "feedback in order", cause="order")
    late = [look for look, number in known if _is_late(look, number, given, _end_of(one))]
    expected = f"the last feedback {_SHOWN_S:g} s after the server gave it"
    yield Case(len(late) < _SEVERAL, (late or one.looks)[-1].exchange, expected, "an earlier one", cause="late")


def _is_late(look: Look, number: int, given: list[float], end: float | None) -> bool:
    """Return whether a later feedback than the shown one had been given long before a reading."""
    due = sum(at + _SHOWN_S < look.sent for at in given)
    return number + 1 < due and (end is None or look.received < end)


def _number_of(look: Look, one: Goal, trace: Goals, ros: RosMap) -> int | None:
    """Return which of the server's feedback a reading shows, or None."""
    definition = trace.definitions[f"{one.operation}#Feedback"]
    pointer = one.body.feedback or ""
    given = enumerate(one.feedback)
    return next(
        (n for n, value in given if not differing(look.exchange, value, definition, one.body, pointer, ros)), None
    )


@rule("ros-gateway/goal-cancel", on=(action_goals,))
def cancels(trace: Goals) -> Iterator[Outcome]:
    """Judge whether a cancel request reaches the server for this goal alone, and its result is reported."""
    for goal in trace.probes:
        if not goal.body.cancel:
            yield NotClaimed("the map has no operation that cancels")
            continue
        if goal.course in {Course.CANCELED, Course.GOES_ON, Course.FIRST} and isinstance(goal.cancel, Exchange):
            yield from _judge_cancel(goal, goal.cancel)
        if goal.course is Course.SECOND and goal.body.state is not None and goal.looks:
            last = goal.looks[-1]
            holds = last.word not in goal.body.state.canceled
            yield Case(holds, last.exchange, f"no cancellation of a goal {goal.course}", last.word, cause="another")


@rule("ros-gateway/goal-cancel", on=(action_goals,))
def disconnects(trace: Goals) -> Iterator[Outcome]:
    """Judge whether a goal whose client disconnects is canceled, or goes on, as the map says."""
    for one in trace.left:
        came = {heard.what for heard in one.heard}
        if "goal" not in came:
            yield NotTested("the goal of a client that disconnects did not reach its server")
            continue
        cancels, wanted = "cancel" in came, one.body.disconnect == "cancels"
        expected = f"{'a' if wanted else 'no'} request to cancel at {one.body.action} for a goal whose client left"
        yield Case(cancels is wanted, one.attempt, expected, "one" if cancels else "none", "disconnect")


def _judge_cancel(one: Goal, cancel: Exchange) -> Iterator[Outcome]:
    asked = [heard for heard in one.heard if heard.what == "cancel"]
    ok = is_success(cancel, one.body)
    if one.course is Course.GOES_ON:
        words = one.body.state.canceled if one.body.state else ()
        said = next((look for look in one.looks if look.word in words), None)
        found = said.word if said else ""
        yield Case(said is None, (said or one).exchange, f"no cancellation of a goal {one.course}", found, "refused")
        return
    expected, found = f"2xx, and one request to cancel at {one.body.action}", f"{len(asked)} requests to cancel"
    cause = "lost" if not asked else "refused" if not ok else "doubled"
    yield Case(ok and len(asked) == 1, cancel, expected, f"{cancel.came}, and {found}", cause)


@rule("ros-gateway/recovers", on=(action_goals,))
def recovers(trace: Goals) -> Iterator[Outcome]:
    """Judge whether goals reach a server that is back."""
    for goal in trace.probes:
        if goal.course in {Course.REACHED, Course.BACK}:
            holds = goal.is_ok and bool(goal.heard)
            expected = f"2xx, and a goal at {goal.body.action}, {goal.course}"
            yield Case(holds, goal.exchange, expected, "none" if not goal.heard else "", cause=goal.course)
