import numpy as np
import pytest
from hdrh.histogram import HdrHistogram
from hypothesis import given, settings
from hypothesis import strategies as st

from loadtests.statistics.histogram import BINS, HIGHEST_US, Histogram, bins_of, edges_us
from loadtests.statistics.modes import modes
from loadtests.statistics.recorder import Recorder

durations = st.lists(st.integers(0, 2 * HIGHEST_US * 1000), max_size=60)


@settings(deadline=None)
@given(st.lists(st.integers(0, HIGHEST_US), min_size=1))
def test_bins_are_those_of_hdrhistogram(values):
    reference = HdrHistogram(1, HIGHEST_US, 3)
    bins = bins_of(np.array(values))
    assert bins.tolist() == [reference._counts_index_for(value) for value in values]  # noqa: SLF001 -- no public way to ask
    lower, width = edges_us(bins)
    assert (lower <= values).all()
    assert (values < lower + width).all()
    assert (width <= np.maximum(1, lower // 1000)).all()
    assert bins.max() < BINS


@settings(deadline=None)
@given(st.lists(durations, max_size=6))
def test_merged_is_the_union(parts):
    merged = Histogram()
    for part in parts:
        merged.merge(Histogram.unpack(Histogram.of(part).pack()))
    union = Histogram.of([value for part in parts for value in part])
    assert merged.pack() == union.pack()


@settings(deadline=None)
@given(durations.filter(bool))
def test_other_readers_find_the_same_in_the_encoded_histogram(values):
    decoded = HdrHistogram.decode(Histogram.of(values).encode())
    reference = HdrHistogram(1, HIGHEST_US, 3)
    for value in values:
        reference.record_value(min(value // 1000, HIGHEST_US))
    assert decoded.get_total_count() == len(values)
    for percentile in (0, 50, 90, 99.9, 100):
        assert decoded.get_value_at_percentile(percentile) == reference.get_value_at_percentile(percentile)


@settings(deadline=None)
@given(st.lists(st.integers(0, 10_000_000_000), min_size=1, max_size=200), st.floats(0.0, 1.0))
def test_quantiles_lie_within_a_bin_of_the_exact_ones(values, quantile):
    histogram = Histogram.of(values)
    exact = np.quantile(values, quantile, method="inverted_cdf") / 1e6
    found = histogram.quantile_ms(quantile)
    assert histogram.lowest_ns / 1e6 <= found <= histogram.highest_ns / 1e6
    assert abs(found - exact) <= 0.001 + exact * 0.0011


def test_mean_and_extremes_are_exact():
    histogram = Histogram.of([1_234_567, 7_654_321])
    assert histogram.mean_ms() == (1_234_567 + 7_654_321) / 2e6
    assert (histogram.lowest_ns, histogram.highest_ns) == (1_234_567, 7_654_321)
    assert Histogram().mean_ms() is None
    assert Histogram().quantile_ms(0.5) is None


FIGURES = (st.integers(*bounds) for bounds in ((0, 3), (0, 1), (0, 10**9), (0, 10**9), (-1, 10**7)))
requests = st.lists(st.tuples(*FIGURES, st.booleans(), st.sampled_from(["", "closed", "timeout"])), max_size=40)
SERIES = {0: 4, 1: 6, 2: 4, 3: 5}


def recorded(events):
    recorder = Recorder(SERIES)
    for segment, operation, lag, service, server, queued, error in events:
        if error:
            recorder.fail(segment, operation, error, f"{error} of {lag}", lag)
            recorder.count("connects")
        else:
            start, noticed = 10**10 + lag, (10**10 + lag // 2) * queued
            received = start + service // 2
            recorder.record(
                segment, operation, 10**10, start, start, received, start + service, server, noticed=noticed
            )
    return recorder


@settings(max_examples=60, deadline=None)
@given(st.lists(requests, max_size=4))
def test_workers_reports_merge_into_the_union(shares):
    merged = Recorder()
    for share in shares:
        worker = recorded(share)
        merged.merge(Recorder.unpack(worker.take()))
        assert not worker.cells, "what was handed over is not kept"
    whole = Recorder()
    whole.merge(Recorder.unpack(recorded([event for share in shares for event in share]).take()))
    found, wanted = (canonical(recorder) for recorder in (merged, whole))
    assert found == wanted


def canonical(recorder):
    packed = recorder.take()
    for failure in packed["failures"]:
        failure[3] = ""  # of two that came first at the same time either may stand for its kind
    return {
        key: sorted(map(repr, value)) if isinstance(value, list) else sorted(value.items())
        for key, value in packed.items()
    }


def test_spans_add_up_to_the_service_time():
    recorder = Recorder({0: 4})
    for number in range(1000):
        start = number * 10**6
        recorder.record(0, 0, start - 50_000, start, start + 2_000, start + 90_000, start + 100_000, 30_000)
    recorder.flush()
    spans, cell = recorder.spans[4, 0], recorder.cells[0, 0]
    parts = sum(getattr(spans, name).sum_ns for name in ("build", "wire", "server", "parse"))
    assert parts == cell.service.sum_ns == 1000 * 100_000
    assert (cell.response.sum_ns, spans.lag.sum_ns) == (1000 * 150_000, 1000 * 50_000)


def test_memory_does_not_grow_with_the_number_of_requests():
    recorder = Recorder({0: 4})
    sizes = []
    for _ in range(6):
        for number in range(40_000):
            noise = (number * 7919) % 100_000
            recorder.record(0, 0, 0, 1_000, 2_000, 60_000 + noise, 70_000 + noise, -1)
        recorder.flush()
        sizes.append((len(recorder.cells[0, 0].service.arrays()[0]), len(recorder._buffer)))  # noqa: SLF001 -- its size is the point
    assert sizes[-1] == sizes[0], sizes


def test_errors_without_end_are_kept_in_bounded_kinds():
    recorder = Recorder({0: 4})
    for number in range(5000):
        recorder.fail(0, 0, f"kind {number}", "x", number)
    assert len(recorder.failures) <= 101
    assert sum(failure.count for failure in recorder.failures.values()) == 5000


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
