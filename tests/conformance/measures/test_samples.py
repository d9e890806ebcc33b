"""What several samples show together: slopes, noise, and what goes on and on."""

import math
import random
from dataclasses import dataclass

import pytest

from conformance.measures.samples import Noise, goes_on, longest_s, middle, slope, usual_s


@dataclass
class _Timed:
    sent: float
    received: float


_READINGS = [_Timed(0.0, 0.1), _Timed(1.0, 1.2), _Timed(2.0, 5.0)]


def test_one_slow_response_is_the_longest_and_not_the_usual_one():
    assert (usual_s(_READINGS), longest_s(_READINGS)) == (pytest.approx(0.2), 3.0)
    assert (usual_s([]), longest_s([])) == (0.0, 0.0)


def test_one_value_far_off_does_not_change_a_median_or_a_slope():
    assert middle([(0.0, 1.0), (0.1, 1.0), (90.0, 1.0)]) == (0.1, 1.0)
    line = [(0.1 * step, 0.3 * step) for step in range(20)]
    assert slope(line) == pytest.approx(3.0)
    line[19] = (1.9, -50.0)
    assert slope(line) == pytest.approx(3.0)


@pytest.mark.parametrize("samples", [[], [(1.0, 2.0)], [(1.0, 2.0), (1.0, 3.0)]])
def test_one_moment_has_no_slope(samples):
    assert slope(samples) is None


def test_the_noise_of_a_sample_is_seen_and_at_least_what_is_declared():
    chance = random.Random(1)  # noqa: S311 - no secret
    values = [chance.gauss(0.5, 0.02) for _ in range(400)]
    assert Noise.of(values) == (pytest.approx(0.5, abs=0.01), pytest.approx(0.02, rel=0.2))
    assert Noise.of([0.0] * 9, 0.01) == (0.0, 0.01)
    assert Noise.of([]) == (0.0, 0.0)


def test_samples_that_repeat_one_value_are_one():
    noise = Noise(0.0, 0.01)
    assert noise.room([(0.01 * step, 5.0) for step in range(16)]) == pytest.approx(0.04)
    assert noise.room([(0.01 * step, float(step)) for step in range(16)]) == pytest.approx(0.01)


def _of(value, lasts_s=1.5, sigma=0.0, seed=0):
    chance = random.Random(seed)  # noqa: S311 - no secret
    return [(step * 0.02, value(step * 0.02) + chance.gauss(0, sigma)) for step in range(int(lasts_s / 0.02))]


@pytest.mark.parametrize(
    ("value", "found"),
    [
        (lambda t: 0.02 * t, 0.02),
        (lambda t: -0.02 * t, -0.02),
        (lambda _: 1.0, 0.0),
        (lambda t: 0.7 * math.exp(-t / 0.2), 0.0),  # it comes to rest
        (lambda t: 0.02 * math.sin(5 * t), 0.0),  # it sways
        (lambda t: 0.5 if t > 0.7 else 0.0, 0.0),  # it jumps, as when a position is corrected
    ],
)
def test_what_goes_on_and_on_is_told_from_what_settles_or_sways(value, found):
    assert goes_on(_of(value), slope, lambda _: 0.005) == pytest.approx(found)


@pytest.mark.parametrize("seed", range(20))
def test_noise_alone_does_not_go_on(seed):
    noise = Noise(0.0, 0.004)
    assert goes_on(_of(lambda _: 0.0, 1.5, 0.004, seed), slope, noise.slope_room) == 0.0
