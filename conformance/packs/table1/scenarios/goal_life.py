"""The life of a goal: sent, read, repeated, contradicted, replaced by another one, and cancelled."""

from dataclasses import dataclass, field, replace
from http import HTTPStatus
from typing import Any, Final

from conformance.observe.clock import poll_for
from conformance.packs.table1.robot.drive import Drive
from conformance.packs.table1.robot.geometry import Pose
from conformance.packs.table1.robot.goal import (
    NEW,
    RATHER_XML,
    REPEATED,
    await_goal,
    await_none,
    choose_goals,
    difference,
    goal_body,
    is_there,
    meanwhile,
    put_goal,
)
from conformance.packs.table1.robot.goal_trace import Cancelled, GoalLife, NoGoal, Put
from conformance.packs.table1.robot.robot import JSON_BODY, LINEAR, STILL, VELOCITY, Robot, Velocity
from conformance.scenarios.scenario import partial_trace, scenario
from conformance.scenarios.stage import Leaves, Need, Stage
from conformance.transport.exchange import Exchange

ID: Final = "goal 1/\u00e9\u4e2d?&\"'<>\\ of the suite"
_CANCELING: Final = 3
_LOOK_S: Final = 0.1  # after a slower read, a velocity may end before it is read, s
_STEP_S: Final = 0.02  # pause between two reads, s
_TIMES: Final = 3
# A heading that differs from a goal's, rad.
_OTHER_RAD: Final = 1.0


@scenario(needs={Need.REST, Need.MOTION}, leaves=Leaves.AT_REST, stage=Stage.MOTION)
def goal_life(robot: Robot) -> GoalLife:
    """Do all that clients do with a goal, put another in its place, and cancel that."""
    player = _Player(robot)
    with partial_trace(lambda: player.life):
        player.play()
    return player.life


@dataclass
class _Player:
    """One play of the scenario."""

    robot: Robot
    life: GoalLife = field(default_factory=GoalLife)

    def play(self) -> None:
        """Play the scenario."""
        robot = self.robot
        self._no_goal()
        there, back = choose_goals(robot, 1.5, 2)
        frame = robot.statement.motion.frame
        # With all optional members; the second goal leaves them out.
        first = goal_body(there, frame, ID)
        first["header"] = {"stamp": {"sec": 12, "nanosec": 34}, "frame_id": frame}
        first["goal_id"]["stamp"] = {"sec": 56, "nanosec": 78}
        # An old velocity must not return when the goal is cancelled.
        robot.put_velocity(slow_turn(robot))
        put = put_new(robot, first, there)
        self.life = replace(self.life, first=put)
        if put.exchange.response.status not in NEW or (put.differs and not put.ended):
            return
        stamps = tuple(goal["goal_id"]["stamp"] for goal in (robot.goal()[0], robot.goal()[0]) if goal is not None)
        self.life = replace(self.life, stamps=stamps)
        if not self._repeat(first, there):
            meanwhile(robot, ID, lambda body, pose, _: self._repeat(body, pose))
        if not self._put_back(there):
            meanwhile(robot, ID, lambda _, pose, __: self._put_back(pose))
        if not self._contradict(first, goal_body(back, frame, ID), there):
            meanwhile(robot, ID, lambda body, pose, other: self._contradict(body, other, pose))
        if robot.can_move(5):
            self._contradict(first, goal_body(there._replace(yaw=there.yaw + _OTHER_RAD), frame, ID), there)
        self._velocity_meanwhile(first, there)
        if robot.goal()[0] is None:
            put_goal(robot, first)  # a velocity may have ended the goal, so send it again
        second = goal_body(back, frame)
        second["goal"]["target_pose"]["header"]["stamp"] = {"sec": 0, "nanosec": 0}
        self._displace(second, back)
        self.life = replace(self.life, reused=put_new(robot, goal_body(back, frame, ID), back))
        robot.delete_goal()
        await_none(robot)
        self.life = replace(self.life, again=put_new(robot, goal_body(back, frame, ID), back))
        await_motion(robot)
        if not self._cancel(back):
            meanwhile(robot, ID, lambda _, pose, __: self._cancel(pose))

    def _no_goal(self) -> None:
        """Read and cancel the goal while the robot has none."""
        for _ in range(_TIMES):
            none = NoGoal(await_none(self.robot), self.robot.delete_goal())
            self.life = replace(self.life, none=(*self.life.none, none))

    def _put_beside(self, body: dict[str, Any], active: dict[str, Any]) -> tuple[Put, bool]:
        """PUT a goal under the active goal's id; return the record, and whether the robot now shows no goal."""
        exchange = put_goal(self.robot, body)
        goal, read = self.robot.goal()
        differs = read.came if goal is None else difference(goal, active)
        return Put(exchange, body, goal, read, differs, ended=False), goal is None

    def _repeat(self, body: dict[str, Any], there: Pose) -> bool:
        """PUT the active goal again; return whether it was still active: at the place ``there`` it may have ended."""
        for turn in range(_TIMES):
            put, none = self._put_beside(body, body)
            if none and is_there(self.robot, there):
                return turn > 0
            self.life = replace(self.life, repeated=(*self.life.repeated, put))
        return True

    def _put_back(self, there: Pose) -> bool:
        """PUT the active goal as GET shows it; return whether it was still active."""
        shown, _ = self.robot.goal()
        if shown is None:
            return False
        put, none = self._put_beside(shown, shown)
        if none and is_there(self.robot, there):
            return False
        self.life = replace(self.life, put_back=(*self.life.put_back, put))
        return True

    def _contradict(self, body: dict[str, Any], other: dict[str, Any], there: Pose) -> bool:
        """PUT another pose under the active goal's id; return whether the goal was still active: it may have ended."""
        put, none = self._put_beside(other, body)
        if (put.exchange.response.status != HTTPStatus.CONFLICT or none) and is_there(self.robot, there):
            return False
        self.life = replace(self.life, contradicted=(*self.life.contradicted, put))
        return True

    def _velocity_meanwhile(self, body: dict[str, Any], there: Pose) -> None:
        """Command velocities during a goal: an invalid one, one with both parts, and a linear one."""
        robot, drive = self.robot, Drive(self.robot)
        self._keeps(robot.rest.send("PUT", VELOCITY, headers=JSON_BODY, body=b"{}"), body, there)
        slow, sent = slow_turn(robot), robot.clock.now()
        exchange = robot.put_velocity(slow)
        self._keeps(exchange, body, there)
        if exchange.response.ok and drive.look_s < _LOOK_S:
            drive.note_command(slow, sent, exchange)
            drive.reach(slow, "rest-resources/velocity-goal")
        linear = robot.put(LINEAR, STILL.linear)
        if not exchange.response.ok:  # the robot may have ended the goal because of the request
            self._keeps(linear, body, there)
        self.life = replace(self.life, velocity=exchange, drive=drive.trace, linear=linear)

    def _keeps(self, exchange: Exchange, body: dict[str, Any], there: Pose) -> None:
        """Record the goal after a velocity that the robot refused, unless a goal was not active or may have ended."""
        before = any(put.shown is not None for put in self.life.contradicted[-1:])
        if not before or not HTTPStatus.BAD_REQUEST <= exchange.response.status < HTTPStatus.INTERNAL_SERVER_ERROR:
            return
        goal, read = self.robot.goal()
        if goal is None and is_there(self.robot, there):
            return
        put = Put(exchange, body, goal, read, read.came if goal is None else difference(goal, body), ended=False)
        self.life = replace(self.life, kept=(*self.life.kept, put))

    def _displace(self, body: dict[str, Any], pose: Pose) -> None:
        """PUT another goal, without an id, while one is active."""
        began = self.robot.clock.now()
        second = put_new(self.robot, body, pose)
        odometry = self.robot.odometry()
        took_s = self.robot.clock.now() - began
        renamed = None
        if second.exchange.response.status not in NEW | REPEATED:
            # Find out whether the robot refuses the missing id, or any other goal.
            named = put_goal(self.robot, body | {"goal_id": {"id": "another"}})
            renamed = named.response.status in NEW | REPEATED
        now_s = None if odometry is None else odometry.stamp
        self.life = replace(self.life, second=second, renamed=renamed, now_s=now_s, took_s=took_s)

    def _cancel(self, pose: Pose) -> bool:
        """Cancel the active goal; return whether there was one, which may have ended at its ``pose``.

        A response that is late counts as none: a stop of the network looks like a late stop of the robot.
        """
        cancelled = cancel(self.robot)
        self.life = replace(self.life, cancels=(*self.life.cancels, cancelled.exchange))
        if cancelled.exchange.response.status == HTTPStatus.NOT_FOUND and is_there(self.robot, pose):
            return False
        self.life = replace(self.life, cancelled=(*self.life.cancelled, cancelled))
        return not cancelled.late


