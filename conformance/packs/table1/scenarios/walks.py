"""Velocities and goals in random order, by Hypothesis state machines: the robot must follow the last one."""

from collections import Counter
from collections.abc import Callable, Sequence
from http import HTTPStatus
from itertools import chain, cycle, islice, repeat
from typing import Any, Final

from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, precondition, rule

from conformance.api.soap.callable_services import SoapServices
from conformance.packs.table1.limits import Limits
from conformance.packs.table1.robot.drive import Drive
from conformance.packs.table1.robot.drive_rules import Driven
from conformance.packs.table1.robot.drive_trace import ANGULAR_PART, LINEAR_PART, Trace
from conformance.packs.table1.robot.geometry import Pose
from conformance.packs.table1.robot.goal import (
    RATHER_XML,
    await_goal,
    await_none,
    choose_goals,
    difference,
    goal_body,
    is_there,
    make_room,
    put_goal,
    status_fault,
)
from conformance.packs.table1.robot.goal_trace import GoalStep
from conformance.packs.table1.robot.refused_requests import no_commands
from conformance.packs.table1.robot.robot import STILL, Robot, Velocity
from conformance.scenarios.scenario import NotPossibleError, PartialTraceError, scenario
from conformance.scenarios.stage import Need
from conformance.transport.exchange import Exchange, NoAnswerError
from conformance.verdict.effort import Effort
from conformance.verdict.explorer import Explorer
from conformance.verdict.run import Run

_TIME_IS_UP = "the time is up"
_ENOUGH = "all steps that were planned are done"
# Least time until a command is reached, s, and share of a slow robot's settle time.
_COMMAND_S = 0.4
_OF_SETTLE = 0.25
# A pause without any request, s; once in a walk.
_PAUSE_S = 1.5


class Walk:
    """The shared state of all random walks of one check.

    Attributes:
        robot: the robot.
        drive: its velocity commands and readings.
        commands: number of velocities commanded so far, by the signs of their components.
        ended: why no further step is made: a requirement failed, the planned steps are done, the time is up, or the
            robot is busy.
        unreachable: the request without a response that ended the walk, if any.
        left_out: number of steps left out because the time was up.
    """

    def __init__(
        self,
        robot: Robot,
        effort: Effort,
        share: float,
        trace: Trace | None = None,
        preludes: Sequence[Callable[[], object]] = (),
    ) -> None:
        """Plan a walk that takes about ``share`` of the effort's budget: its steps are counted, not timed.

        Two of the ``preludes`` come before each command: they change nothing, and neither do they spoil the command.
        """
        before: list[Callable[[], object]] = [] if effort.slow else list(preludes)
        if before and effort.name != "quick":
            lengths = chain([_PAUSE_S], repeat(0.0))
            before.append(lambda: robot.clock.sleep(next(lengths)))
        self._preludes = cycle(before)
        self.robot = robot
        self.drive = Drive(robot)
        self.commands: Counter[tuple[int, ...]] = Counter()
        self.drive.trace = trace or self.drive.trace
        self.ended = ""
        self.unreachable: NoAnswerError | None = None
        self.left_out = 0
        self._until = robot.clock.now() + share * effort.longest_s
        self._commands_left = max(
            1, round(share * effort.budget_s / max(_COMMAND_S, _OF_SETTLE * robot.limits.settle_s))
        )

    def prelude(self) -> None:
        """Do the next two things that command nothing."""
        for before in islice(self._preludes, 2):
            before()

    def command(self, act: Callable[[], bool]) -> None:
        """Make one step: command a velocity and wait for it. The planned time decides the number of steps."""
        if not self.ended and self._commands_left == 0:
            self.ended = _ENOUGH
        self._commands_left -= not self.ended
        self.step(act)

    def step(self, act: Callable[[], bool]) -> None:
        """Make one step unless the walk has ended; ``act`` returns whether all was well."""
        if not self.ended and self.robot.clock.now() > self._until:
            self.ended = _TIME_IS_UP
        if self.ended:
            self.left_out += self.ended == _TIME_IS_UP
            return
        try:
            if not act():
                self.ended = "refuted"
        except NoAnswerError as none:
            self.unreachable, self.ended = none, str(none)
        except NotPossibleError as busy:
            self.ended = str(busy)


# Shares of the limits: fast enough to differ from rest, slow enough to stay near.
_LINEAR_SHARE = 0.35
_ANGULAR_SHARE = 0.6
# Beyond this distance from the start of the walk, the next way leads back, m.
_LEASH_M = 0.25
_SHARES = st.floats(0.15, 1.0)


def room_for(limits: Limits) -> float:
    """Return how far from its start a walk may take a robot, m: the leash plus one more velocity."""
    return _LEASH_M + _LINEAR_SHARE * limits.linear_m_s * limits.settle_s


