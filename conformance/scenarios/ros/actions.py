"""Scenarios on actions: goals that succeed, are aborted, rejected and canceled, and two at once.

Times are s of the monotonic clock, which all processes of a machine share.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any, Final

from conformance.observe.clock import WALL_CLOCK
from conformance.scenarios.ros.definition import Definition, value_at
from conformance.scenarios.ros.gateway import Gateway
from conformance.scenarios.ros.retries import Retry, retries
from conformance.scenarios.ros.robot import Heard
from conformance.scenarios.ros.services import NO_PLAY
from conformance.scenarios.ros.web import TRIES, document_of, gave_up, is_out_of_range, is_success
from conformance.scenarios.scenario import NotDeclaredError, partial_trace, scenario
from conformance.scenarios.stage import Leaves, Need, Stage
from conformance.statement.ros_map import Acts
from conformance.transport.exchange import Attempt, Exchange
from conformance.transport.parallel import crowd

_NEEDS: Final = (Need.REST,)
_PACE_S: Final = 0.06
_GAP_S = 0.6  # pause between two feedbacks, s
_RUNS_S = 0.3  # how long a goal runs before it is cancelled, s
_GOES_ON_S: Final = 1.5  # how long a goal runs on that refuses its cancellation, or that runs beside another, s
_FEEDBACKS: Final = 3  # feedbacks that a goal sends
_PARTS: Final = ("Goal", "Result", "Feedback")
# Reads of a goal after its end.
_AFTERWARDS: Final = 3
_MORE_S: Final = 0.3
# A goal whose client disconnects takes _STAYS_S, s; without a response, the client waits for _GOES_S.
_STAYS_S, _GOES_S = 3.0, 1.0
# Delay with which a busy server ends a goal, s.
_LATE_S: Final = 1.0


class Course(StrEnum):
    """How the action server handles a goal."""

    REACHED = "whose server is found"
    SUCCEEDS = "that succeeds"
    ABORTS = "that is aborted"
    REJECTED = "that is rejected"
    CANCELED = "that is canceled"
    GOES_ON = "that refuses to be canceled, and succeeds"
    FIRST = "that is canceled while another one goes on"
    SECOND = "that goes on while another one is canceled"
    BACK = "whose server is back"


@dataclass(frozen=True)
class Look:
    """One reading of a goal's state.

    Attributes:
        sent, received: when.
        exchange: request and response.
        word: what it says of its state; empty if there is none.
        feedback, result: whether the response has one.
    """

    sent: float
    received: float
    exchange: Exchange
    word: str
    feedback: bool
    result: bool


@dataclass(frozen=True)
class Goal:
    """A goal, and its course at both ends.

    Attributes:
        operation: the operation.
        body: its map.
        course: what the server did with it.
        value: JSON of the goal.
        exchange: the request that sent it, and its response.
        feedback: JSON of the feedback that the server gave, in order.
        result: JSON of the result that the server gave; empty if there is none.
        looks: what it said of itself.
        cancel: the request to cancel it, and its response; None if there was none.
        heard: what the server got and did, for this goal or for this and its other.
    """

    operation: str
    body: Acts
    course: Course
    value: str
    exchange: Exchange
    feedback: tuple[str, ...] = ()
    result: str = ""
    looks: tuple[Look, ...] = ()
    cancel: Exchange | None = None
    heard: tuple[Heard, ...] = ()

    @property
    def is_ok(self) -> bool:
        """Whether the gateway took it."""
        return is_success(self.exchange, self.body)


@dataclass(frozen=True)
class Left:
    """A goal whose client disconnected while it ran.

    Attributes:
        body: the operation's map.
        attempt: what the client got before it went.
        heard: what the server got and did.
    """

    body: Acts
    attempt: Attempt
    heard: tuple[Heard, ...]


@dataclass(frozen=True)
class Goals:
    """Goals, and definitions of the parts of an action, by operation and part."""

    probes: tuple[Goal, ...]
    definitions: dict[str, Definition]
    retries: tuple[Retry, ...] = ()
    left: tuple[Left, ...] = ()


@scenario(needs=_NEEDS, leaves=Leaves.AT_REST, stage=Stage.ACTING)
def action_goals(gateway: Gateway) -> Goals:
    """Serve actions, send them goals of each course through the gateway, and read the goals' states."""
    if not gateway.plays:
        raise NotDeclaredError(NO_PLAY)
    probes: list[Goal] = []
    definitions: dict[str, Definition] = {}
    retried: list[Retry] = []
    left: list[Left] = []
    with partial_trace(lambda: Goals(tuple(probes), definitions)):
        for call, body in gateway.of(Acts):
            for part in _PARTS:
                definitions[f"{call}#{part}"] = gateway.definition(f"{body.type}#{part}")
            with gateway.robot.publishing(body.action):
                sender = _Sender(gateway, call, body)
                probes.extend(sender.goals())
                retried.extend(retries(gateway, call, body, prepare=sender.delay))
                left.extend(sender.leave())
    return Goals(tuple(probes), definitions, tuple(retried), tuple(left))


