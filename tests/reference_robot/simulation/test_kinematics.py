"""The body's motion: limits hold, settling is quick, arcs are exact, walls are solid."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from reference_robot.kinematics import KINEMATICS
from reference_robot.simulation.realism import MAX_ANGULAR, MAX_LINEAR, Motion, advance, wrap

speeds = st.floats(-10, 10)
steps = st.floats(0.001, 0.5)


def anywhere(_x, _y):
    return True


def nowhere(_x, _y):
    return False


@given(st.lists(st.tuples(speeds, speeds, steps), max_size=30))
def test_velocity_never_exceeds_the_limits(commands):
    motion = Motion(0, 0, 0)
    for linear, angular, seconds in commands:
        motion = advance(motion, (linear, angular), seconds, anywhere)
        assert abs(motion.linear) <= MAX_LINEAR
        assert abs(motion.angular) <= MAX_ANGULAR
        assert -math.pi <= motion.yaw <= math.pi


@given(st.floats(-0.7, 0.7), st.floats(-0.7, 0.7), st.floats(-2.5, 2.5), st.floats(-2.5, 2.5))
def test_any_velocity_follows_any_other_within_the_settle_time(from_v, to_v, from_w, to_w):
    motion = Motion(0, 0, 0, from_v, from_w)
    for _ in range(23):  # 0.46 s at 50 Hz
        motion = advance(motion, (to_v, to_w), 0.02, anywhere)
    assert (motion.linear, motion.angular) == (to_v, to_w)


@given(st.floats(-0.7, 0.7), st.floats(-2.5, 2.5), st.integers(1, 50))
def test_an_arc_is_the_same_in_one_step_or_in_many(linear, angular, pieces):
    whole = advance(Motion(1, 2, 0.5, linear, angular), (linear, angular), 1.0, anywhere)
    motion = Motion(1, 2, 0.5, linear, angular)
    for _ in range(pieces):
        motion = advance(motion, (linear, angular), 1.0 / pieces, anywhere)
    assert math.dist((motion.x, motion.y), (whole.x, whole.y)) < 1e-6
    assert abs(wrap(motion.yaw - whole.yaw)) < 1e-9


def test_a_full_circle_comes_back():
    motion = Motion(0, 0, 0, 0.5, 1.0)
    for _ in range(100):
        motion = advance(motion, (0.5, 1.0), math.tau / 100, anywhere)
    assert (motion.x, motion.y, motion.yaw) == pytest.approx((0, 0, 0), abs=1e-9)


def test_against_a_wall_the_body_stays_its_wheels_turn_and_it_can_turn():
    motion = advance(Motion(3, 4, 0, 0.5), (0.5, 0.0), 0.1, nowhere)
    assert (motion.x, motion.y, motion.linear) == (3, 4, 0.5)
    assert advance(Motion(3, 4, 0), (0.0, 2.0), 0.1, nowhere).yaw > 0


@pytest.mark.parametrize(
    ("body", "setpoint", "velocity"),
    [
        ("differential", (-0.5, 1.0, 0.3), (-0.5, 1.0, 0.0)),
        ("no-reverse", (-0.5, 1.0, 0.0), (0.0, 1.0, 0.0)),
        ("holonomic", (0.5, 1.0, -0.9), (0.5, 1.0, -0.5)),
        ("ackermann", (-0.3, 2.0, 0.0), (-0.3, 1.0, 0.0)),
        ("ackermann", (0.0, 2.0, 0.0), (0.0, 0.0, 0.0)),
    ],
)
def test_a_body_drives_what_it_can(body, setpoint, velocity):
    motion = Motion(0, 0, 0)
    for _ in range(30):
        motion = advance(motion, setpoint, 0.02, anywhere, KINEMATICS[body])
    assert (motion.linear, motion.angular, motion.lateral) == pytest.approx(velocity)


def test_a_body_that_moves_aside_does_so_across_its_heading():
    motion = advance(Motion(1, 2, math.pi / 2, lateral=0.5), (0.0, 0.0, 0.5), 0.1, anywhere, KINEMATICS["holonomic"])
    assert (motion.x, motion.y) == pytest.approx((0.95, 2.0))
