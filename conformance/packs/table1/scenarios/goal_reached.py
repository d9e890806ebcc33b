"""Goals that the robot reaches, with usual and random ids and poses; and goals that a robot cannot take."""

import itertools
import math
import random
from dataclasses import dataclass, field, replace
from http import HTTPStatus
from typing import Any, Final

from hypothesis import strategies as st

from conformance.api.soap.callable_services import SoapServices
from conformance.api.soap.service import SoapService
from conformance.measures.samples import FARTHEST, SEVERAL
from conformance.observe.clock import poll
from conformance.packs.table1.robot import soap_services
from conformance.packs.table1.robot.drive import Drive
from conformance.packs.table1.robot.drive_trace import Command
from conformance.packs.table1.robot.geometry import Pose, middle_of, wrapped
from conformance.packs.table1.robot.goal import (
    NEW,
    REPEATED,
    await_goal,
    await_none,
    choose_goals,
    difference,
    goal_body,
    is_there,
    put_goal,
)
from conformance.packs.table1.robot.goal_trace import FarGoal, GoalReached, GoalRead, Put, RefusedGoals, SpecialGoal
from conformance.packs.table1.robot.message_shapes import ODOMETRY
from conformance.packs.table1.robot.plan import ask, ask_over_soap, start_of
from conformance.packs.table1.robot.robot import ABOUT, POSE, Robot
from conformance.packs.table1.scenarios.goal_life import put_new
from conformance.packs.table1.scenarios.plans import is_refused
from conformance.scenarios.scenario import NotPossibleError, partial_trace, scenario
from conformance.scenarios.stage import Need, Stage
from conformance.transport.exchange import Exchange
from conformance.verdict.effort import Effort
from conformance.verdict.evidence import RefutedError
from conformance.verdict.explorer import Explorer
from conformance.verdict.run import Run

_LONGEST: Final = 255
# No control characters, halves of surrogate pairs or non-characters: XML, which a robot may send as well, has no way
# to write them.
_CHARACTERS: Final = st.characters(exclude_categories=("Cc", "Cs", "Cn", "Co"), max_codepoint=0xFFFD)
_KNOWN: Final = (
    "a" * _LONGEST,
    "\u00e9" * _LONGEST,
    "0",
    "a/b?c=d&e#f%20",
    "<id>]]>&amp;\"'",
    "\u6771\u4eac \U0001f916",
    "null",
    " with spaces ",
    "A",
)
# Ids that a robot confuses if it ignores case or compares only the first characters.
_ALIKE: Final = ("goal", "Goal", "a" * 64 + "1", "a" * 64 + "2")
_READINGS: Final = 3
# One goal in this many is sent just after the one before was cancelled, unless their ids are similar.
_AFTER_DELETE: Final = 3


@scenario(needs={Need.REST, Need.MOTION})
def goal_ids(robot: Robot, explore: Explorer) -> tuple[Put, ...]:
    """PUT goals with random ids, and read each until the robot shows it."""
    goals = itertools.cycle(choose_goals(robot, 1.5, 2))
    puts: list[Put] = []

    def put(id_: str) -> None:
        last = puts[-1] if puts else None
        if last is not None and ((last.differs and not last.ended) or last.body["goal_id"]["id"] == id_):
            return  # repeating this for each case shows nothing more; an id with another pose is a conflict
        pose = next(goals)
        if len(puts) > len(_ALIKE) and len(puts) % _AFTER_DELETE == 0:
            robot.delete_goal()
        puts.append(put_new(robot, goal_body(pose, robot.statement.motion.frame, id_), pose))
        if puts[-1].exchange.response.status not in NEW:
            raise RefutedError  # so that Hypothesis looks for a simpler id with the same response

    with partial_trace(lambda: tuple(puts)):
        # Even at little effort: in UTF-8 the id is twice as long.
        explore(st.just("\u00e9" * _LONGEST), put, cases=1)
        for id_ in _ALIKE:
            explore(st.just(id_), put, cases=1)
        explore(st.one_of(st.sampled_from(_KNOWN), st.text(_CHARACTERS, min_size=1, max_size=_LONGEST)), put, cases=40)
        robot.delete_goal()
        await_none(robot)
    return tuple(puts)


