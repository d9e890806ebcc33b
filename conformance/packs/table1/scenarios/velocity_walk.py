"""Velocities in random order, by a Hypothesis state machine: the robot must follow the last one."""

from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, precondition, rule

from conformance.api.soap.callable_services import SoapServices
from conformance.packs.table1.limits import Limits
from conformance.packs.table1.robot.drive import Drive
from conformance.packs.table1.robot.drive_trace import ANGULAR_PART, LINEAR_PART
from conformance.packs.table1.robot.goals import make_room
from conformance.packs.table1.robot.no_commands import no_commands
from conformance.packs.table1.robot.robot import STILL, Robot, Velocity
from conformance.packs.table1.robot.walk import Walk
from conformance.packs.table1.scenarios.trace import Driven
from conformance.scenarios.scenario import PartialTraceError, scenario
from conformance.scenarios.stage import Need
from conformance.verdict.explorer import Explorer
from conformance.verdict.run import Run

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
    """Sends velocities, linear parts, stops, invalid velocities and renewals in random order.

    Args:
        walk: state shared by all walks of one check.
    """

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
