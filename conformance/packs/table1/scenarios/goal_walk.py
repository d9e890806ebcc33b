"""Goals in random order, by a Hypothesis state machine: sent, repeated, contradicted, replaced and cancelled."""

from collections.abc import Sequence
from http import HTTPStatus
from typing import Any, Final

from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, rule

from conformance.api.soap.callable_services import SoapServices
from conformance.packs.table1.robot.geometry import Pose
from conformance.packs.table1.robot.goal import (
    RATHER_XML,
    await_goal,
    await_none,
    difference,
    goal_body,
    is_there,
    put_goal,
    status_fault,
)
from conformance.packs.table1.robot.goal_trace import GoalStep
from conformance.packs.table1.robot.goals import choose_goals
from conformance.packs.table1.robot.no_commands import no_commands
from conformance.packs.table1.robot.robot import Robot
from conformance.packs.table1.robot.walk import Walk
from conformance.scenarios.scenario import PartialTraceError, scenario
from conformance.scenarios.stage import Need
from conformance.transport.exchange import Exchange
from conformance.verdict.explorer import Explorer
from conformance.verdict.run import Run

_IDS: Final = st.sampled_from((None, "a", "b", "a ", "A"))
_WHICH: Final = st.integers(0, 1)


@scenario(needs={Need.REST, Need.MOTION})
def goal_walk(robot: Robot, run: Run, soap: SoapServices, explore: Explorer) -> tuple[GoalStep, ...]:
    """Send goal requests in random order: after each sequence the goal sent last must be the active one."""
    walk = Walk(robot, run.effort, 0.4, preludes=no_commands(robot, soap, f"{run.seed}/goals"))
    poses = choose_goals(robot, 1.5, 2)
    steps: list[GoalStep] = []
    explore.machine(lambda: _Goals(walk, poses, steps), cases=20, steps=run.effort.cases(12))
    explore.left_out(walk.left_out)
    if walk.unreachable:
        raise PartialTraceError(tuple(steps)) from walk.unreachable
    return tuple(steps)


class _Goals(RuleBasedStateMachine):
    """Sends random goal requests, and records each with the goal that must be active.

    Args:
        walk: state shared by all walks of the scenario; it ends at the first step that does not conform.
        poses: targets to choose from.
        steps: the record, which is extended.
    """

    def __init__(self, walk: Walk, poses: Sequence[Pose], steps: list[GoalStep]) -> None:
        super().__init__()
        self._walk, self._poses, self._steps = walk, poses, steps
        self._robot: Robot = walk.robot
        self._active: dict[str, Any] | None = None
        self._pose = poses[0]
        walk.step(self._clear)

    def teardown(self) -> None:
        """Cancel the active goal, if any."""
        self._walk.step(self._cancel if self._active is not None else self._clear)

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
        """DELETE the goal, whether one is active or not."""
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
            return self._record("goal-none", exchange)
        if goal is None and is_there(self._robot, self._pose):
            self._active = None
            return True
        problem = exchange.came if goal is None else difference(goal, self._active) or status_fault(goal)
        return self._record("goal-get", exchange, problem)

    def _put(self, id_: str | None, which: int) -> bool:
        if not self._look():
            return False
        self._walk.prelude()
        body = goal_body(self._poses[which], self._robot.statement.motion.frame, id_)
        if self._active is not None and id_ is not None and id_ == self._id:
            return self._put_again(body, self._poses[which])
        return self._put_new(body, self._poses[which])

    def _put_again(self, body: dict[str, Any], pose: Pose) -> bool:
        """PUT a goal under the active goal's id: with the same pose or with another."""
        exchange = put_goal(self._robot, body)
        if is_there(self._robot, self._pose):
            return self._clear()
        return self._record("goal-repeat" if pose == self._pose else "goal-conflict", exchange) and self._look()

    def _put_new(self, body: dict[str, Any], pose: Pose) -> bool:
        """PUT the first goal, or one that replaces the active goal."""
        displaces = self._active is not None
        if not self._record("goal-put", put_goal(self._robot, body)):
            return False
        self._active, self._pose = body, pose
        goal, problem, shown = await_goal(self._robot, body)
        if goal is None and is_there(self._robot, pose):
            self._active = None
            return True
        return self._record("goal-preempt" if displaces else "goal-get", shown, problem)

    def _cancel(self) -> bool:
        if not self._look():
            return False
        self._walk.prelude()
        exchange = self._robot.delete_goal(RATHER_XML)
        if self._active is None:
            return self._record("goal-delete-none-success", exchange)
        near = is_there(self._robot, self._pose)
        self._active = None
        none = await_none(self._robot)
        differs = "" if none.response.status == HTTPStatus.NOT_FOUND else none.came
        return self._record("goal-delete", exchange, differs, ended=near)

    def _record(self, kind: str, exchange: Exchange, differs: str = "", *, ended: bool = False) -> bool:
        """Record a step; return whether the robot's state is as expected, so that the walk can continue."""
        self._steps.append(GoalStep(kind, exchange, differs, ended))
        return self._steps[-1].case.holds