def put_new(robot: Robot, body: dict[str, Any], pose: Pose) -> Put:
    """PUT a new goal, and wait until the robot shows it."""
    exchange = put_goal(robot, body)
    if exchange.response.status not in NEW | REPEATED:
        return Put(exchange, body, None, exchange, "", ended=False)
    goal, problem, read = await_goal(robot, body)
    return Put(exchange, body, goal, read, problem, ended=goal is None and is_there(robot, pose))


def cancel(robot: Robot) -> Cancelled:
    """Cancel the active goal, and wait until the robot has no goal and stands still."""
    drive = Drive(robot)
    exchange = robot.delete_goal(RATHER_XML)
    answered = robot.clock.now()
    late = robot.is_late(exchange)
    if exchange.response.status == HTTPStatus.NOT_FOUND:
        return Cancelled(exchange, exchange, gone=True, drive=drive.trace, late=late)
    goal, read = robot.goal()
    # 202 says that the goal will be cancelled; status.code has a value for that.
    accepted = exchange.response.status == HTTPStatus.ACCEPTED
    gone = goal is None or accepted or goal.get("status", {}).get("code") == _CANCELING
    if gone:
        read = await_none(robot)
        gone = read.response.status == HTTPStatus.NOT_FOUND
    drive.reach(STILL, "safety/cancel", since=robot.arrived_by(exchange, answered))
    rests = [turn.velocity is None or robot.near(turn.velocity, STILL) for turn in drive.trace.turns]
    if all(rests) or not rests[-1]:
        # Wait for the settle time: the robot may still begin what the goal had commanded, or turn the other way.
        robot.clock.sleep(answered + robot.settle_s - robot.clock.now())
    return Cancelled(exchange, read, gone, drive.trace, late)


def slow_turn(robot: Robot) -> Velocity:
    """Return a slow turn; zero where the robot cannot turn."""
    return robot.share_of_limits(0.0, 0.1)


def await_motion(robot: Robot) -> None:
    """Wait shortly until the robot moves, so that cancelling has an effect."""
    for _ in poll_for(robot.clock, _STEP_S, min(1.0, robot.settle_s)):
        velocity, _ = robot.velocity()
        if velocity is None or not robot.near(velocity, STILL, 3):
            return
