"""What a robot is told to drive, and whether it is reached in time, also where whoever looks is held up."""

import pytest
from clocked import SAMPLE_S, SETTLE_S, WANTED, Body, Drive
from driven_device import SimulatedClock
from hypothesis import given
from hypothesis import strategies as st

from conformance.packs.table1.limits import DeclaredLimits
from conformance.packs.table1.robot.robot import STILL, drivable, handiest, turn_beside
from conformance.packs.table1.statement import Motion

_CONVERGES = "rest-resources/velocity-converges"


def _judged(
    takes_s: float, looks: dict[int, float] | None = None, hold_s: float = 10.0, *, loses: bool = False
) -> bool:
    """Whether a robot that takes so long is said to have reached the velocity."""
    clock = SimulatedClock()
    driven = Drive(Body(clock, takes_s, hold_s, loses=loses), looks or {}, hold_s)
    driven.tell()
    driven.reach(WANTED, _CONVERGES)
    return driven.judged[_CONVERGES]


@pytest.mark.parametrize("takes_s", [0.5 * SETTLE_S, SETTLE_S - SAMPLE_S, SETTLE_S])
def test_a_velocity_is_reached_in_its_settle_time_and_seen_with_the_next_odometry(takes_s):
    assert _judged(takes_s)


@pytest.mark.parametrize("late_s", [0.6, 0.7, 0.8, 1.2, 3.0])
def test_samples_from_within_the_settle_time_say_nothing_of_a_robot_that_was_looked_at_too_late(late_s):
    # Fifty looks while it still had time, then nothing until after the end.
    assert _judged(SETTLE_S, {50: late_s})


def test_one_that_ends_again_and_again_before_it_can_be_renewed_is_not_blamed():
    clock = SimulatedClock()
    driven = Drive(Body(clock, SETTLE_S, 0.3), dict.fromkeys(range(400), 0.4), 0.3)
    driven.tell()
    assert not driven.reach(WANTED, _CONVERGES)
    assert driven.judged == {}


def test_a_velocity_that_ended_because_it_was_renewed_too_late_has_its_settle_time_again():
    assert _judged(SETTLE_S, {5: 1.6}, hold_s=1.0)


@pytest.mark.parametrize("hold_s", [1.65, 10.0])
def test_a_command_that_was_lost_is_not_made_up_for_by_its_renewal(hold_s):
    assert not _judged(0.1 * SETTLE_S, hold_s=hold_s, loses=True)


@pytest.mark.parametrize("looks", [{}, {50: 0.6}, {5: 1.6}, dict.fromkeys(range(100), 0.7)])
@pytest.mark.parametrize("hold_s", [1.0, 10.0])
def test_a_robot_that_takes_twice_its_settle_time_is_refuted(looks, hold_s):
    assert not _judged(3 * SETTLE_S, looks, hold_s)


def test_rest_that_no_velocity_brings_about_is_waited_for_as_long():
    # A goal was cancelled: there is no command to be renewed.
    clock = SimulatedClock()
    body = Body(clock, 0.0, 10.0)
    body.tell()
    driven = Drive(body, {}, 1.0)
    driven.reach(STILL, "safety/cancel", since=clock.now())
    assert (driven.judged, driven.trace.commands) == ({"safety/cancel": False}, ())


@pytest.mark.parametrize(("usual_s", "judged"), [(0.2, {_CONVERGES: False}), (0.3, {}), (0.4, {})])
def test_what_ends_before_it_can_be_read_is_not_held_against_the_robot(usual_s, judged):
    clock = SimulatedClock()
    driven = Drive(Body(clock, 20 * SETTLE_S, 1.0), dict.fromkeys(range(100), 3 * usual_s), 1.0, usual_s)
    driven.tell()
    assert not driven.reach(WANTED, _CONVERGES)
    assert driven.judged == judged
    assert driven.trace.reaches[-1].outlasted is not bool(judged)


LIMITS = DeclaredLimits(linear_m_s=0.7, angular_rad_s=2.5).resolve()
ONE_WAY = DeclaredLimits(linear_m_s=(0.0, 0.7), angular_rad_s=(-1.0, 2.5)).resolve()
PLAIN, CAR = Motion(), Motion(turns_on_the_spot=False, min_radius_m=0.5)
COUPLED = Motion(wheel_separation_m=0.4)
speeds = st.floats(-3, 3)


@pytest.mark.parametrize(
    ("limits", "motion", "wanted", "driven"),
    [
        (LIMITS, PLAIN, (0.3, 0.2, 0, 0, 0, -1), (0.3, 0, 0, 0, 0, -1)),
        (LIMITS, PLAIN, (0, 0, 0, 0, 0, 1), (0, 0, 0, 0, 0, 1)),
        (LIMITS, Motion(actuated=("linear.y",)), (0.3, -0.2, 0, 0, 0, 1), (0, -0.2, 0, 0, 0, 0)),
        (ONE_WAY, PLAIN, (-0.3, 0, 0, 0, 0, -2), (0.3, 0, 0, 0, 0, -1)),
        (LIMITS, CAR, (0, 0, 0, 0, 0, -1), (0.51, 0, 0, 0, 0, -1)),
        (LIMITS, CAR, (-0.1, 0, 0, 0, 0, 1), (-0.51, 0, 0, 0, 0, 1)),
        (LIMITS, CAR, (0.7, 0, 0, 0, 0, 1), (0.7, 0, 0, 0, 0, 1)),
        (LIMITS, COUPLED, (0.7, 0, 0, 0, 0, 2.5), (0.7 * 0.7 / 1.2, 0, 0, 0, 0, 2.5 * 0.7 / 1.2)),
        (LIMITS, COUPLED, (0.7, 0, 0, 0, 0, 0), (0.7, 0, 0, 0, 0, 0)),
    ],
)
def test_what_it_cannot_drive_becomes_what_it_can(limits, motion, wanted, driven):
    assert drivable(limits, motion, wanted) == pytest.approx(driven)


@given(st.sampled_from((LIMITS, ONE_WAY)), st.sampled_from((PLAIN, CAR, COUPLED)), st.tuples(*[speeds] * 6))
def test_what_it_can_drive_stays_as_it_is(limits, motion, wanted):
    driven = drivable(limits, motion, wanted)
    assert drivable(limits, motion, driven) == pytest.approx(driven)
    for component, value in enumerate(driven):
        least, greatest = limits.range_of(component)
        assert least <= value <= greatest
    assert abs(driven[0]) >= (motion.min_radius_m or 0) * abs(driven[5])
    assert abs(driven[0]) + abs(driven[5]) * (motion.wheel_separation_m or 0) / 2 <= 0.7 + 1e-9 or motion is not COUPLED


def test_beside_a_slow_drive_it_turns_slowly():
    assert turn_beside(LIMITS, CAR, -0.1, -2.0) == pytest.approx(-0.1 / 0.51)
    assert turn_beside(LIMITS, COUPLED, 0.5, 2.0) == pytest.approx(1.0)
    assert turn_beside(LIMITS, PLAIN, 0.0, 2.0) == 2.0


def test_a_robot_moves_by_turning_if_it_can():
    assert handiest(PLAIN) == 5
    assert handiest(Motion(actuated=("linear.y", "linear.x"))) == 0
