"""Checks that compare the interfaces with the robot's ROS graph."""

from typing import Final

import pytest

from conformance.observe.polling import poll_for
from conformance.packs.table1.robot.message_shapes import SENSORS as SENSORS_SHAPE
from conformance.packs.table1.robot.probe.client import Probe, ProbeError, RosProbe
from conformance.packs.table1.robot.robot import SENSORS, STILL, Robot, Velocity
from conformance.verdict.effort import Effort
from conformance.verdict.evidence import Judge

pytestmark = pytest.mark.needs("rest")
# Types that only sensors publish, and what is made of their messages (a scan that was filtered): which of several
# topics of such a type is the sensor's is for the robot to say, and so is what else is a sensor.
_SENSOR_TYPES: Final = frozenset(
    f"sensor_msgs/msg/{name}" for name in ("LaserScan", "Imu", "Image", "PointCloud2", "Range", "NavSatFix")
)
_ARRIVES_S: Final = 2.0
# A probe learns of a publisher some time after it has joined, on a busy machine seconds.
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
    listed = {("/" + entry["topic"].lstrip("/"), entry["type"]) for entry in entries}
    there: set[tuple[str, str]] = set()
    for _ in poll_for(robot.clock, 0.05, _DISCOVERED_S):
        if listed <= there:
            break
        try:
            topics = seeing.topics()
        except ProbeError as error:
            pytest.skip(str(error))
        there = {(name, type_) for name, types in topics.items() for type_ in types}
    kinds = {type_ for _, type_ in listed}
    unlisted = {pair for pair in there if pair[1] in _SENSOR_TYPES - kinds}
    for missing, found in ((listed - there, "not on the graph"), (unlisted, "not in the list")):
        judge.check(
            "equivalence/sensors-graph",
            not missing,
            exchange,
            "the sensors that are published on the ROS graph",
            found=f"{found}: {', '.join(' '.join(pair) for pair in sorted(missing))}",
            cause=found,
        )


@pytest.mark.phase("motion")
@pytest.mark.motion
@pytest.mark.requirement("equivalence/velocity-message")
def test_velocity_is_published(robot: Robot, seeing: Probe, judge: Judge, effort: Effort) -> None:
    """Check that an accepted velocity is published on the velocity topic; the robot may smooth it."""
    try:
        seeing.velocities()
        lost = 0
        for index in range(effort.cases(12)):
            share = (-1) ** index / (3 + index)
            lost += not _judge_one(robot, seeing, judge, robot.share_of_limits(share, -share))
            if lost > 1:
                break
        robot.put_velocity(STILL)
    except ProbeError as error:
        pytest.skip(str(error))


def _judge_one(robot: Robot, seeing: Probe, judge: Judge, wanted: Velocity) -> bool:
    exchange = robot.put_velocity(wanted)
    if not exchange.response.ok:
        return True
    every_s = 0.4 * (robot.limits.hold_s or _ARRIVES_S)
    renew_at = robot.clock.now() + every_s
    seen: list[Velocity] = []
    for _ in poll_for(robot.clock, 0.005, max(_ARRIVES_S, robot.settle_s)):
        seen += seeing.velocities()
        if any(robot.near(one, wanted) for one in seen):
            break
        # What is smoothed on its way may end before it has come all the way.
        if robot.clock.now() > renew_at:
            robot.put_velocity(wanted)
            renew_at = robot.clock.now() + every_s
    return judge.check(
        "equivalence/velocity-message",
        any(robot.near(one, wanted) for one in seen),
        exchange,
        f"a message with {wanted}, within the tolerance",
        found=f"{len(seen)} messages, last {seen[-1]}" if seen else "no message",
        cause="another message" if seen else "no message",
    )
