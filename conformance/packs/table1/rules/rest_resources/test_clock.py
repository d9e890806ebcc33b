"""The rate of the robot's clock, by all odometry stamps of the run."""

import pytest

from conformance.observe.clock import poll_for
from conformance.packs.table1.robot.clock import SPAN_S, Clock
from conformance.packs.table1.robot.robot import POSE, Robot
from conformance.verdict.evidence import Judge

# Late in a run: its stamps show more the longer the run has lasted.
pytestmark = [pytest.mark.phase("acting"), pytest.mark.needs("rest")]
_STEP_S = 0.1
# _OFF_S: error that the clock may have. _OLD_S: age that odometry may have. _UNIT_S: resolution of Date, s.
_OFF_S, _OLD_S, _UNIT_S = 5.0, 1.0, 1.0


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
        f"a clock that goes {scale:g} times as fast as the one on the wall, within 5 %",
        found=f"{rate:.3f} times as fast over {clock.span_s:.1f} s",
        cause="another rate",
    )
    judge.check(
        "rest-resources/pose-clock",
        not clock.stands_between(scale),
        robot.get(POSE),
        "nanoseconds that advance as the time does within a second",
        found=f"{clock.fine_rate or 0.0:.2g} times as fast within a second",
        cause="below a second",
    )
