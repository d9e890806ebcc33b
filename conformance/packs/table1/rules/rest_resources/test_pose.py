"""Pose, measured velocity, the robot's clock and its lists, read while the suite commands nothing."""

import pytest

from conformance.documents.json_shape import Shape
from conformance.observe.clock import poll_for
from conformance.packs.table1.robot.clock import SPAN_S, Clock
from conformance.packs.table1.robot.drive import Drive
from conformance.packs.table1.robot.drive_rules import outcomes
from conformance.packs.table1.robot.message_shapes import SENSORS as SENSORS_SHAPE
from conformance.packs.table1.robot.message_shapes import SERVICES as SERVICES_SHAPE
from conformance.packs.table1.robot.message_shapes import read_as
from conformance.packs.table1.robot.robot import POSE, SENSORS, SERVICES, Robot
from conformance.packs.table1.robot.state_read import entries_of
from conformance.scenarios.rule import record
from conformance.transport.exchange import Exchange
from conformance.verdict.effort import Effort
from conformance.verdict.evidence import Judge

pytestmark = pytest.mark.needs("rest")
# How long the suite waits for slow odometry, or for a robot that was just started, s.
_PATIENCE_S = 5.0
_TURNS = 250  # readings at standard effort, which find a fault in one of sixty
_READ = 4  # readings are at most this multiple, as a busy machine misses samples
_STEADY_S = 0.4  # odometry must be steady for longer than this
_LONG_S = 0.6  # how long odometry is watched, s
_SAMPLE, _BESIDE = "rest-resources/pose-sample", "rest-resources/velocity-odometry"
# Consecutive readings without odometry after which it is missing.
_UNREAD = 5
_STEP_S = 0.1  # time between readings of the clock, s
_OFF_S = 5.0  # error that the robot's clock may have, s
_OLD_S = 1.0  # age that odometry may have, s
_UNIT_S = 1.0  # resolution of Date, s


@pytest.mark.phase("reading")
@pytest.mark.requirement(
    "rest-resources/pose-type",
    "rest-resources/pose-unavailable",
    "rest-resources/pose-fresh",
    "rest-resources/pose-quaternion",
    "rest-resources/pose-stamp",
)
def test_pose(robot: Robot, judge: Judge, effort: Effort) -> None:
    """Read the odometry repeatedly: each must be complete, and the stamps must advance."""
    stamps: set[float] = set()
    exchange: Exchange | None = None
    patience = robot.patience(_PATIENCE_S)
    readings = 0
    while readings < effort.cases(100) or (len(stamps) < 2 and not patience.over):
        odometry = robot.odometry()
        readings += 1
        if odometry is not None:
            stamps.add(odometry.stamp)
            exchange = odometry.exchange
        if readings >= effort.cases(100):
            if not stamps and "rest-resources/pose-type" in judge.failure_counts():
                break
            robot.clock.sleep(0.02)
    if not stamps:
        # Earlier responses were judged above; here, the robot had no odometry for the whole time.
        judge.check("rest-resources/pose-type", False, robot.get(POSE), f"a readable odometry within {_PATIENCE_S:g} s")
        return
    judge.check(
        "rest-resources/pose-stamp",
        len(stamps) > 1,
        exchange,
        f"a stamp that advances within {_PATIENCE_S:g} s",
        found=f"the same stamp in {readings} readings",
    )


@pytest.mark.phase("late")
@pytest.mark.requirement(_SAMPLE, _BESIDE)
def test_single_readings(robot: Robot, judge: Judge, effort: Effort) -> None:
    """Read odometry and velocity alternately, unless the run has done so; the checkers judge each by its neighbours."""
    unread, before, wanted = 0, judge.cases(_BESIDE), effort.cases(_TURNS)
    for turn in range(_READ * wanted):
        judged = judge.cases(_BESIDE)
        if min(judged, judge.cases(_SAMPLE)) >= wanted or (turn >= wanted and judged == before):
            break
        unread = unread + 1 if robot.odometry() is None else 0
        if unread == _UNREAD:
            break
        robot.velocity()
    robot.odometry()
    robot.odometry()


