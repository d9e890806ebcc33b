"""Two modes are seen where there are two, and only there."""

import numpy as np
import pytest

from loadtests.statistics.histogram import Histogram
from loadtests.statistics.modes import modes


def histogram(*parts):
    return Histogram.of(int(time * 1e6) for time in np.concatenate(parts))


@pytest.mark.parametrize("share", [0.1, 0.25, 0.6])
def test_a_second_mode_is_seen_with_its_share_and_its_place(share):
    rng, many = np.random.default_rng(1), 4000
    quick = rng.lognormal(np.log(0.07), 0.2, round(many * (1 - share)))
    slow = rng.lognormal(np.log(0.5), 0.3, round(many * share))
    found = modes(histogram(quick, slow))
    assert found["share_above"] == pytest.approx(share, abs=0.01)
    assert 0.1 < found["split_ms"] < 0.4
    assert found["medians_ms"] == pytest.approx([0.07, 0.5], rel=0.1)


def test_one_mode_is_no_two_whatever_its_tail():
    rng = np.random.default_rng(2)
    shapes = (
        lambda: rng.lognormal(np.log(0.07), 0.4, 1000),
        lambda: 0.05 + rng.exponential(0.03, 500),
        lambda: 0.05 + rng.pareto(2.5, 2000) * 0.02,
        lambda: rng.uniform(0.06, 0.09, 300),
    )
    assert [modes(histogram(shape()))["split_ms"] for shape in shapes for _ in range(10)] == [None] * 40
    assert modes(histogram(shapes[2]()))["beyond_five_medians"] > 0
    assert modes(histogram(shapes[0]()[:50])) is None, "too few to say"