@scenario(needs={Need.REST, Need.MOTION})
def goal_poses(robot: Robot, explore: Explorer) -> tuple[GoalRead, ...]:
    """PUT goals with random poses, and read each several times."""
    goals = choose_goals(robot, 1.5, 2)
    numbers = itertools.count()
    reads: list[GoalRead] = []

    def put(case: tuple[int, float, float, float]) -> None:
        if reads and reads[-1].differs:
            return
        which, shift, yaw, length = case
        pose = goals[which]._replace(x=goals[which].x + shift, yaw=yaw)
        body = goal_body(pose, robot.statement.motion.frame, f"pose {next(numbers)}", length=length)
        if is_refused(put_goal(robot, body)):
            return  # a planner with another tolerance may not know the obstacle there
        goal, differs, read = await_goal(robot, body)
        for _ in range(_READINGS):
            if goal is None and is_there(robot, pose):
                return
            reads.append(GoalRead(read, differs))
            goal, read = robot.goal()
            differs = read.came if goal is None else difference(goal, body)

    lengths = st.sampled_from((1.0, 1.0005, 0.9995))
    cases = st.tuples(st.integers(0, 1), st.floats(-0.1, 0.1), st.floats(-3.1, 3.1), lengths)
    with partial_trace(lambda: tuple(reads)):
        explore(cases, put, cases=20)
        robot.delete_goal()
        await_none(robot)
    return tuple(reads)


# Time in which a robot may search a way and try its recoveries before it ends the goal (contract.md#goals), s.
_GIVES_UP_S: Final = 60.0
_FAR: Final = (Pose(1e6, 1e6, 0.0), Pose(-1e6, 0.0, 1.0), Pose(1e300, -1e300, 0.0))
_NOT_UNIT: Final = (0.0, 0.5, 0.99, 0.9975, 1.0025, 1.005, 1.009, 1.01, 2.0, 1e200)
_UNIT: Final = (0.9991, 1.0009)
_UNKNOWN_FRAMES: Final = ("no_such_frame", "map2")


@scenario(needs={Need.REST, Need.MOTION})
def refused_goals(robot: Robot) -> RefusedGoals:
    """Put goals outside the map, in unknown frames, and with quaternions of many lengths."""
    (near,) = choose_goals(robot, 1.0, 1)
    player = _Player(robot)
    with partial_trace(lambda: player.goals):
        player.play(near)
    return player.goals


@dataclass
class _Player:
    """One play of the scenario."""

    robot: Robot
    goals: RefusedGoals = field(default_factory=RefusedGoals)

    def play(self, near: Pose) -> None:
        """Play the scenario with a pose that the robot can reach."""
        robot, frame = self.robot, self.robot.statement.motion.frame
        for length in _NOT_UNIT:
            put = self._put_invalid(goal_body(near, frame, length=length), f"a quaternion of length {length:g}")
            self.goals = replace(self.goals, not_unit=(*self.goals.not_unit, put))
        for length in _UNIT:
            exchange = put_goal(robot, goal_body(near, frame, length=length))
            put = SpecialGoal(f"a quaternion of length {length:g}", exchange)
            self.goals = replace(self.goals, unit=(*self.goals.unit, put))
        robot.delete_goal()
        await_none(robot)
        for unknown in _UNKNOWN_FRAMES:
            if unknown != frame:
                put = self._put_invalid(goal_body(near, unknown), f"the unknown frame {unknown!r}")
                self.goals = replace(self.goals, unknown_frames=(*self.goals.unknown_frames, put))
        # Send all of them now: if the robot stops responding, their requirement has failed.
        self.goals = replace(self.goals, far=self._put_far(frame))

    def _put_invalid(self, body: dict[str, Any], special: str) -> SpecialGoal:
        """PUT an invalid goal, and cancel it if the robot accepts it."""
        exchange = put_goal(self.robot, body)
        if exchange.response.status < HTTPStatus.BAD_REQUEST:
            self.robot.delete_goal()
        return SpecialGoal(special, exchange)

    def _put_far(self, frame: str) -> tuple[FarGoal, ...]:
        """PUT goals outside every map, until one stays active."""
        far: list[FarGoal] = []
        for pose in _FAR:
            exchange, read = put_goal(self.robot, goal_body(pose, frame)), None
            if exchange.response.status in NEW | REPEATED:
                read = await_none(self.robot, _GIVES_UP_S)
            far.append(FarGoal(exchange, read, _GIVES_UP_S))
            if read is not None and read.response.status != HTTPStatus.NOT_FOUND:
                self.robot.delete_goal()
                break
        return tuple(far)


