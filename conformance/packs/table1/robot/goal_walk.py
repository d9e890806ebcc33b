"""A Hypothesis state machine that PUTs, repeats, contradicts, replaces and cancels goals in random order."""

from collections.abc import Sequence
from http import HTTPStatus
from typing import Any, Final

from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, rule

from conformance.packs.table1.robot.geometry import Pose
from conformance.packs.table1.robot.goal import (
    CANCELLED,
    NEW,
    RATHER_XML,
    REPEATED,
    arrived,
    await_goal,
    await_none,
    difference,
    goal_body,
    put_goal,
    status_fault,
)
from conformance.packs.table1.robot.robot import Robot
from conformance.packs.table1.robot.walk import Walk
from conformance.transport.exchange import Exchange

_IDS: Final = st.sampled_from((None, "a", "b", "a ", "A"))
_WHICH: Final = st.integers(0, 1)


class GoalMachine(RuleBasedStateMachine):
    """Sends random goal requests and judges each response by the goal that must be active.

    Args:
        walk: state shared by all walks of one check.
        poses: targets to choose from.
    """

    def __init__(self, walk: Walk, poses: Sequence[Pose]) -> None:
        super().__init__()
        self._walk, self._poses = walk, poses
        self._robot: Robot = walk.robot
        self._active: dict[str, Any] | None = None
        self._pose = poses[0]
        walk.step(self._clear)

    def teardown(self) -> None:
        """Cancel the goal."""
        self._walk.step(self._clear)

    @rule()
    def ask(self) -> None:
        """GET the goal: it must be the active one, or 404."""
        self._walk.step(self._look)

    @rule(id_=_IDS, which=_WHICH)
    def put(self, id_: str | None, which: int) -> None:
        """PUT a goal; its id makes it a new goal, a repetition or a contradiction of the active one."""
        self._walk.step(lambda: self._put(id_, which))

    @rule()
    def repeat(self) -> None:
        """PUT the active goal again."""
        if self._active is not None and "goal_id" in self._active:
            which = self._poses.index(self._pose)
            self._walk.step(lambda: self._put(self._id, which))

    @rule()
    def cancel(self) -> None:
        """DELETE the goal, whether there is one or not."""
        self._walk.step(self._cancel)

    @property
    def _id(self) -> str | None:
        return self._active["goal_id"]["id"] if self._active and "goal_id" in self._active else None

    def _clear(self) -> bool:
        self._robot.delete_goal()
        exchange = await_none(self._robot)
        self._active = None
        return exchange.response.status == HTTPStatus.NOT_FOUND

    def _look(self) -> bool:
        goal, exchange = self._robot.goal()
        if self._active is None:
            none = exchange.response.status == HTTPStatus.NOT_FOUND
            return self._check("goal-none", exchange, "404 without an active goal", holds=none)
        if goal is None and arrived(self._robot, self._pose):
            self._active = None
            return True
        problem = exchange.came if goal is None else difference(goal, self._active) or status_fault(goal)
        return self._check("goal-get", exchange, "the active goal, as it was put", holds=not problem, found=problem)

    def _put(self, id_: str | None, which: int) -> bool:
        if not self._look():
            return False
        body = goal_body(self._poses[which], self._robot.statement.motion.frame, id_)
        if self._active is not None and id_ is not None and id_ == self._id:
            return self._put_again(body, self._poses[which])
        return self._put_new(body, self._poses[which])

    def _put_again(self, body: dict[str, Any], pose: Pose) -> bool:
        """PUT a goal under the active goal's id: with the same pose or with another."""
        exchange = put_goal(self._robot, body)
        status = exchange.response.status
        if arrived(self._robot, self._pose):
            return self._clear()
        if pose == self._pose:
            well = self._check("goal-repeat", exchange, "200, 202 or 204 for the active goal", holds=status in REPEATED)
        else:
            well = self._check(
                "goal-conflict", exchange, "409 for another pose under this id", holds=status == HTTPStatus.CONFLICT
            )
        return well and self._look()

    def _put_new(self, body: dict[str, Any], pose: Pose) -> bool:
        """PUT the first goal, or one that replaces the active goal."""
        exchange = put_goal(self._robot, body)
        status = exchange.response.status
        displaces = self._active is not None
        if not self._check("goal-put", exchange, "201 or 202 for a new goal", holds=status in NEW):
            return False
        self._active, self._pose = body, pose
        goal, problem, shown = await_goal(self._robot, body)
        if goal is None and arrived(self._robot, pose):
            self._active = None
            return True
        name = "goal-preempt" if displaces else "goal-get"
        return self._check(name, shown, "the goal that was put last", holds=not problem, found=problem)

    def _cancel(self) -> bool:
        if not self._look():
            return False
        exchange = self._robot.delete_goal(RATHER_XML)
        status = exchange.response.status
        if self._active is None:
            fine = status in {*CANCELLED, HTTPStatus.NOT_FOUND}
            return self._check("goal-delete-none-success", exchange, "404 or 204", holds=fine)
        near = arrived(self._robot, self._pose)
        self._active = None
        none = await_none(self._robot)
        gone = none.response.status == HTTPStatus.NOT_FOUND
        holds = (status in CANCELLED or (near and status == HTTPStatus.NOT_FOUND)) and gone
        found = exchange.came if gone else none.came
        return self._check("goal-delete", exchange, "204 for DELETE, then 404 for GET", holds=holds, found=found)

    def _check(self, name: str, exchange: Exchange, expected: str, *, holds: bool, found: str = "") -> bool:
        return self._robot.judge.check(f"rest-resources/{name}", holds, exchange, expected, found=found)
