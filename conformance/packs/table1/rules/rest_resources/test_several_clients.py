"""Several clients put at one moment: what is then there is what one of them asked for, and one goal is one goal."""

import itertools
import math
import time
from collections.abc import Sequence
from typing import Any, Final

import pytest

from conformance.packs.table1.robot.drive_rules import ECHO
from conformance.packs.table1.robot.goal import NEW, REPEATED, arrived, await_goal, await_none, difference, goal_body
from conformance.packs.table1.robot.goals import choose_goals
from conformance.packs.table1.robot.message_shapes import TWIST, body_of, read_as
from conformance.packs.table1.robot.robot import GOAL_PATH, JSON_BODY, STILL, VELOCITY, Robot, Velocity
from conformance.transport.exchange import Attempt, Exchange
from conformance.transport.parallel import Outgoing, is_busy, send_together
from conformance.verdict.effort import Effort
from conformance.verdict.evidence import Judge

pytestmark = [pytest.mark.phase("motion"), pytest.mark.needs("rest"), pytest.mark.motion]
_PUTS: Final = "rest-resources/concurrent-puts"
_GOAL: Final = "rest-resources/goal-concurrent"
# How often velocities are put anew that ended before an answer told of them, or of which the robot had none in time.
_TRIES: Final = 3
_CLIENTS: Final = 4
# How long after it was cancelled a goal is looked for, s.
_WATCHED_S: Final = 0.1
# Shares of the limits, ahead and turning: no velocity has one of its components in common with another.
_SHARES: Final = ((0.5, -0.5), (-0.5, 0.5), (0.17, 0.17))
# What two velocities have in common within this many tolerances is the same.
_NEAR: Final = 1.5


def _put_together(robot: Robot, path: str, values: Sequence[dict[str, Any]]) -> list[Attempt]:
    return send_together([[Outgoing(robot.rest, "PUT", path, JSON_BODY, body_of(value)) for value in values]])[0]


@pytest.mark.requirement(_GOAL)
def test_one_goal_put_by_many(robot: Robot, judge: Judge, effort: Effort) -> None:
    """One client has put a new goal and the others have repeated it; cancelled, none is left."""
    pose = choose_goals(robot, 1.5, 1)[0]
    for turn in range(effort.cases(20)):
        body = goal_body(pose, robot.statement.motion.frame, f"clients {turn}")
        came = [one for one in _put_together(robot, GOAL_PATH, [body] * _CLIENTS) if isinstance(one, Exchange)]
        came = [one for one in came if not is_busy(one)]
        statuses = sorted(one.response.status for one in came)
        if not came or all(400 <= status < 500 for status in statuses):
            continue  # a place that the robot refuses is refused to all
        judge.check(
            _GOAL,
            statuses.count(201) <= 1 and not NEW.isdisjoint(statuses) and set(statuses) <= NEW | REPEATED,
            next((one for one in came if one.response.status not in NEW | REPEATED), came[0]),
            "one 201 or 202, and 200, 202 or 204 for the others that put the same new goal at that moment",
            found=f"statuses {statuses}",
        )
        goal, problem, read = await_goal(robot, body)
        if goal is None and arrived(robot, pose):
            return
        judge.check(_GOAL, not problem, read, "the goal that all have put", found=problem)
        robot.delete_goal()
        await_none(robot)
        _judge_gone(robot, judge, body)


def _judge_gone(robot: Robot, judge: Judge, body: dict[str, Any]) -> None:
    """Judge that a goal that was cancelled once does not go on as another one; a goal of the robot's own may follow."""
    until = time.monotonic() + _WATCHED_S
    while time.monotonic() < until:
        goal, read = robot.goal()
        again = goal is not None and not difference(goal, {"goal": body["goal"]})
        if not judge.check(_GOAL, not again, read, "one goal, gone once it is cancelled", found="the goal once more"):
            return
        time.sleep(0.02)


@pytest.mark.requirement(_PUTS)
def test_goals_of_many(robot: Robot, judge: Judge, effort: Effort) -> None:
    """Of different goals at one moment, one is current then: id and pose are the same client's."""
    poses = choose_goals(robot, 1.5, _CLIENTS)
    for turn in range(effort.cases(20)):
        bodies = [
            goal_body(pose, robot.statement.motion.frame, f"client {number} of {turn}")
            for number, pose in enumerate(poses)
        ]
        came = _put_together(robot, GOAL_PATH, bodies)
        taken = [body for body, one in zip(bodies, came, strict=True) if isinstance(one, Exchange) and one.response.ok]
        if not taken:
            continue
        goal, problem, read = _await_any(robot, taken)
        if goal is None and any(arrived(robot, pose) for pose in poses):
            break
        judge.check(_PUTS, not problem, read, "the goal of one client, with its id and its pose", found=problem)
    robot.delete_goal()
    await_none(robot)