class _Sender:
    def __init__(self, gateway: Gateway, call: str, body: Acts) -> None:
        self._gateway, self._call, self._body = gateway, call, body

    def goals(self) -> Iterator[Goal]:
        """Yield a goal of each course."""
        self._serve()
        yield self._reach_server(Course.REACHED)
        feedback, result = [self._new("Feedback") for _ in range(_FEEDBACKS)], self._new("Result")
        steps: dict[Course, dict[str, Any]] = {
            Course.SUCCEEDS: {"feedback": feedback, "gap_s": _GAP_S, "result": result},
            Course.ABORTS: {"gap_s": _RUNS_S, "end": "abort", "result": self._new("Result")},
            Course.REJECTED: {"reject": True},
            Course.CANCELED: {"feedback": feedback[:1], "end": "never", "result": self._new("Result")},
            Course.GOES_ON: {"gap_s": _GOES_ON_S, "refuse_cancel": True, "result": self._new("Result")},
            Course.FIRST: {},
        }
        self._gateway.send_texts(self._call, self._body)
        for course, step in list(steps.items())[: None if self._body.cancel else 3]:
            for turn in range(TRIES):
                goals = self._two() if course is Course.FIRST else [self._follow_goal(course, step)]
                late = any(gave_up(sent, self._body) for goal in goals for sent in (goal.exchange, goal.cancel))
                # rclpy's action client loses a response that comes before it has noted its request, if a busy machine
                # pauses it in between.
                lost = not turn and any(goal.looks and not self._has_ended(list(goal.looks)) for goal in goals[:1])
                if not (late or lost):
                    break
            yield from goals
        self._gateway.robot.tell("forget", name=self._body.action)
        self._serve()
        yield self._reach_server(Course.BACK)

    def delay(self, delay_s: float) -> None:
        """Have the server carry out the next goal for so long, s."""
        self._gateway.robot.tell("script", name=self._body.action, script=[{"gap_s": delay_s}, {}])

    def leave(self) -> Iterator[Left]:
        """Send a goal from a client that disconnects while the goal runs, where the map says what that does."""
        if self._body.disconnect:
            self.delay(_STAYS_S)
            self._gateway.robot.take_heard(self._body.action)
            made, _ = self._gateway.usual_request(self._call, self._body)
            attempt = crowd(self._gateway.api.client, [[made]], _GOES_S)[0][0]
            # The goal, its cancellation and its end.
            heard = self._gateway.robot.take_heard(self._body.action, 3, _STAYS_S + _MORE_S)
            yield Left(self._body, attempt, tuple(heard))

    def _serve(self) -> None:
        self._gateway.robot.tell("act", action=self._body.action, type=self._body.type, script=[{}])

    def _new(self, part: str) -> dict[str, Any]:
        """Return a message of a part that differs from all others."""
        return self._gateway.usual(f"{self._body.type}#{part}")

    def _send(self) -> tuple[dict[str, Any], Exchange]:
        value = self._new("Goal")
        return value, self._gateway.send(self._gateway.request(self._call, self._body, value), self._body.response_s)

    def _reach_server(self, course: Course) -> Goal:
        """Send goals until one reaches its server, or the gateway's time is over."""
        robot, until = self._gateway.robot, WALL_CLOCK.now() + 2 * self._body.within_s
        while True:
            robot.take_heard(self._body.action)
            value, exchange = self._send()
            heard = robot.take_heard(self._body.action, 1, _MORE_S)
            goal = Goal(self._call, self._body, course, json.dumps(value), exchange, heard=tuple(heard))
            if (heard and goal.is_ok) or WALL_CLOCK.now() > until:
                WALL_CLOCK.sleep(_MORE_S)
                return goal
            maker = self._gateway.maker(self._gateway.definition(f"{self._body.type}#Goal"))
            maker.is_gentle |= is_out_of_range(exchange, self._body)

    def _begin_goal(self, course: Course, *steps: dict[str, Any]) -> Goal:
        robot = self._gateway.robot
        robot.tell("script", name=self._body.action, script=[*steps, {}])
        robot.take_heard(self._body.action)
        value, exchange = self._send()
        return self._goal(course, value, exchange, steps[0])

    def _goal(self, course: Course, value: dict[str, Any], exchange: Exchange, step: dict[str, Any]) -> Goal:
        feedback = tuple(json.dumps(item) for item in step.get("feedback", []))
        result = json.dumps(step["result"]) if "result" in step else ""
        return Goal(self._call, self._body, course, json.dumps(value), exchange, feedback, result)

    def _follow_goal(self, course: Course, step: dict[str, Any]) -> Goal:
        """Send a goal, and follow it to its end; cancel it if that is its course."""
        goal, robot = self._begin_goal(course, step), self._gateway.robot
        looks: list[Look] = []
        cancel: Exchange | None = None
        if goal.is_ok and course in {Course.CANCELED, Course.GOES_ON}:
            looks += self._watch_goal(goal, WALL_CLOCK.now() + _RUNS_S, lambda _: False)
            cancel = self._cancel(goal)
        if goal.is_ok:
            lasts_s = step.get("gap_s", 0.0) * (len(goal.feedback) + 1)
            until = WALL_CLOCK.now() + lasts_s + self._body.within_s + _LATE_S
            looks += self._watch_goal(goal, until, self._has_ended)
        heard = tuple(robot.take_heard(self._body.action, 2, _MORE_S))
        return replace(goal, looks=tuple(looks), cancel=cancel, heard=heard)

    def _two(self) -> list[Goal]:
        """Send two goals, cancel the first, and follow both; then cancel the second."""
        robot, body = self._gateway.robot, self._body
        if "{id}" not in f"{body.cancel}{body.cancel_body}" and "/{" not in body.cancel:
            # There is one goal at a time: another one takes its place.
            return []
        steps = [{"end": "never", "result": self._new("Result")} for _ in range(2)]
        first = self._begin_goal(Course.FIRST, *steps)
        value, exchange = self._send()
        second = self._goal(Course.SECOND, value, exchange, steps[1])
        if not (first.is_ok and second.is_ok):
            # A server or gateway may accept only one goal at a time.
            return []
        cancel = self._cancel(first)
        ended = self._watch_goal(first, WALL_CLOCK.now() + body.within_s + _LATE_S, self._has_ended)
        went_on = self._watch_goal(second, WALL_CLOCK.now() + _RUNS_S, lambda _: False)
        heard = tuple(robot.take_heard(body.action, 4, _MORE_S))
        self._cancel(second)
        robot.take_heard(body.action, 2, _MORE_S)
        first = replace(first, looks=tuple(ended), cancel=cancel, heard=heard)
        return [first, replace(second, looks=tuple(went_on), heard=heard)]

    def _cancel(self, goal: Goal) -> Exchange | None:
        made = self._gateway.following(goal.exchange, self._body, self._body.cancel, self._body.cancel_body)
        return None if made is None else self._gateway.send(made, self._body.response_s)

    def _watch_goal(self, goal: Goal, until: float, is_over: Callable[[list[Look]], bool]) -> list[Look]:
        looks: list[Look] = []
        state = self._body.state
        made = self._gateway.following(goal.exchange, self._body, state.read, state.body) if state else None
        while made is not None and state is not None:
            sent = WALL_CLOCK.now()
            exchange = self._gateway.send(made, self._body.response_s)
            received = WALL_CLOCK.now()
            value = document_of(exchange.response.body).value
            word = None if state.ended is None else value_at(value, state.ended)
            value = value if exchange.response.ok else None
            word = value_at(value, state.at) if word is None else word
            pointers = (self._body.feedback, self._body.result)
            has = [pointer is not None and value_at(value, pointer) is not None for pointer in pointers]
            looks.append(Look(sent, received, exchange, "" if word is None else str(word), *has))
            if sent > until or is_over(looks):
                break
            WALL_CLOCK.sleep(_PACE_S)
        return looks

    def _has_ended(self, looks: list[Look]) -> bool:
        """Return whether the last looks all show an end."""
        last = looks[-_AFTERWARDS:]
        return len(last) == _AFTERWARDS and all(is_end(self._body, look.word) for look in last)


def is_end(body: Acts, word: str) -> bool:
    """Return whether a word for a goal's state means that it has ended."""
    state = body.state
    return state is not None and word in {*state.succeeded, *state.aborted, *state.canceled, *state.rejected}
