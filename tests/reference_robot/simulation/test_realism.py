"""A robot like a real one: what its seed decides, and within which bounds."""

import itertools
import math
import statistics

import pytest
from hypothesis import given
from hypothesis import strategies as st

from reference_robot.simulation.realism import IMPERFECT, Delayed, Motion, Realism, advance

seeds = st.integers(0, 10_000)


def driven(seed: int, setpoint: tuple[float, float], seconds: float = 10.0) -> tuple[list[Motion], list[Motion]]:
    """Where the body is and where the robot believes to be, fifty times a second."""
    realism = Realism(seed)
    body = belief = Motion(0.0, 0.0, 0.0)
    bodies, beliefs = [], []
    for _ in range(int(seconds * 50)):
        after = advance(body, setpoint, 0.02, lambda _x, _y: True, IMPERFECT)
        before, body = body, realism.slipped(body, after)
        belief = realism.estimate(belief, before, after, body, 0.02)
        bodies.append(body)
        beliefs.append(belief)
    return bodies, beliefs


@given(seeds)
def test_a_seed_is_a_robot(seed):
    character = Realism(seed).character
    assert character == Realism(seed).character
    assert 5 <= character.odometry_hz <= 20
    assert 0 <= character.slip <= 0.03
    assert 0.05 <= Realism(seed).lateness() <= 0.2


def test_belief_goes_astray_by_little_and_is_put_right_with_a_jump():
    off = {seed: [math.dist(one[:2], two[:2]) for one, two in trace(seed)] for seed in range(10)}
    assert all(max(one) < 1.0 for one in off.values())
    assert all(max(one) > 0.01 for one in off.values())
    steps = [math.dist(one[:2], two[:2]) for seed in off for one, two in pairs(seed)]
    assert sum(step > 0.05 for step in steps) > 3


def places(motions: list[Motion]) -> list[tuple[float, float]]:
    return [(one.x, one.y) for one in motions]


def trace(seed: int) -> list[tuple[tuple[float, float], tuple[float, float]]]:
    bodies, beliefs = driven(seed, (0.5, 0.3), 30.0)
    return list(zip(places(bodies), places(beliefs), strict=True))


def pairs(seed: int) -> list[tuple[tuple[float, float], tuple[float, float]]]:
    return list(itertools.pairwise(places(driven(seed, (0.5, 0.3), 30.0)[1])))


@pytest.mark.parametrize("belief", [Motion(1.0, 2.0, 3.0), Motion(1.0, 2.0, 3.0, 0.7, -2.5)])
def test_noise_is_what_the_statement_declares(belief):
    realism = Realism(1)
    samples = [realism.noisy(belief) for _ in range(2000)]
    still = not belief.linear
    for name, most in (("x", 0.005), ("linear", 0.005 if still else 0.015), ("angular", 0.012 if still else 0.04)):
        values = [getattr(one, name) for one in samples]
        assert statistics.fmean(values) == pytest.approx(getattr(belief, name), abs=most / 5)
        assert 0 < statistics.stdev(values) < most


def test_commands_arrive_in_their_order_and_the_newest_counts():
    delayed = Delayed()
    delayed.send(2.0, (0.1, 0.0))
    delayed.send(1.0, (0.2, 0.0))
    delayed.send(3.0, (0.3, 0.0))
    assert delayed.take_arrived(1.5) is None
    assert delayed.take_arrived(2.5) == (2.0, (0.2, 0.0))
    assert delayed.take_arrived(9.0) == (3.0, (0.3, 0.0))
    assert delayed.take_arrived(9.0) is None