class VelocityMachine(RuleBasedStateMachine):
    """Sends velocities, linear parts, stops, invalid velocities and renewals in random order."""

    def __init__(self, walk: Walk) -> None:
        super().__init__()
        self._walk = walk
        self._robot, self._drive = walk.robot, walk.drive
        self._wanted = STILL

    def teardown(self) -> None:
        """Stop the robot, whichever way it drives: every stop has to be one."""
        self._walk.step(self._stop)

    @rule()
    def ask(self) -> None:
        """Read the state: readings must agree with each other at any time."""
        self._walk.step(lambda: self._drive.look()[0] is not None)

    @rule(forward=st.booleans(), left=st.booleans(), linear=_SHARES, angular=_SHARES, which=st.sampled_from("ab2"))
    def command(self, *, forward: bool, left: bool, linear: float, angular: float, which: str) -> None:
        """Command a velocity within the limits, which the robot must reach."""
        robot = self._robot
        turn = robot.share_of_limits(0.0, angular * _ANGULAR_SHARE * (1 if left else -1)).angular_z
        in_circles = bool(robot.statement.motion.min_radius_m)
        ahead = self._ahead(linear, forward=forward) if which in "a2" or in_circles else 0.0
        wanted = Velocity(linear_x=ahead, angular_z=turn if which in "b2" and (ahead or not in_circles) else 0.0)
        self._walk.command(lambda: self._full(robot.drivable(wanted)))

    @rule()
    def stop(self) -> None:
        """Command zero velocity."""
        self._walk.command(self._stop)

    @rule(forward=st.booleans(), linear=_SHARES)
    def command_linear(self, *, forward: bool, linear: float) -> None:
        """PUT a linear part; the robot must keep the angular part."""
        self._walk.command(lambda: self._linear(self._ahead(linear, forward=forward)))

    @precondition(lambda self: self._wanted != STILL)
    @rule(component=st.integers(0, 5), times=st.sampled_from((1.0, -1.0)))
    def refuse(self, component: int, times: float) -> None:
        """PUT a velocity beyond the limits; the robot must reject it and drive on as before."""
        self._walk.command(lambda: self._refuse(component, times))

    def _ahead(self, share: float, *, forward: bool) -> float:
        trace, robot = self._drive.trace.odometry, self._robot
        sign = 1 if forward or not robot.reverses else -1
        if trace and trace[0].pose.distance(trace[-1].pose) > _LEASH_M:
            step = trace[-1].pose.ahead(0.1 * sign)
            if step.distance(trace[0].pose) >= trace[-1].pose.distance(trace[0].pose):
                # A robot that cannot reverse has to turn first.
                sign = -sign if robot.reverses else 0
        return robot.share_of_limits(sign * share * _LINEAR_SHARE, 0.0).linear_x

    def _full(self, wanted: Velocity) -> bool:
        self._wanted = wanted
        commanded = self._drive.command(wanted, xml=self._as_xml(wanted), before=self._walk.prelude)
        return commanded and self._drive.reach(wanted, "rest-resources/velocity-converges")

    def _stop(self) -> bool:
        """Command zero velocity, if the robot drives at all, and wait until it is at rest, before its watchdog acts."""
        moving, self._wanted = self._wanted, STILL
        if moving == STILL:
            return self._full(STILL)
        return self._drive.stop(moving, "xml" if self._as_xml(STILL) else "velocity")

    def _as_xml(self, wanted: Velocity) -> bool:
        """Return whether to send a velocity as XML: every second one with the same signs, if the robot reads XML."""
        signs = tuple((part > 0) - (part < 0) for part in wanted)
        self._walk.commands[signs] += 1
        return self._walk.commands[signs] % 2 == 1

    def _linear(self, ahead: float) -> bool:
        wanted = self._wanted._replace(linear_x=ahead)
        if self._robot.drivable(wanted) != wanted:
            return True  # the circle is too narrow for the angular part, or the curve too fast
        self._drive.refresh(self._wanted)
        self._walk.prelude()
        if not self._drive.command(wanted, linear=True, xml=self._as_xml(wanted)):
            return False
        self._wanted = wanted
        if not self._drive.reach(wanted, "rest-resources/linear-put", part=LINEAR_PART):
            return False
        # The angular part may last longer than commanded.
        keeps, seen = self._drive.sees(wanted, 1.5, part=ANGULAR_PART, until=self._drive.holds_until)
        expected = f"the angular part as it was, {self._wanted}"
        self._drive.saw("rest-resources/linear-keeps-angular", expected, seen, "changed", holds=keeps)
        return keeps is not False

    def _refuse(self, component: int, times: float) -> bool:
        self._drive.refresh(self._wanted)
        bad = [0.0] * 6
        bad[component] = times * 1e3
        self._robot.put_velocity(Velocity(*bad))
        keeps, seen = self._drive.sees(self._wanted, 2, until=self._drive.holds_until)
        expected = f"the velocity that was there before the refused one, {self._wanted}"
        self._drive.saw("safety/refused-keeps", expected, seen, "changed", holds=keeps)
        return keeps is not False


@scenario(needs={Need.REST, Need.MOTION})
def velocity_walk(robot: Robot, run: Run, soap: SoapServices, explore: Explorer) -> Driven:
    """Command velocities in random order, each after a request that commands nothing: the robot must reach the last."""
    make_room(robot, room_for(robot.limits))
    # A velocity of 0 cannot be refused, whatever its sign.
    zero = Drive(robot)
    zero.command(Velocity(-0.0, -0.0, -0.0, -0.0, -0.0, -0.0))
    preludes = no_commands(robot, soap, f"{run.seed}/velocities")
    walk = Walk(robot, run.effort, 0.8, zero.trace, preludes)
    explore.machine(lambda: VelocityMachine(walk), cases=10, steps=run.effort.cases(12))
    explore.left_out(walk.left_out)
    if walk.unreachable:
        raise PartialTraceError(Driven(walk.drive.whole)) from walk.unreachable
    return Driven(walk.drive.whole)


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
