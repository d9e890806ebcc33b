"""Detect two modes in a series, which quantiles and intervals hide: half of the requests may take ten times as long.

The test is Silverman's (Using kernel density estimates to investigate multimodality, JRSS B 43, 1981) on the logarithm
of the service times, read from the histogram at evenly spaced quantiles. In thousands of samples it finds insignificant
bumps too: two modes are reported only if there is a valley between them, with enough on both sides.
"""

from typing import Any

import numpy as np
from scipy.ndimage import gaussian_filter1d

from loadtests.statistics.figures import name_fields, rounded
from loadtests.statistics.histogram import Floats, Histogram, edges_us, quantiles_us
from loadtests.statistics.measured import Measured

_FEWEST, _POINTS = 100, 2000
_SIGNIFICANCE = 0.01
_RESAMPLED = 200
# Share of values at each end that is ignored, because Silverman's test takes a single slow request for a mode.
_TAIL = 0.01
_CELLS = 512
_BINS = 60
_VALLEY = 0.6  # of the lower peak, at most
_LEAST_SHARE = 0.02
_LEAST_RATIO = 1.5  # of the two sides' medians
_FAR = 5.0  # medians
_COLUMNS, _ROWS = 40, 24  # of the heat map: as many as a page can draw without a picture in it


def modes(histogram: Histogram) -> dict[str, Any] | None:
    """Return the `modes` of a series of latency.json; None where there are too few samples."""
    if histogram.total < _FEWEST:
        return None
    times = _quantiles_ms(histogram, min(_POINTS, histogram.total))
    p_value = _p_of_one_mode(np.log(times))
    median = float(np.median(times))
    split = _valley_ms(times) if p_value < _SIGNIFICANCE else None
    above = None if split is None else float((times > split).mean())
    return {
        "beyond_five_medians": rounded(_share_above(histogram, _FAR * median)),
        "p_value": rounded(p_value),
        "split_ms": rounded(split),
        "share_above": rounded(above),
        "medians_ms": None
        if split is None
        else [rounded(float(np.median(side))) for side in (times[times <= split], times[times > split])],
    }


def _p_of_one_mode(logs: Floats) -> float:
    """Return the p-value of Silverman's test that sorted values have one mode: the share of samples that have more.

    The samples are drawn from the density with the narrowest Gaussian kernel that leaves the values one mode.
    """
    logs = logs[round(_TAIL * len(logs)) : round((1 - _TAIL) * len(logs))]
    spread, width = float(logs.std()), float(np.ptp(logs))
    if spread <= 0:
        return 1.0
    edges = np.linspace(logs[0] - width, logs[-1] + width, _CELLS + 1)
    cell = 3 * width / _CELLS

    def is_one(values: Floats, kernel: float) -> bool:
        counts = np.histogram(values, edges)[0].astype(np.float64)
        rises = np.diff(gaussian_filter1d(counts, kernel / cell, truncate=6.0)) > 0
        return int(np.count_nonzero(rises[:-1] & ~rises[1:])) <= 1

    # Bounds of the search: a kernel as wide as all values merges the modes, one of half a cell merges none.
    narrow, kernel = cell / 2, width
    while kernel > 1.01 * narrow:
        between = float(np.sqrt(narrow * kernel))
        narrow, kernel = (narrow, between) if is_one(logs, between) else (between, kernel)
    random = np.random.default_rng(0)
    # Remove the spread that the kernel adds.
    shrunk = 1 / np.sqrt(1 + (kernel / spread) ** 2)
    several = 0
    for _ in range(_RESAMPLED):
        values = random.choice(logs, len(logs)) + kernel * random.standard_normal(len(logs))
        several += not is_one(logs.mean() + shrunk * (values - logs.mean()), kernel)
    return several / _RESAMPLED


def _quantiles_ms(histogram: Histogram, points: int) -> Floats:
    bins, counts = histogram.arrays()
    rows = counts[None, :].astype(np.float64)
    at = (np.arange(points) + 0.5) / points
    found = np.array([float(quantiles_us(bins, rows, float(share))[0]) for share in at]) / 1e3
    return np.maximum(found, 1e-6)


def _share_above(histogram: Histogram, limit_ms: float) -> float:
    bins, counts = histogram.arrays()
    return float(counts[edges_us(bins)[0] > limit_ms * 1e3].sum()) / histogram.total


def _valley_ms(times: Floats) -> float | None:
    """Return where two modes part, if they do."""
    logs = np.log(times)
    counts, edges = np.histogram(logs, _BINS)
    smooth = counts.astype(np.float64)
    for _ in range(2):
        smooth = np.convolve(smooth, [0.25, 0.5, 0.25], mode="same")
    highest = int(smooth.argmax())
    best: tuple[float, float] | None = None
    for peak in range(_BINS):
        low, high = sorted((highest, peak))
        if high - low < 2:  # noqa: PLR2004 -- no valley between neighbours
            continue
        valley = low + int(smooth[low : high + 1].argmin())
        split = float(np.exp((edges[valley] + edges[valley + 1]) / 2))
        if smooth[valley] > _VALLEY * smooth[peak] or not _two_sides(times, split):
            continue
        if best is None or smooth[peak] > best[0]:
            best = float(smooth[peak]), split
    return None if best is None else best[1]


def _two_sides(times: Floats, split: float) -> bool:
    below, above = times[times <= split], times[times > split]
    enough = min(len(below), len(above)) >= _LEAST_SHARE * len(times)
    return enough and float(np.median(above) / np.median(below)) >= _LEAST_RATIO


def heat_map(measured: Measured) -> dict[str, Any]:
    """Return the `heat_map` of latency.json: how many requests took how long, when."""
    plan = measured.plan
    last = measured.plans[-1]
    width_s = max(1.0, (last.offset_s + last.length_s) / _COLUMNS)
    series = []
    lowest, highest = float("inf"), 0.0
    for name in plan.series_names():
        columns: dict[int, Histogram] = {}
        for block in measured.blocks(name, "duel"):
            if block.cell.service.total:
                columns.setdefault(int(block.start_s / width_s + 1e-9), Histogram()).merge(block.cell.service)
        held = [histogram for histogram in columns.values() if histogram.total]
        lowest = min([lowest, *(histogram.lowest_ns / 1e6 for histogram in held)])
        highest = max([highest, *(histogram.highest_ns / 1e6 for histogram in held)])
        series.append((name, columns))
    if highest <= 0:
        return {"width_s": rounded(width_s), "edges_ms": [], "series": []}
    edges = np.geomspace(max(lowest, 1e-3) * 0.999, highest * 1.01, _ROWS + 1)
    return {
        "width_s": rounded(width_s),
        "edges_ms": [rounded(edge) for edge in edges.tolist()],
        "series": [
            name_fields(name)
            | {
                "columns": [
                    {"t_s": rounded(number * width_s), "counts": _bin(histogram, edges)}
                    for number, histogram in sorted(columns.items())
                ]
            }
            for name, columns in series
        ],
    }


def _bin(histogram: Histogram, edges: Floats) -> list[int]:
    bins, counts = histogram.arrays()
    lower, width = edges_us(bins)
    found, _ = np.histogram((lower + width / 2) / 1e3, edges, weights=counts)
    return [int(count) for count in found]
