"""Goals with random ids and random poses, and goals that a robot cannot take."""

import itertools
from dataclasses import dataclass, field, replace
from http import HTTPStatus
from typing import Any, Final

from hypothesis import strategies as st

from conformance.packs.table1.robot.geometry import Pose
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
from conformance.packs.table1.robot.goal_trace import FarGoal, GoalRead, Put, RefusedGoals, SpecialGoal
from conformance.packs.table1.robot.robot import Robot
from conformance.packs.table1.scenarios.goal_life import put_new
from conformance.packs.table1.scenarios.plans import is_refused
from conformance.scenarios.scenario import partial_trace, scenario
from conformance.scenarios.stage import Need
from conformance.verdict.evidence import RefutedError
from conformance.verdict.explorer import Explorer

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


# _GIVES_UP_S: time in which a robot may search a way and try its recoveries before it ends the goal
# (contract.md#goals), s.
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
        # All at once: if the robot stops responding meanwhile, their requirement has failed.
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
