"""Goals with random ids, and goals with random poses, each replacing the one before."""

import itertools
from typing import Final

from hypothesis import strategies as st

from conformance.packs.table1.robot.goal import NEW, await_goal, await_none, difference, goal_body, is_there, put_goal
from conformance.packs.table1.robot.goal_trace import GoalRead, Put
from conformance.packs.table1.robot.goals import choose_goals
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
