"""Checks and rules that compare the interfaces with the robot's ROS graph."""

from collections.abc import Iterator
from typing import Final

import pytest

from conformance.observe.clock import poll_for
from conformance.packs.table1.robot.message_shapes import SENSORS as SENSORS_SHAPE
from conformance.packs.table1.robot.probe import Probe, ProbeError, RosProbe
from conformance.packs.table1.robot.robot import SENSORS, Robot
from conformance.packs.table1.scenarios.interfaces_in_motion import OnRos, velocities_on_ros
from conformance.packs.table1.statement import said_of
from conformance.scenarios.ros.presence import strangers
from conformance.scenarios.rule import Outcome, rule
from conformance.verdict.evidence import Case, Judge
from conformance.verdict.run import Run

pytestmark = pytest.mark.needs("rest")
# Types that only sensors publish, and what is made of their messages (a scan that was filtered): which of several
# topics of such a type is the sensor's is for the robot to say, and so is what else is a sensor.
_SENSOR_TYPES: Final = frozenset(
    f"sensor_msgs/msg/{name}" for name in ("LaserScan", "Imu", "Image", "PointCloud2", "Range", "NavSatFix")
)
# How long a probe may take to discover a publisher on a busy machine, s.
_DISCOVERED_S: Final = 10.0


@pytest.fixture(name="seeing")
def _seeing(probe: RosProbe) -> Probe:
    """Return the ROS probe once it has discovered the robot."""
    try:
        return probe.ready()
    except ProbeError as error:
        pytest.skip(str(error))


@pytest.mark.phase("motion")
@pytest.mark.requirement("equivalence/sensors-graph")
def test_sensors_are_on_the_graph(robot: Robot, seeing: Probe, judge: Judge) -> None:
    """Check that each listed sensor is a published topic of its type, and no common sensor topic is missing."""
    entries, exchange = robot.read(SENSORS, SENSORS_SHAPE)
    if entries is None:
        pytest.skip("the robot's list of sensors cannot be read")
    listed = {f"{entry['topic']} {entry['type']}" for entry in entries}
    there: set[str] = set()
    for _ in poll_for(robot.clock, 0.05, _DISCOVERED_S):
        if not strangers(listed, there):
            break
        try:
            topics = seeing.topics()
        except ProbeError as error:
            pytest.skip(str(error))
        there = {f"{name} {type_}" for name, types in topics.items() for type_ in types}
    others = _SENSOR_TYPES - {entry["type"] for entry in entries}
    unlisted = sorted(one for one in there if one.split()[1] in others)
    for missing, found in ((strangers(listed, there), "not on the graph"), (unlisted, "not in the list")):
        judge.check(
            "equivalence/sensors-graph",
            not missing,
            exchange,
            "the sensors that are published on the ROS graph",
            found=f"{found}: {', '.join(missing)}",
            cause=found,
        )


@rule("equivalence/velocity-message", on=(velocities_on_ros,))
def velocity_message(trace: tuple[OnRos, ...], run: Run) -> Iterator[Outcome]:
    """Judge that an accepted velocity is published on the velocity topic; the robot may smooth it."""
    for velocity in trace:
        yield Case(
            velocity.has_arrived(said_of(run).limits),
            velocity.exchange,
            f"a message with {velocity.wanted}, within the tolerance",
            f"{len(velocity.seen)} messages, last {velocity.seen[-1]}" if velocity.seen else "no message",
            "another message" if velocity.seen else "no message",
        )
