"""Several clients that PUT at the same moment: one goal, different goals, different velocities.

Where the robot does not respond to a request, there is no trace, and the scenario's requirement fails by that.
"""

from collections.abc import Sequence
from http import HTTPStatus
from typing import Any, Final

from conformance.api.rest.interface import RestInterface
from conformance.api.rest.validity import require_valid
from conformance.measures.samples import SEVERAL
from conformance.observe.clock import poll_for
from conformance.packs.table1.robot.delivery import path_of
from conformance.packs.table1.robot.goal import await_goal, await_none, choose_goals, difference, goal_body, is_there
from conformance.packs.table1.robot.goal_trace import ConcurrentGoal, GoalRead
from conformance.packs.table1.robot.message_shapes import body_of
from conformance.packs.table1.robot.motion_map import speeds_of
from conformance.packs.table1.robot.robot import GOAL_PATH, JSON_BODY, Robot
from conformance.scenarios.motion.mapped import MappedDevice, Position
from conformance.scenarios.motion.moves import record_parts
from conformance.scenarios.motion.resting import fastest
from conformance.scenarios.motion.several import of_drivers
from conformance.scenarios.motion.trace import Drive
from conformance.scenarios.scenario import scenario
from conformance.scenarios.stage import Leaves, Need, Stage
from conformance.transport.exchange import Attempt, Exchange, Outgoing, Unanswered
from conformance.transport.parallel import MOST_CLIENTS, is_busy, send_together
from conformance.verdict.effort import Effort

_TRIES: Final = 3  # how often velocities are sent again if the robot shows none of them
_CLIENTS: Final = 4  # concurrent clients
# How long a goal is read after its cancellation, s: _WATCHED_S, and each fifth time _WATCHED_LONGER_S.
_WATCHED_S: Final = 0.03
_WATCHED_LONGER_S: Final = 0.1
_GOAL_STEP_S: Final = 0.02
# Shares of the limits for each client, ahead and turning. A mixture of two clients' velocities equals neither.
_SHARES: Final = ((0.5, -0.5), (-0.5, 0.5)) * 2


@scenario(needs={Need.REST, Need.MOTION})
def concurrent_goal(robot: Robot, effort: Effort) -> tuple[ConcurrentGoal, ...]:
    """PUT one new goal from several clients at the same moment, then cancel it; repeat."""
    pose = choose_goals(robot, 1.5, 1)[0]
    trace: list[ConcurrentGoal] = []
    for turn in range(effort.cases(20)):
        body = goal_body(pose, robot.statement.motion.frame, f"clients {turn}")
        attempts = _put_goals(robot, [body] * _CLIENTS)
        puts = tuple(exchange for exchange in attempts if isinstance(exchange, Exchange) and not is_busy(exchange))
        if all(
            HTTPStatus.BAD_REQUEST <= exchange.response.status < HTTPStatus.INTERNAL_SERVER_ERROR for exchange in puts
        ):
            continue  # the robot refuses this place to every client
        goal, differs, read = await_goal(robot, body)
        if goal is None and is_there(robot, pose):
            trace.append(ConcurrentGoal(puts, None))
            break
        robot.delete_goal()
        await_none(robot)
        trace.append(ConcurrentGoal(puts, GoalRead(read, differs), _after_cancel(robot, body, longer=turn % 5 == 0)))
    return tuple(trace)


def _after_cancel(robot: Robot, body: dict[str, Any], *, longer: bool) -> tuple[GoalRead, ...]:
    """Read the goal for a while after a cancel: a second copy of the cancelled goal would now be active."""
    reads: list[GoalRead] = []
    for _ in poll_for(robot.clock, _GOAL_STEP_S, _WATCHED_LONGER_S if longer else _WATCHED_S):
        goal, exchange = robot.goal()
        reads.append(GoalRead(exchange, "no goal" if goal is None else difference(goal, {"goal": body["goal"]})))
        if not reads[-1].differs:
            break
    return tuple(reads)


