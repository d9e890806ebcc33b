"""Rules on pose, velocity and goal over REST and SOAP, while the robot moves and when it has come to rest."""

from collections import deque
from collections.abc import Callable, Iterator
from operator import attrgetter
from typing import Any

from conformance.documents.json_shape import Shape
from conformance.packs.table1.checkers.single_readings import BesideOdometry, Place
from conformance.packs.table1.robot.geometry import pose_of
from conformance.packs.table1.robot.message_shapes import ODOMETRY, TWIST
from conformance.packs.table1.robot.robot import Odometry, Velocity
from conformance.packs.table1.robot.state_over_soap import StateRead, value_in
from conformance.packs.table1.scenarios.interfaces_in_motion import goals_over_soap, interfaces_in_motion
from conformance.packs.table1.scenarios.trace import Driven
from conformance.packs.table1.scenarios.turn import turn
from conformance.packs.table1.statement import said_of
from conformance.scenarios.rule import Outcome, Rule, rule
from conformance.scenarios.scenario import Scenario
from conformance.verdict.run import Run


def _same(name: str, scenario: Scenario) -> Rule:
    """Return a rule that judges whether both interfaces show the same state."""

    def judge(trace: tuple[StateRead, ...]) -> Iterator[Outcome]:
        return (case for read in trace if read.name == name for case in read.cases)

    return rule(f"equivalence/{name}", on=(scenario,))(judge)


pose = _same("pose", interfaces_in_motion)
velocity = _same("velocity", interfaces_in_motion)
goal = _same("goal", goals_over_soap)


def _beside(operation: str, shape: Shape, over_soap: Callable[[Any], Any], of: Callable[[Odometry], Any]) -> Rule:
    """Return a rule that compares a state over SOAP with the odometry around it, at every heading.

    Args:
        operation: the operation that returns the state.
        shape: its shape.
        over_soap: returns the value to compare.
        of: returns that of an odometry.
    """

    def judge(trace: Driven, run: Run) -> Iterator[Outcome]:
        beside = BesideOdometry[Any](said_of(run).limits)
        reads = deque(one for one in trace.over_soap if operation.encode() in one.request.body)
        for odometry in trace.drive.odometry:
            while reads and reads[0].response.received_s < odometry.received:
                exchange = reads.popleft()
                value, problem = value_in(exchange, shape)
                # A value with a wrong shape is judged where whole states are compared.
                if not problem and not shape.problem(value):
                    beside.reading(over_soap(value), exchange, exchange.response.received_s)
            yield from beside.odometry(odometry.stamp, of(odometry), odometry.received)

    return rule(f"equivalence/{operation.removeprefix('Get').lower()}", on=(turn,))(judge)


pose_turning = _beside(
    "GetPose",
    ODOMETRY,
    lambda value: Place.of(pose_of(value["pose"]["pose"])),
    lambda odometry: Place.of(odometry.pose),
)
twist_turning = _beside("GetPose", ODOMETRY, lambda value: Velocity.of(value["twist"]["twist"]), attrgetter("velocity"))
velocity_turning = _beside("GetVelocity", TWIST, Velocity.of, attrgetter("velocity"))