# How long the suite waits for a robot that comes nearer, at 0.01 m/s and with obstacles, s.
_LONGEST_S: Final = 120.0
# Distance of a goal, m, or twice the tolerance: a goal given up on the way must not count as reached.
_AWAY_M: Final = 0.6
# Distance that the robot must have covered, if the goal is farther away than this plus the tolerance, m.
_MOVED_M: Final = 0.15
_TURN_RAD: Final = 0.6  # difference between a goal's heading and the way there, rad, or twice the tolerance
_DETOUR: Final = 1.3
_ASIDE_RAD: Final = 2.0  # another heading at the goal, rad
_LOOKED_S: Final = 1.0  # how long the robot is watched, s
_STEP_S: Final = 0.05
_DISPLACED: Final = "displaced"
_REACHED: Final = "reached"
# Least progress: _NEARER_M of the position, m, and _TURNED_RAD of the heading, rad.
_NEARER_M: Final = 0.02
_TURNED_RAD: Final = 0.05


@scenario(needs={Need.REST, Need.MOTION}, stage=Stage.DRIVE)
def goal_reached(robot: Robot, run: Run, soap: SoapServices, _import_early: None) -> GoalReached:
    """PUT a goal nearby, wait until the robot is there, and PUT the same goal again.

    A robot that goes on with another client's goal, for example a delivery that has waited, is sent once more.
    """
    trace = _send_goal(robot, soap.subscribers, run.effort, run.seed)
    return _send_goal(robot, soap.subscribers, run.effort, run.seed) if trace.other else trace


def _send_goal(robot: Robot, subscribers: SoapService | None, effort: Effort, seed: int) -> GoalReached:
    """Return the record of one goal."""
    here = robot.map_pose()
    if here is None:
        raise NotPossibleError("the robot's pose cannot be read")
    there, other = choose_goals(robot, max(_AWAY_M, 2 * robot.limits.arrival[0]), 2)
    if effort.name != "quick":
        there = _turn_goal(robot, here, there, random.Random(f"{seed}/heading"))  # noqa: S311 - no secret
    if subscribers is not None:
        ask_over_soap(robot, subscribers, there)  # to notice later a plan that always starts at this place
    before = _turning_before(robot, effort)
    # Cancelled, because a robot with waiting deliveries then drops them and does not start them between two drives.
    put_goal(robot, goal_body(other, robot.statement.motion.frame, "cancelled"))
    robot.delete_goal()
    # Replace this goal at once; the robot must not return to it after it has arrived.
    put_goal(robot, goal_body(other, robot.statement.motion.frame, _DISPLACED))
    body, put = _put(robot, there)
    trace = GoalReached(put, there)
    if put.response.status not in NEW:
        return trace
    if subscribers is not None:
        soap_services.ask(subscribers, "GetGoal")  # to notice when the goal has ended that SOAP keeps this old goal
    way = _Way(robot, subscribers, Drive(robot), trace)
    with partial_trace(lambda: way.record):
        way.drive_to(there, here)
        motion = robot.statement.motion
        turns = effort.name != "quick" and robot.can_move(5) and motion.turns_on_the_spot
        way.look_back(here, before, body, turns=turns)
    return way.record


def _turn_goal(robot: Robot, here: Pose, there: Pose, chance: random.Random) -> Pose:
    """Return a goal with another heading than the way there, if the robot has a plan to it that is hardly longer."""
    if not robot.can_move(5):
        return there
    ahead = math.atan2(there.y - here.y, there.x - here.x)
    turn = chance.uniform(min(max(_TURN_RAD, 2 * robot.limits.arrival[1]), math.pi), math.pi)
    turned = Pose(there.x, there.y, wrapped(ahead + chance.choice((-turn, turn))))
    _, plan, _ = ask(robot, turned)
    return turned if plan is not None and plan.length <= _DETOUR * here.distance(there) + 0.1 else there


