"""PUTs whose Accept header excludes all formats: the robot must either reject them with 406 or apply them.

A PUT answered 406 must have no effect, and a PUT answered 2xx must have one (RFC 9110 9.3.4). A missing effect counts
only if the same PUT has the effect in the usual form: a wall, a limit or another client may have kept the robot where
it is. A reading counts only after the settle time and before the velocity may have ended.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

from conformance.api.rest.calls import JSON
from conformance.api.rest.interface import RestInterface
from conformance.observe.clock import poll
from conformance.packs.table1.robot.drive_trace import certain_s
from conformance.packs.table1.robot.geometry import Pose
from conformance.packs.table1.robot.goal import await_goal, goal_body
from conformance.packs.table1.robot.message_shapes import body_of
from conformance.packs.table1.robot.robot import GOAL_PATH, LINEAR, STILL, VELOCITY, Robot, Velocity
from conformance.packs.table1.robot.stopping import bring_to_rest
from conformance.scenarios.scenario import scenario
from conformance.scenarios.stage import Need, Stage
from conformance.transport.exchange import Exchange

# No robot has its responses in this format.
_NO_FORMAT: Final = "image/png"


@dataclass(frozen=True)
class NotAcceptable:
    """A PUT whose Accept header excludes all formats.

    Attributes:
        path: the resource.
        exchange: request and response.
        has_effect: whether an accepted PUT had its effect; None if not accepted, or the usual PUT has no effect either.
    """

    path: str
    exchange: Exchange
    has_effect: bool | None = None


@scenario(needs={Need.REST, Need.MOTION}, stage=Stage.MOTION)
def not_acceptable(api: RestInterface, robot: Robot) -> tuple[NotAcceptable, ...]:
    """PUT velocities and a goal with an Accept header that excludes all formats, at rest."""
    return tuple(_put_each(api, robot))


def put_unacceptable(robot: Robot, path: str, value: dict[str, Any]) -> Exchange:
    """PUT JSON with an Accept header that excludes all formats."""
    fields = (("Content-Type", JSON), ("Accept", _NO_FORMAT))
    return robot.rest.send("PUT", path, headers=fields, body=body_of(value))


def _put_each(api: RestInterface, robot: Robot) -> Iterator[NotAcceptable]:
    fast = robot.share_of_limits(0.6, 0.4)
    straight = Velocity(*fast[:3])
    tried: list[tuple[str, dict[str, Any], Callable[[], bool | None]]] = [
        (VELOCITY, fast.twist, lambda: _velocity_has_effect(api, robot, VELOCITY, fast, fast.twist)),
        (LINEAR, fast.linear, lambda: _velocity_has_effect(api, robot, LINEAR, straight, fast.linear)),
    ]
    here = robot.map_pose()
    if here is not None:
        puts = partial(put_unacceptable, robot, GOAL_PATH), partial(robot.put, GOAL_PATH)
        tried.append((GOAL_PATH, turned_goal(robot, here), lambda: goal_has_effect(api, *puts)))
    for path, value, has_effect in tried:
        exchange = put_unacceptable(robot, path, value)
        effect = None
        if exchange.response.ok:
            bring_to_rest(api)
            effect = has_effect()
        yield NotAcceptable(path, exchange, effect)


def _velocity_has_effect(
    api: RestInterface, robot: Robot, path: str, wanted: Velocity, value: dict[str, Any]
) -> bool | None:
    put = partial(put_unacceptable, robot, path, value)
    return velocity_has_effect(api, wanted, put, partial(robot.put, path, value))


# Function that sends a PUT.
Put = Callable[[], Exchange]
PutGoal = Callable[[dict[str, Any]], Exchange]
# An action that is carried out; returns whether it had its effect, or None if that is not known.
Act = Callable[[], bool | None]
_READINGS: Final = 3  # readings at rest, of different odometry samples, that prove that the robot rests
_STEP_S: Final = 0.02
# Multiple of the settle time in which a velocity has to be reached.
_SETTLED: Final = 1.1
# Turn to a goal with another heading, rad: long enough to be read under way.
_TURN: Final = 2.5
# A robot that has moved by this much towards a goal had that goal, m and rad.
_MOVED_M: Final = 0.2
_MOVED_RAD: Final = 0.3


def velocity_has_effect(api: RestInterface, wanted: Velocity, put: Put, usual: Put) -> bool | None:
    """Return whether a robot at rest moves after an accepted PUT of a velocity. Leaves the robot at rest.

    Args:
        api: the robot's REST interface.
        wanted: the velocity.
        put: sends it in the form under test.
        usual: sends it in the usual form.

    Returns:
        None where it cannot be told: the robot rejects the PUT, does not move after the usual one either, or stops
            before
        it can be read.
    """
    robot = Robot(api)
    if robot.near(wanted, STILL, 3):
        return None
    return _beside(api, lambda: _moves(robot, wanted, put), lambda: _moves(robot, wanted, usual))


def goal_has_effect(api: RestInterface, put: PutGoal, usual: PutGoal) -> bool | None:
    """Return whether the robot shows or follows a goal after an accepted PUT. Leaves the robot at rest.

    Args:
        api: the robot's REST interface.
        put: sends a goal in the form under test.
        usual: sends it in the usual form.

    Returns:
        None where it cannot be told: the robot rejects the PUT, or the goal ends at once also in the usual form.
    """
    robot = Robot(api)
    return _beside(api, lambda: _follows(robot, put), lambda: _follows(robot, usual, _READINGS))


def _beside(api: RestInterface, act: Act, usual: Act) -> bool | None:
    """Return whether an action has its effect; False only if the usual one has it and the action lacks it twice."""
    found = act()
    bring_to_rest(api)
    if found is not False:
        return found
    usually = usual()
    bring_to_rest(api)
    if not usually:
        return None
    found = act()
    bring_to_rest(api)
    return found


def _moves(robot: Robot, wanted: Velocity, put: Put) -> bool | None:
    """PUT a velocity repeatedly; return whether the robot moves, or None if undecided."""
    limits = robot.limits
    hold_s = certain_s(limits.hold_s)
    since = last_sent = math.inf  # since when the velocity holds without a gap; when it was sent last
    counted = -math.inf
    at_rest = 0
    patience = robot.patience(2 * robot.settle_s + (_READINGS + 1) * (robot.sample_s + 4 * robot.usual_s))
    for _ in poll(robot.clock, _STEP_S, lambda: patience.over):
        sent = robot.clock.now()
        if not put().response.ok:
            return None
        answered = robot.clock.now()
        if answered > last_sent + hold_s or since == math.inf:
            since, at_rest = answered, 0  # the velocity may have ended meanwhile, and must be reached again
        last_sent = sent
        requested = robot.clock.now()
        velocity, _ = robot.velocity()
        if velocity is None:
            return None  # the checkers have judged that
        if robot.near(velocity, wanted) or not robot.near(velocity, STILL, 2):
            return True
        settled = since + _SETTLED * limits.settle_s + robot.sample_s
        if requested > max(settled, counted + robot.sample_s) and robot.clock.now() < sent + hold_s:
            counted, at_rest = requested, at_rest + 1
            if at_rest == _READINGS:
                return False
    return None


def turned_goal(robot: Robot, here: Pose) -> dict[str, Any]:
    """Return a goal at the robot's position with another heading, which it reaches by turning on the spot."""
    return goal_body(Pose(here.x, here.y, here.yaw + _TURN), robot.statement.motion.frame, "not acceptable")


def _follows(robot: Robot, put: PutGoal, lasts: int = 1) -> bool | None:
    """PUT a goal; return whether the robot shows it in ``lasts`` readings, or has moved."""
    before = robot.map_pose()
    if before is None:
        return None
    body = turned_goal(robot, before)
    if not put(body).response.ok:
        return None
    goal, problem, _ = await_goal(robot, body)
    if goal is not None and problem:
        return None  # a delivery of the robot's own or another client's
    if not problem:
        return all(robot.goal()[0] is not None for _ in range(lasts - 1))
    here = robot.map_pose()
    if here is None:
        return None
    turned = abs(math.remainder(here.yaw - before.yaw, math.tau))
    return here.distance(before) > _MOVED_M or turned > _MOVED_RAD
