"""Journeys to the application, made up: what never arrived counts."""

import pytest

from loadtests.statistics.end_to_end import ways

WAITED_NS = 2_000_000_000


def found(arrivals, errors=0):
    """The entries of ways that take milliseconds; the last one has the errors."""
    nanoseconds = {
        way: [None if time is None else int(time * 1e6) for time in times] for way, times in arrivals.items()
    }
    counts = dict.fromkeys(arrivals, 0) | {list(arrivals)[-1]: errors}
    return {entry["interface"]: entry for entry in ways(nanoseconds, nanoseconds, counts, WAITED_NS)}


def test_a_way_that_loses_what_it_is_slow_at_is_not_quick():
    entry = found({"rest": [1.0] * 45 + [None] * 55}, errors=5)["rest"]
    assert (entry["count"], entry["lost"], entry["errors"]) == (45, 50, 5)
    assert entry["to_application_ms"]["p50"] == pytest.approx(2000, rel=2e-3)
    assert entry["at_least"] == ["mean", "p50", "p90", "p95", "max"]
    assert entry["over_rest"] is None


def test_few_lost_ones_stand_for_the_tail_alone():
    entry = found({"rest": [1.0] * 970 + [None] * 30})["rest"]
    assert entry["to_application_ms"]["p50"] == pytest.approx(1.0, rel=2e-3)
    assert entry["at_least"] == ["mean", "p99", "max"]
    assert found({"rest": [1.0] * 100})["rest"]["at_least"] == []


def test_the_ratio_is_of_neighbours_and_counts_what_never_arrived_as_longer_than_any():
    rest = [1.0, 2.0, 4.0, 8.0] * 10
    soap = [3 * time for time in rest]
    entry = found({"rest": rest, "soap": soap})["soap"]["over_rest"]
    assert entry == {"ratio": pytest.approx(3.0), "ci95": pytest.approx([3.0, 3.0])}
    many = found({"rest": rest, "soap": [*soap[:10], *[None] * 30]})["soap"]["over_rest"]
    assert many == {"ratio": None, "ci95": None}
    some = found({"rest": rest, "soap": [*soap[:35], *[None] * 5]})["soap"]["over_rest"]
    assert some["ratio"] == pytest.approx(3.0)


def test_too_few_journeys_have_no_interval_and_none_have_no_ratio():
    few = found({"rest": [1.0] * 5, "soap": [2.0] * 5})["soap"]
    assert few["over_rest"] == {"ratio": pytest.approx(2.0), "ci95": None}
    nothing = found({"rest": [None] * 5, "soap": [None] * 5})["soap"]
    assert (nothing["over_rest"], nothing["count"]) == ({"ratio": None, "ci95": None}, 0)
