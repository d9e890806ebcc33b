"""Distributions out of HDR histograms."""

import numpy as np
import pytest
from hdrh.histogram import HdrHistogram

from reports.errors import ResultInvalidError
from reports.latency.distributions import all_series, distribution


def encoded(values_us):
    histogram = HdrHistogram(1, 3_600_000_000, 3)
    for value in values_us:
        histogram.record_value(int(value))
    return histogram.encode().decode()


def test_quantiles_are_those_of_the_values():
    values = np.random.default_rng(1).lognormal(4.5, 0.5, 20_000).astype(int) + 1
    found = distribution(encoded(values), "here")
    at = np.asarray([0.0, 0.1, 0.5, 0.9, 0.99, 0.999, 1.0])
    assert found.total == len(values)
    # A microsecond bucket each, up to 2 ms: only the half microsecond of rounding is between them.
    assert found.quantiles(at) * 1000 == pytest.approx(np.quantile(values, at), abs=1.0)


def test_wide_buckets_keep_three_digits():
    found = distribution(encoded([1_234_567] * 10), "here")
    assert found.quantiles(np.asarray([0.5]))[0] == pytest.approx(1234.567, rel=1e-3)


def test_one_value():
    found = distribution(encoded([100]), "here")
    assert found.quantiles(np.asarray([0.0, 0.5, 1.0])) == pytest.approx([0.0995, 0.1, 0.1005])


def test_highest_supported_quantile_is_that_of_the_producer(latency):
    # The example's producer says that 3688 values support the 99.9th percentile, and fewer do not.
    assert distribution(encoded([5] * 3688), "here").highest_supported >= 0.999
    assert distribution(encoded([5] * 3687), "here").highest_supported < 0.999
    assert any("needs 3688" in r for s in latency["series"] for r in s.get("reasons", {}).values())


def test_nothing_recorded():
    assert distribution("", "here") is None
    assert distribution(encoded([]), "here") is None


@pytest.mark.parametrize("bad", ["x", "HISTFAAAA", "!!!!", "AAAA" * 20, "HISTFAAAAIt4nJNpmSzMwMBQzAABzFCaEcyZ3M5g"])
def test_bad_histogram_is_told_with_its_place(bad):
    with pytest.raises(ResultInvalidError, match=r"latency.json: at \$.series\[3\]"):
        distribution(bad, "latency.json: at $.series[3].histogram")


def test_series_hold_what_they_count(latency):
    for series in all_series(latency, "latency.json").values():
        assert series.service.total == series.data["count"]
        median = series.service.quantiles(np.asarray([0.5]))[0]
        assert median == pytest.approx(series.data["service_ms"]["p50"], rel=0.03, abs=0.002)