def _turning_before(robot: Robot, effort: Effort) -> Command | None:
    """Command a velocity just before the goal; return None if that shows nothing or takes too much time."""
    limits = robot.limits
    turning = robot.share_of_limits(0.0, 0.4)
    if effort.name == "quick" or limits.hold_s is None:
        return None
    if turning.angular_z < 4 * limits.rest(ABOUT):
        return None
    sent = robot.clock.now()
    exchange = robot.put_velocity(turning)
    return Command(turning, sent, robot.clock.now(), exchange) if exchange.response.ok else None


def _put(robot: Robot, there: Pose) -> tuple[dict[str, Any], Exchange]:
    """PUT a goal, in the odometry's frame if the statement declares two frames and the robot accepts that."""
    odometry, _ = robot.read(POSE, ODOMETRY)
    if odometry is not None and any(robot.statement.motion.odom_to_map):
        body = goal_body(robot.in_odometry(there), odometry["header"]["frame_id"], _REACHED)
        exchange = put_goal(robot, body)
        if exchange.response.status in NEW:
            return body, exchange
    body = goal_body(there, robot.statement.motion.frame, _REACHED)
    return body, put_goal(robot, body)


def _with_pose(trace: GoalReached, here: Pose) -> GoalReached:
    """Return the record with the robot's last pose."""
    there = trace.there or here
    return replace(trace, here=here, left_m=here.distance(there), off_rad=wrapped(here.yaw - there.yaw))


