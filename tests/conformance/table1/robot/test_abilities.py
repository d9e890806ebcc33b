"""What a robot is told to drive is within what its statement says that it can drive."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from conformance.packs.table1.limits import DeclaredLimits
from conformance.packs.table1.robot.robot import drivable, handiest, turn_beside
from conformance.packs.table1.statement import Motion

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
