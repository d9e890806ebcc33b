"""Rejected requests must change nothing: neither the velocity, nor the goal, nor the deliveries."""

from collections.abc import Callable, Iterator
from functools import partial
from http import HTTPStatus
from typing import Any, Final

import pytest

from conformance.api.rest.calls import JSON
from conformance.api.rest.interface import RestInterface
from conformance.api.soap.callable_services import SoapServices
from conformance.api.soap.calls import call
from conformance.api.soap.service import SoapService
from conformance.observe.polling import poll_for
from conformance.packs.table1.robot.deliveries_seen import DeliveryObserver, NoObserverError, observer_of
from conformance.packs.table1.robot.delivery import Delivery, path_of, put_delivery
from conformance.packs.table1.robot.delivery_messages import request
from conformance.packs.table1.robot.goal import arrived, await_goal, await_none, difference, goal_body, put_goal
from conformance.packs.table1.robot.goals import choose_goals
from conformance.packs.table1.robot.invalid_bodies import invalid_bodies, put_body
from conformance.packs.table1.robot.message_shapes import body_of
from conformance.packs.table1.robot.probe.client import ProbeError, RosProbe
from conformance.packs.table1.robot.robot import GOAL_PATH, Robot
from conformance.packs.table1.robot.soap_services import send_delivery
from conformance.packs.table1.robot.standstill_trace import Rest, Standing, stays
from conformance.packs.table1.scenarios.invalid_velocities import invalid_velocities
from conformance.packs.table1.scenarios.standing import standing
from conformance.scenarios.rule import Outcome, rule
from conformance.transport.exchange import SAFE_METHODS, Exchange
from conformance.verdict.effort import Effort
from conformance.verdict.evidence import Judge

pytestmark = [pytest.mark.needs("rest"), pytest.mark.motion]
_OTHER_METHODS: Final = ("GET", "HEAD", "OPTIONS", "POST", "DELETE", "PATCH")
_UNDONE: Final = "http/not-acceptable-undone"
_DONE: Final = "equivalence/delivery-rest"
_VELOCITY: Final = "strict-input/velocity-refused"
_CORRECT: Final = ("3", "1.5", "2.5", "3.5", "4.5", "5.5", "6.5")
_BAD_PARTS: Final = (
    *((0, text) for text in ("0", "5", "abc", "", "3.5", "2147483648")),
    *((place, text) for place in (1, 4, 6) for text in ("abc", "", "NaN", "Infinity", "-Infinity", "1e400")),
)


@rule(_VELOCITY, on=(invalid_velocities,))
def velocity_refused(trace: tuple[Rest, ...]) -> Iterator[Outcome]:
    """Judge that the robot is at rest after each invalid velocity."""
    return (rest.case for rest in trace)


@rule(_VELOCITY, on=(standing,))
def velocity_refused_later(trace: tuple[Standing, ...]) -> Iterator[Outcome]:
    """Judge that the robot stays at rest after all invalid velocities."""
    return stays(trace, _VELOCITY)


@pytest.mark.phase("motion")
@pytest.mark.requirement("strict-input/goal-refused")
def test_an_invalid_goal_is_not_followed(api: RestInterface, robot: Robot, judge: Judge, effort: Effort) -> None:
    """Send invalid goals without a goal and during one: the robot must not follow them."""
    frame = robot.statement.motion.frame
    near, other = choose_goals(robot, 1.5, 2)
    number = "goal.target_pose.pose.position.x"
    bodies = invalid_bodies(api, GOAL_PATH, goal_body(near, frame, "not to be followed"), number)
    bodies += [(what, JSON, body_of(body)) for what, body in _invalid_goals(near, frame)]
    bodies = effort.subsample(bodies, 8)
    for what, media_type, body in bodies:
        exchange = put_body(robot, GOAL_PATH, media_type, body)
        goal, _ = robot.goal()
        if not judge.check(
            "strict-input/goal-refused",
            goal is None,
            exchange,
            f"no goal after PUT of one with {what}",
            found="this goal as the active one",
            cause=what,
        ):
            robot.delete_goal()
            await_none(robot)
    active = goal_body(other, frame, "to be followed")
    put_goal(robot, active)
    if await_goal(robot, active)[1]:
        return  # that a valid goal is followed is for others to judge
    for what, media_type, body in bodies:
        exchange = put_body(robot, GOAL_PATH, media_type, body)
        goal, _ = robot.goal()
        if goal is None and (
            arrived(robot, other) or not _ends(robot, active, partial(put_body, robot, GOAL_PATH, media_type, body))
        ):
            break  # it has arrived, or the robot gave it up by itself
        problem = "none" if goal is None else difference(goal, active)
        judge.check(
            "strict-input/goal-refused",
            not problem,
            exchange,
            f"the goal that was active before PUT of one with {what}",
            found=problem,
            cause=what,
        )
        if problem:
            break
    robot.delete_goal()
    await_none(robot)


def _ends(robot: Robot, active: dict[str, Any], act: Callable[[], object]) -> bool:
    """Return whether an action ends the goal, by comparing with a goal of the same kind without the action."""
    put_goal(robot, active)
    began = robot.clock.now()
    act()
    ended = robot.goal()[0] is None
    took = robot.clock.now() - began
    put_goal(robot, active)
    return ended and all(robot.goal()[0] is not None for _ in poll_for(robot.clock, 0.0, 2 * took))


