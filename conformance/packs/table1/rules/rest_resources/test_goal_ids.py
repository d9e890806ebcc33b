"""Goals with ids of all kinds, each replacing the one before."""

import itertools
from typing import Final

import pytest
from hypothesis import strategies as st

from conformance.documents.json_text import shown
from conformance.packs.table1.robot.goal import NEW, arrived, await_goal, await_none, difference, goal_body, put_goal
from conformance.packs.table1.robot.goals import choose_goals
from conformance.packs.table1.robot.robot import Robot
from conformance.verdict.evidence import Judge
from conformance.verdict.explorer import Explorer

pytestmark = [pytest.mark.phase("motion"), pytest.mark.needs("rest"), pytest.mark.motion]
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


@pytest.mark.requirement("rest-resources/goal-id", "rest-resources/goal-preempt", "rest-resources/goal-get")
def test_goal_ids(robot: Robot, judge: Judge, explore: Explorer) -> None:
    """PUT goals with random ids: the robot must accept each, and show it as active under its id."""
    goals = itertools.cycle(choose_goals(robot, 1.5, 2))
    frame = robot.statement.motion.frame
    used: list[str] = []
    strange: list[str] = []

    def try_id(id_: str) -> None:
        if strange or id_ in used[-1:]:
            return  # waiting for the right goal again and again shows no more; an id with another pose is a conflict
        pose = next(goals)
        body = goal_body(pose, frame, id_)
        exchange = put_goal(robot, body)
        status = exchange.response.status
        used.append(id_)
        judge.require(
            "rest-resources/goal-id",
            status in NEW,
            exchange,
            f"201 or 202 for the id {shown(id_)}, which has {len(id_)} characters",
            cause=exchange.came,
        )
        goal, problem, read = await_goal(robot, body)
        if goal is None and arrived(robot, pose):
            return
        if problem:
            strange.append(problem)
        for name in ("goal-id", "goal-preempt", "goal-get"):
            judge.check(
                f"rest-resources/{name}",
                not problem,
                read,
                "the goal that was put last, under its id",
                found=problem,
                cause="another id" if problem.startswith("goal_id") else problem,
            )

    # Also with little effort: as octets it is twice as long.
    explore(st.just("\u00e9" * _LONGEST), try_id, cases=1)
    explore(st.one_of(st.sampled_from(_KNOWN), st.text(_CHARACTERS, min_size=1, max_size=_LONGEST)), try_id, cases=40)
    robot.delete_goal()
    await_none(robot)


@pytest.mark.requirement("rest-resources/goal-get")
def test_the_goal_shown_is_the_goal_put(robot: Robot, judge: Judge, explore: Explorer) -> None:
    """PUT goals with random poses: the robot must show each as it was sent, in every reading."""
    goals = choose_goals(robot, 1.5, 2)
    numbers = itertools.count()
    strange: list[str] = []

    def try_pose(case: tuple[int, float, float, float]) -> None:
        if strange:
            return
        which, shift, yaw, length = case
        pose = goals[which]._replace(x=goals[which].x + shift, yaw=yaw)
        body = goal_body(pose, robot.statement.motion.frame, f"pose {next(numbers)}", length=length)
        exchange = put_goal(robot, body)
        if 400 <= exchange.response.status < 500:
            return  # what stands there need not be known to a planner of another tolerance
        goal, problem, read = await_goal(robot, body)
        if problem:
            strange.append(problem)
        for _ in range(3):
            if goal is None and arrived(robot, pose):
                return
            judge.check("rest-resources/goal-get", not problem, read, "the goal that was put", found=problem)
            goal, read = robot.goal()
            problem = read.came if goal is None else difference(goal, body)

    explore(
        st.tuples(
            st.integers(0, 1), st.floats(-0.1, 0.1), st.floats(-3.1, 3.1), st.sampled_from((1.0, 1.0005, 0.9995))
        ),
        try_pose,
        cases=20,
    )
    robot.delete_goal()
    await_none(robot)