def _await_any(robot: Robot, bodies: list[dict[str, Any]]) -> tuple[Any, str, Exchange]:
    """Read the active goal until it is one of those, for as long as commands may take; see await_goal()."""
    patience = robot.patience(robot.settle_s)
    while True:
        goal, exchange = robot.goal()
        problem = exchange.came if goal is None else min((difference(goal, body) for body in bodies), key=len)
        if not problem or patience.over:
            return goal, problem, exchange
        time.sleep(0.02)


@pytest.mark.requirement(_PUTS)
def test_velocities_of_many(robot: Robot, judge: Judge, effort: Effort) -> None:
    """Of different velocities at one moment, the robot reaches that of one client, in all components."""
    velocities = [robot.share_of_limits(*shares) for shares in _SHARES]
    for _ in range(1 if effort.name == "quick" else 4):
        for turn in range(1, _TRIES + 1):
            sent = time.monotonic()
            came = _put_together(robot, VELOCITY, [velocity.twist for velocity in velocities])
            answered = time.monotonic()
            taken = []
            for velocity, one in zip(velocities, came, strict=True):
                if isinstance(one, Exchange) and one.response.ok:
                    taken.append(velocity)
                    _judge_accepted(judge, velocity, one)
            decided = not taken or _judge_reached(robot, judge, taken, (sent, answered), last=turn == _TRIES)
            robot.put_velocity(STILL)
            if decided:
                break
        else:
            judge.note(_PUTS, "a velocity that several clients put ended before it was seen to be reached")


def _judge_accepted(judge: Judge, velocity: Velocity, exchange: Exchange) -> None:
    """Judge that the velocity in an answer, where there is one, is the one that was put."""
    twist, problem = read_as(exchange.response, TWIST)
    if not problem:
        said = Velocity.of(twist)
        same = all(abs(one - other) <= ECHO for one, other in zip(said, velocity, strict=True))
        judge.check(_PUTS, same, exchange, f"the accepted velocity, {velocity}", found=f"{said}")


def _judge_reached(robot: Robot, judge: Judge, taken: list[Velocity], when: tuple[float, float], *, last: bool) -> bool:
    """Judge what the robot reaches before it may end by itself, as nobody knows which of the velocities to renew.

    The one that it takes last it may have had as soon as it was sent, however late another one is answered. The linear
    part of one client beside the angular one of another is a failure at once; a velocity of nobody may be that of a
    robot that was held up.

    Args:
        robot: that was at rest.
        judge: is told.
        taken: the velocities that were accepted.
        when: they were sent, and all of them answered, s of the monotonic clock.
        last: whether a robot that reaches none in time is judged by that, and not tried again.

    Returns:
        Whether that could be judged: it was reached, or was not in an answer that came between settling and the end.
    """
    sent, answered = when
    limits = robot.limits
    settled = answered + 1.1 * limits.settle_s
    ends = math.inf if limits.hold_s is None else sent + 0.95 * limits.hold_s
    until = min(answered + robot.settle_s, ends)
    expected = " or ".join(f"({velocity})" for velocity in taken)
    missed: tuple[Velocity, Exchange] | None = None
    while True:
        asked = time.monotonic()
        measured, exchange = robot.velocity()
        if measured is None:
            return True  # which the observers have judged
        if any(robot.near(measured, velocity, _NEAR) for velocity in taken):
            return judge.check(_PUTS, True, exchange, f"the velocity of one client: {expected}")
        now = time.monotonic()
        if asked >= settled and now <= ends:
            missed = measured, exchange
        if now > until:
            break
        time.sleep(0.01)
    if missed is None or not (last or _is_mixture(robot, missed[0], taken)):
        return False
    judge.check(_PUTS, False, missed[1], f"the velocity of one client: {expected}", found=f"{missed[0]}")
    return True


def _is_mixture(robot: Robot, measured: Velocity, taken: list[Velocity]) -> bool:
    """Whether a velocity has the linear part of one, and the angular part of another."""
    mixtures = (Velocity(*one[:3], *other[3:]) for one, other in itertools.permutations(taken, 2))
    return any(robot.near(measured, mixture, _NEAR) for mixture in mixtures)
