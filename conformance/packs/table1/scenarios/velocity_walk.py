"""Velocities in random order, after earlier turns have made room for them."""

from conformance.api.soap.callable_services import SoapServices
from conformance.packs.table1.robot.drive import Drive
from conformance.packs.table1.robot.goals import make_room
from conformance.packs.table1.robot.no_commands import no_commands
from conformance.packs.table1.robot.robot import Robot, Velocity
from conformance.packs.table1.robot.velocity_walk import VelocityMachine, room_for
from conformance.packs.table1.robot.walk import Walk
from conformance.packs.table1.scenarios.trace import Driven
from conformance.scenarios.scenario import PartialTraceError, scenario
from conformance.scenarios.stage import Need
from conformance.verdict.explorer import Explorer
from conformance.verdict.run import Run


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