@dataclass
class _Way:
    """The robot's way to its goal."""

    robot: Robot
    subscribers: SoapService | None
    drive: Drive
    trace: GoalReached

    @property
    def record(self) -> GoalReached:
        """Return the record so far."""
        return replace(self.trace, drive=self.drive.whole)

    @property
    def _turned_rad(self) -> float:
        """Return by how much a heading has to change to count as progress, rad."""
        return max(_TURNED_RAD, 2 * FARTHEST * self.robot.limits.noise.heading_rad)

    def drive_to(self, there: Pose, start: Pose) -> None:
        """Watch until the goal has ended, or the robot makes no progress."""
        robot, drive, clock = self.robot, self.drive, self.drive.clock
        limits, longest_s = robot.limits, max(_LONGEST_S, 2 * robot.limits.goal_s)
        turned_rad = self._turned_rad
        reached_m, reached_rad = limits.arrival
        began = progress = clock.now()
        nearest, yaw, here = start.distance(there), start.yaw, start
        while True:
            drive.look()
            goal, exchange = robot.goal()
            if goal is None and exchange.response.status != HTTPStatus.NOT_FOUND:
                # A single response that is neither the goal nor "no goal" does not end the wait.
                goal, exchange = robot.goal()
            if drive.trace.odometry:
                here = robot.in_map(drive.trace.odometry[-1].pose)
            now = clock.now()
            if here.distance(there) < nearest - _NEARER_M or abs(wrapped(here.yaw - yaw)) > turned_rad:
                progress, nearest, yaw = now, min(nearest, here.distance(there)), here.yaw
            # A robot that makes deliveries may start another client's as soon as it has arrived.
            other = goal is not None and goal["goal_id"]["id"] not in {_DISPLACED, _REACHED}
            if goal is None or other or now > progress + limits.goal_s or now > began + longest_s:
                break
        driven = drive.whole
        moved = max(0.0, min(_MOVED_M, start.distance(there) - reached_m))
        trace = replace(self.trace, has_to_m=moved, reached_m=reached_m)
        if robot.can_move(5):
            trace = replace(trace, reached_rad=reached_rad)
        trace = _with_pose(trace, here)
        if other:
            robot.delete_goal()
        elif not trace.is_near or start.distance(here) <= moved:
            # The robot may still be coming to rest. One sample may be wrong, so use those of a second.
            drive.keep(robot.settle_s)
            first = len(drive.trace.odometry)
            drive.keep(_LOOKED_S)
            here = middle_of([robot.in_map(odometry.pose) for odometry in drive.trace.odometry[first:]] or [here])
            trace = _with_pose(trace, here)
        # The same for the place at the start.
        begins = (start, *(robot.in_map(odometry.pose) for odometry in driven.odometry[:1]))
        self.trace = replace(
            trace,
            way_m=max(pose.distance(here) for pose in begins),
            read=exchange,
            ended=goal is None,
            other=other,
            undecided=not trace.is_near if other else goal is not None and now <= progress + limits.goal_s,
        )

    def look_back(self, start: Pose, before: Command | None, body: dict[str, Any], *, turns: bool) -> None:
        """After a goal was reached, watch for the velocity from before it; request a plan back; PUT the goal again.

        If the robot ``turns`` on the spot, the goal is sent again with another heading.
        """
        trace, robot = self.trace, self.robot
        if trace.undecided or not (trace.ended or trace.other) or not trace.is_near or trace.way_m <= trace.has_to_m:
            return
        if before is not None:
            self._watch_for(before)
        # Away from the start, so that a plan that always starts there is noticed now.
        arrived = robot.map_pose()
        _, plan, exchange = ask(robot, start)
        if plan is not None and arrived is not None:
            found = start_of(robot, plan, arrived, exchange, lambda: ask(robot, start)[1])
            self.trace = replace(self.trace, start=found)
        if self.subscribers is not None and trace.ended:
            self._over_soap(self.subscribers, start)
        if turns and trace.there is not None:
            self._turn_at(trace.there)
        else:
            self.trace = replace(self.trace, again=put_goal(robot, body))
        await_none(robot, 0.1)
        robot.delete_goal()

    def _over_soap(self, subscribers: SoapService, start: Pose) -> None:
        """Read the goal over SOAP until there is none, and request a plan back."""
        robot = self.robot
        patience = robot.patience(robot.settle_s)
        for _ in poll(robot.clock, _STEP_S, lambda: patience.over):
            exchange = soap_services.ask(subscribers, "GetGoal")
            shown = bool(soap_services.returns(exchange)[0])
            if not shown:
                break
        arrived = robot.map_pose()
        plan, asked = ask_over_soap(robot, subscribers, start)
        found = None
        if plan is not None and arrived is not None:
            found = start_of(robot, plan, arrived, asked, lambda: ask_over_soap(robot, subscribers, start)[0])
        # Another client may have sent a goal.
        other = robot.goal()[0] is not None
        self.trace = replace(self.trace, start_over_soap=found, over_soap=None if other else (exchange, shown))

    def _turn_at(self, there: Pose) -> None:
        """PUT a goal with the same id at the robot's place and another heading, and watch whether it turns."""
        robot, drive, clock = self.robot, Drive(self.robot), self.drive.clock
        heading = wrapped(there.yaw + _ASIDE_RAD)
        put = put_goal(robot, goal_body(there._replace(yaw=heading), robot.statement.motion.frame, _REACHED))
        self.trace = replace(self.trace, again=put)
        began, yaw = clock.now(), there.yaw
        progress = began
        while put.response.status in NEW:
            drive.look()
            goal, exchange = robot.goal()
            here = robot.in_map(drive.trace.odometry[-1].pose) if drive.trace.odometry else there
            if abs(wrapped(here.yaw - yaw)) > self._turned_rad:
                progress, yaw = clock.now(), here.yaw
            ended = goal is None and exchange.response.status == HTTPStatus.NOT_FOUND
            if ended or clock.now() > min(progress + robot.limits.goal_s, began + _LONGEST_S):
                drive.keep(robot.settle_s)
                here = middle_of(
                    [robot.in_map(odometry.pose) for odometry in drive.trace.odometry[-SEVERAL:]] or [here]
                )
                self.trace = replace(self.trace, turned_off=(exchange, abs(wrapped(here.yaw - heading))))
            if ended or self.trace.turned_off or (goal is not None and goal["goal_id"]["id"] != _REACHED):
                break

    def _watch_for(self, before: Command) -> None:
        """Watch at the goal whether the robot resumes a velocity from before the goal, which has ended on the way."""
        limits, drive = self.robot.limits, Drive(self.robot)
        if limits.hold_s is None or drive.clock.now() < before.answered + 1.5 * limits.hold_s + limits.settle_s:
            return
        drive.keep(limits.settle_s)
        turns, seen = drive.sees(before.velocity)
        # The velocity need not end by itself here: the goal has ended it, and a robot with a goal of its own may turn
        # for that.
        if turns and self.robot.goal()[0] is None:
            expected = "a velocity from before the goal that has ended for good"
            drive.saw("safety/watchdog", expected, f"the velocity ({seen})", "taken up after a goal", holds=False)
        self.trace = replace(self.trace, turned=drive.trace)