@pytest.mark.phase("reading")
@pytest.mark.requirement(
    "rest-resources/velocity-type",
    "rest-resources/velocity-odometry",
    "rest-resources/linear-type",
    "rest-resources/linear-agrees",
)
def test_velocity_and_odometry(robot: Robot, judge: Judge, effort: Effort) -> None:
    """Read velocity, linear velocity and odometry: they must agree; the checkers judge each response."""
    # Two readings agree only where odometry has been steady, so look for that long at least.
    drive = Drive(robot)
    hold_s = robot.limits.hold_s
    alone = hold_s is not None and hold_s < _LONG_S  # no drive of such a robot is steady for so long
    drive.keep(_LONG_S if alone else _STEADY_S)
    while len(drive.trace.turns) < effort.cases(60):
        drive.look()
    for id_ in (_BESIDE, "rest-resources/linear-agrees"):
        record(judge, id_, outcomes(id_, drive.whole, robot.limits))


# Late in a run: its stamps show more the longer the run has lasted.
@pytest.mark.phase("acting")
@pytest.mark.requirement("rest-resources/pose-clock", "rest-resources/pose-clock-offset")
def test_clock(robot: Robot, judge: Judge, clock: Clock) -> None:
    """Check that the stamps advance as fast as local time."""
    for _ in poll_for(robot.clock, _STEP_S, SPAN_S + 1):
        robot.odometry()  # the odometry is read again if the last reading is old
        if clock.rate is not None:
            break
    if clock.ahead_s is not None and robot.limits.time_scale == 1:
        ahead, declared = clock.ahead_s, robot.limits.clock_offset_s
        judge.check(
            "rest-resources/pose-clock-offset",
            -_OFF_S - _OLD_S <= ahead - declared <= _OFF_S + _UNIT_S,
            robot.get(POSE),
            f"a stamp within {_OFF_S:g} s of Date, or ahead of it by the declared clock_offset_s, {declared:g} s",
            found=f"a stamp {ahead:.1f} s ahead of Date",
            cause="another time",
        )
    rate, scale = clock.rate, robot.limits.time_scale
    if rate is None:
        judge.skip("rest-resources/pose-clock", f"no odometry could be read for {SPAN_S:g} s")
        return
    judge.check(
        "rest-resources/pose-clock",
        clock.is_right(scale),
        robot.get(POSE),
        f"stamps that advance by {scale:g} s each second, within 5 %",
        found=f"{rate:.3f} s each second, over {clock.span_s:.1f} s",
        cause="another rate",
    )
    judge.check(
        "rest-resources/pose-clock",
        not clock.stands_between(scale),
        robot.get(POSE),
        "nanoseconds that advance with real time within a second",
        found=f"{clock.fine_rate or 0.0:.2g} times as fast within a second",
        cause="below a second",
    )


@pytest.mark.phase("reading")
@pytest.mark.requirement(
    "rest-resources/sensors-type",
    "rest-resources/sensors-unique",
    "rest-resources/sensors-named-in-full",
    "rest-resources/sensors-stable",
)
def test_sensors(robot: Robot, judge: Judge, effort: Effort) -> None:
    """Check each reading: {name, topic, type} without duplicates, and the same list each time."""
    _read_often(robot, judge, "sensors", SENSORS, SENSORS_SHAPE, effort.cases(100))


@pytest.mark.phase("reading")
@pytest.mark.requirement(
    "rest-resources/services-type",
    "rest-resources/services-unique",
    "rest-resources/services-named-in-full",
    "rest-resources/services-stable",
)
def test_services(robot: Robot, judge: Judge, effort: Effort) -> None:
    """Check each reading: {name, type} without duplicates, and the same list each time."""
    _read_often(robot, judge, "services", SERVICES, SERVICES_SHAPE, effort.cases(100))


def _read_often(robot: Robot, judge: Judge, what: str, path: str, shape: Shape, times: int) -> None:
    fields = "{name, topic, type}" if what == "sensors" else "{name, type}"
    before: list[str] | None = None
    for _ in range(times):
        exchange = robot.get(path)
        entries, problem = read_as(exchange.response, shape)
        holds = judge.check(
            f"rest-resources/{what}-type", not problem, exchange, f"status 200 with a list of {fields}", found=problem
        )
        if not holds:
            continue
        listed = entries_of(entries, tuple(shape.schema["items"]["properties"]))
        if before is not None:
            judge.check(
                f"rest-resources/{what}-stable",
                listed == before,
                exchange,
                "the same list as before",
                found=f"{len(before)} entries, then {len(listed)}; {len(set(before) ^ set(listed))} differ",
                cause="another list",
            )
        before = listed