@scenario(needs={Need.REST, Need.MOTION})
def concurrent_goals(robot: Robot, effort: Effort) -> tuple[GoalRead, ...]:
    """PUT different goals from several clients at the same moment, and read which one is active; repeat that."""
    poses = choose_goals(robot, 1.5, _CLIENTS)
    reads: list[GoalRead] = []
    for turn in range(effort.cases(20)):
        bodies = [
            goal_body(pose, robot.statement.motion.frame, f"client {number} of {turn}")
            for number, pose in enumerate(poses)
        ]
        attempts = zip(bodies, _put_goals(robot, bodies), strict=True)
        accepted = [body for body, one in attempts if isinstance(one, Exchange) and one.response.ok]
        if not accepted:
            continue
        goal, differs, exchange = await_goal(robot, *accepted)
        if goal is None and any(is_there(robot, pose) for pose in poses):
            break
        reads.append(GoalRead(exchange, differs))
    robot.delete_goal()
    await_none(robot)
    return tuple(reads)


@scenario(needs={Need.REST, Need.MOTION})
def concurrent_velocities(robot: Robot, mapped_robot: MappedDevice, effort: Effort) -> tuple[Drive, ...]:
    """PUT different velocities from several clients at the same moment, and watch which one the robot reaches.

    Without a declared hold time, a robot that rests when its settle time is over may have reached one of them.
    """
    if robot.limits.hold_s is None:
        return ()
    still = dict.fromkeys(mapped_robot.drives.axes, 0.0)
    several = [still | speeds_of(robot.share_of_limits(*shares)) for shares in _SHARES]
    return record_parts(_drive(mapped_robot, several) for _ in range(1 if effort.name == "quick" else 4))


def _drive(mapped: MappedDevice, several: list[Position]) -> Drive:
    """Command velocities at the same moment, and again where the robot does not move: it may have been delayed."""
    for _ in range(_TRIES):
        drive = of_drivers(mapped, several)
        if fastest(drive.under_way[-SEVERAL:], mapped.motion):
            break
    return drive


def _put_goals(robot: Robot, goals: Sequence[dict[str, Any]]) -> list[Attempt]:
    """PUT each goal from its own client, all at the same moment."""
    return send_together([[(robot.rest, Outgoing("PUT", GOAL_PATH, JSON_BODY, body_of(goal))) for goal in goals]])[0]


_TURNS: Final = 12
_COORDINATES: Final = ("1.5", "2.5", "3.5", "4.5", "5.5", "6.5")
_NO_CODE: Final = "none"


@scenario(needs={Need.REST, Need.MOTION}, leaves=Leaves.UNTOUCHED, stage=Stage.ACTING)
def concurrent_deliveries(api: RestInterface) -> tuple[tuple[bool, Exchange], ...]:
    """Send valid and invalid deliveries at once; record whether each was valid, and its exchange.

    Empty where the robot rejects a valid delivery alone, or accepts an invalid one; and at quick, where no mutant was
    told apart by it that other requests at once did not tell apart as well.
    """
    if api.run.effort.name == "quick":
        return ()
    paths = [path_of(code, *_COORDINATES) for code in ("3", _NO_CODE)]
    require_valid(api.run.contract, "PUT", paths[0])
    # Other checks judge each request alone.
    taken, refused = (api.client.send("PUT", path).response for path in paths)
    if not taken.ok or refused.ok:
        return ()
    turn = [(api.client, Outgoing("PUT", path)) for path in paths] * (MOST_CLIENTS // len(paths))
    return tuple(
        (request.target == paths[0], attempt)
        for came in send_together([turn] * api.run.effort.cases(_TURNS))
        for (_, request), attempt in zip(turn, came, strict=True)
        if not isinstance(attempt, Unanswered) and not is_busy(attempt)
    )