def _invalid_goals(near: Any, frame: str) -> list[tuple[str, dict[str, Any]]]:
    return [
        ("an empty id", goal_body(near, frame, "")),
        ("an id of 256 characters", goal_body(near, frame, "a" * 256)),
        ("a number as id", {**goal_body(near, frame), "goal_id": {"id": 5}}),
        ("an unknown frame", goal_body(near, "no_such_frame", "unknown frame")),
        ("a quaternion of length 2", goal_body(near, frame, "long", length=2.0)),
        ("a quaternion of length 0", goal_body(near, frame, "none", length=0.0)),
    ]


@pytest.mark.phase("effect")
@pytest.mark.requirement("strict-input/delivery-refused", _UNDONE, _DONE)
def test_an_invalid_delivery_reaches_nobody(
    api: RestInterface, soap: SoapServices, probe: RosProbe, judge: Judge
) -> None:
    """Send invalid deliveries and a valid one after them: the robot must reject the former and deliver only the last.

    The invalid ones include valid paths with other methods: crawlers and link previews send GET.
    """
    rest = api.client
    observer: DeliveryObserver | None = None
    try:
        observer = observer_of(api, probe)
        observer.mark()
    except (NoObserverError, ProbeError) as nobody:
        observer = None
        judge.note("strict-input/delivery-refused", f"judged by the answers alone: {nobody}")
    exchanges = []
    for place, text in api.run.effort.subsample(_BAD_PARTS, 8):
        values = list(_CORRECT)
        values[place] = text
        exchanges.append(rest.send("PUT", path_of(*values), fresh=True))
    others = {
        method: Delivery(3, *(30.0 + 10 * number + place for place in range(6)))
        for number, method in enumerate(api.run.effort.subsample(_OTHER_METHODS, 3))
    }
    by_method = {method: rest.send(method, one.rest_path, fresh=True) for method, one in others.items()}
    if soap.publishers is not None:
        exchanges += _invalid_soap(soap.publishers)
    for exchange in exchanges:
        status = exchange.response.status
        judge.check("strict-input/delivery-refused", status >= 400, exchange, "a refusal of an invalid delivery")
    if observer is None:
        return
    # Valid, but for what the client wants to be told in.
    silent = Delivery(3, 21.0, 22.0, 23.0, 24.0, 25.0, 26.0)
    answer = rest.send("PUT", silent.rest_path, headers=(("Accept", "image/png"),), fresh=True)
    last = Delivery(3, 11.0, 12.0, 13.0, 14.0, 15.0, 16.0)
    put_delivery(api, last.rest_path, fresh=True)
    try:
        seen = [one.delivery for one in observer.collect(1 + answer.response.ok)]
    except (NoObserverError, ProbeError) as nobody:
        pytest.skip(str(nobody))
    if last not in seen:
        judge.note("strict-input/delivery-refused", "judged by the answers alone: no valid delivery was seen to arrive")
        return
    _judge_unwanted(judge, answer, came=silent in seen)
    for method, exchange in by_method.items():
        judge.check(
            "strict-input/delivery-refused",
            others[method] not in seen or (exchange.response.ok and method not in SAFE_METHODS),
            exchange,
            f"no DeliveryRequestMsg on ROS after {method}: only PUT starts a delivery",
            cause=method,
        )
    strange = [one for one in seen if one not in {last, silent, *others.values()}]
    # A robot may have other clients: one order that looks like none of ours may be theirs.
    odd = [one for one in strange if _is_of_ours(one)] or (strange if len(strange) > 1 else [])
    judge.check(
        "strict-input/delivery-refused",
        not odd,
        next((one for one in exchanges if one.response.ok), exchanges[-1]),
        "no message for an invalid delivery",
        found=f"{len(odd)} messages, among them {odd[0]}" if odd else "",
    )


def _judge_unwanted(judge: Judge, answer: Exchange, *, came: bool) -> None:
    """Judge a delivery whose Accept excludes all formats: the robot must reject it or deliver it, not both."""
    if answer.response.status == HTTPStatus.NOT_ACCEPTABLE:
        judge.check(_UNDONE, not came, answer, "no message for a delivery that is answered 406")
    elif answer.response.ok:
        judge.check(_DONE, came, answer, "a message for a delivery that is accepted", found="no message")


def _is_of_ours(delivery: Delivery) -> bool:
    """Return whether a delivery may come from one of the invalid requests, of which one value was wrong."""
    same = sum(value == float(sent) for value, sent in zip(delivery[1:], _CORRECT[1:], strict=True))
    return same >= len(_CORRECT) // 2


def _invalid_soap(publishers: SoapService) -> list[Exchange]:
    """Send messages with a bad code, a non-finite value, a missing and a doubled element; return the exchanges."""
    values = dict(zip(Delivery._fields, _CORRECT, strict=True))
    changes: list[dict[str, str | None]] = [
        {"message_code": "5"},
        {"message_code": "abc"},
        {"depot_x": "INF"},
        {"source_y": "NaN"},
        {"destination_x": None},
        {"source_y": "x"},
    ]
    exchanges = [send_delivery(publishers, Delivery(0, 1.5, 2.5, 3.5, 4.5, 5.5, 6.5))]
    for change in changes:
        given = {**values, **change}
        message = request("ExecuteDeliveryRequest", **{name: text for name, text in given.items() if text is not None})
        exchanges.append(call(publishers, message, fresh=True).exchange)
    return exchanges
