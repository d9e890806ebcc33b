"""Service levels: the interval of a share, and what is known at which rate."""

import numpy as np
import pytest

from loadtests.statistics.service_levels import BROKEN, KEPT, NOT_KNOWN, _outcome, share_interval


def test_without_bursts_the_interval_is_that_of_clopper_and_pearson():
    low, high = share_interval([(1, 100), (2, 100), (0, 100)])
    assert (low, high) == (
        pytest.approx(0.0020670072350923),
        pytest.approx(0.0289445112556927),
    )  # scipy.stats.binomtest
    assert share_interval([(0, 0)]) is None
    assert share_interval([(0, 3700)])[1] < 0.001 < share_interval([(0, 3600)])[1]
    assert share_interval([(50, 50)])[0] == pytest.approx(0.025 ** (1 / 50))


def test_failures_in_bursts_say_less():
    spread = [(1, 20)] * 40
    bursts = [(20 if place in {3, 4} else 0, 20) for place in range(40)]
    wide, narrow = share_interval(bursts), share_interval(spread)
    assert wide[0] < narrow[0] < narrow[1] < wide[1]
    assert wide[1] - wide[0] > 2 * (narrow[1] - narrow[0])


def test_the_interval_holds_the_share_as_often_as_it_says_even_if_failures_come_in_bursts():
    rng = np.random.default_rng(1)
    held = 0
    for _ in range(200):
        bad = np.repeat(rng.random(60) < 0.1, 2)  # bursts of two blocks, in which half of the requests fail
        low, high = share_interval([(rng.binomial(20, 0.5 if one else 0.0), 20) for one in bad])
        held += low <= 0.05 <= high
    assert held >= 184, "95 % of 200, less two standard deviations"


@pytest.mark.parametrize(
    ("interval", "rate", "at_rate", "outcome", "why"),
    [
        ((0.0, 0.01), 100.0, None, KEPT, ""),
        ((0.0, 0.01), 100.0, 101.0, KEPT, ""),
        ((0.0, 0.01), 50.0, 100.0, NOT_KNOWN, "at 50 requests/s, and the level is for 100"),
        ((0.0, 0.01), 200.0, 100.0, KEPT, ""),
        ((0.011, 0.02), 200.0, 100.0, NOT_KNOWN, "at 200 requests/s, and the level is for 100"),
        ((0.011, 0.02), 50.0, 100.0, BROKEN, ""),
        ((0.001, 0.02), 100.0, 100.0, NOT_KNOWN, "measure longer"),
        (None, 100.0, None, NOT_KNOWN, ""),
    ],
)
def test_a_level_is_known_only_at_its_own_rate(interval, rate, at_rate, outcome, why):
    found = _outcome(interval, 0.01, rate, at_rate)
    assert found[0] == outcome
    assert why in found[1]
