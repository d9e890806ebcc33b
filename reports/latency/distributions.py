"""Distributions of latencies, decoded from the HDR histograms of a result file.

A histogram holds whole microseconds in HdrHistogram's V2 encoding, compressed, in base64. It is decoded once into three
arrays in milliseconds, from which every curve is drawn.
"""

import math
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from hdrh.codec import HdrCookieException, HdrLengthException
from hdrh.histogram import HdrHistogram
from numpy.typing import NDArray

from reports.errors import ResultInvalidError
from reports.pages.untrusted import excerpt

Floats = NDArray[np.float64]
_US_PER_MS = 1000.0
_TAIL = 0.025
"""Share beyond each bound of a two-sided 95 % interval."""


@dataclass(frozen=True, slots=True)
class Distribution:
    """Recorded values, grouped by the histogram's own buckets.

    Attributes:
        low_ms: lower edge of each bucket that is not empty, ascending.
        high_ms: its upper edge (half a microsecond beyond its highest value).
        counts: how many values it holds.
    """

    low_ms: Floats
    high_ms: Floats
    counts: NDArray[np.int64]

    @property
    def total(self) -> int:
        """Return the number of values."""
        return int(self.counts.sum())

    def quantiles(self, at: Floats) -> Floats:
        """Return the values at the quantiles `at` (0 to 1), interpolated inside a bucket."""
        reached = np.cumsum(self.counts)
        rank = np.clip(at, 0.0, 1.0) * self.total
        index = np.minimum(np.searchsorted(reached, rank, side="left"), len(reached) - 1)
        inside = (rank - (reached[index] - self.counts[index])) / self.counts[index]
        width = self.high_ms[index] - self.low_ms[index]
        result: Floats = self.low_ms[index] + np.clip(inside, 0.0, 1.0) * width
        return result

    @property
    def highest_supported(self) -> float:
        """Return the highest quantile for which so many values give a 95 % interval with an upper bound.

        The largest of n values lies above the q-quantile with probability 1 - q**n; that is at least 97.5 %
        up to q = 0.025**(1/n).
        """
        return math.exp(math.log(_TAIL) / self.total)


def distribution(encoded: str, where: str) -> Distribution | None:
    """Decode a histogram; return None if it is empty.

    Args:
        encoded: base64 of the V2 encoding.
        where: the place in the result file, for the error message.

    Raises:
        ResultInvalidError: it cannot be decoded.
    """
    if not encoded:
        return None
    try:
        histogram = HdrHistogram.decode(encoded)
        # The library's own iterator visits every empty bucket, which is slow.
        held = np.flatnonzero(np.asarray(histogram.counts))
        values = [histogram.get_value_from_index(int(index)) for index in held]
    except (HdrCookieException, HdrLengthException, zlib.error, TypeError, ValueError, IndexError) as error:
        raise ResultInvalidError(
            f"{where}: no HDR histogram (V2, base64): {error} (value: {excerpt(encoded, 40)!r})"
        ) from error
    if not values:
        return None
    lows = [histogram.get_lowest_equivalent_value(value) for value in values]
    highs = [histogram.get_highest_equivalent_value(value) for value in values]
    return Distribution(
        np.maximum(np.asarray(lows, dtype=np.float64) - 0.5, 0.0) / _US_PER_MS,
        (np.asarray(highs, dtype=np.float64) + 0.5) / _US_PER_MS,
        np.asarray([histogram.get_count_at_index(int(index)) for index in held], dtype=np.int64),
    )


@dataclass(frozen=True, slots=True)
class Series:
    """One series of a latency result with its distributions.

    Attributes:
        data: the series as in the file.
        service: times from the actual start; None without values.
        response: times from the intended start; None without values, or if they were not recorded.
    """

    data: Mapping[str, Any]
    service: Distribution | None
    response: Distribution | None

    @property
    def key(self) -> tuple[str, str, str]:
        """Return operation, client and interface, which identify a series."""
        return self.data["operation"], self.data["client"], self.data["interface"]

    @property
    def name(self) -> str:
        """Return the name of the series on the page."""
        return f"{self.data['operation']}, {self.data['interface'].upper()}"


AllSeries = Mapping[tuple[str, str, str], Series]
"""The series of a result by operation, client and interface."""


def all_series(result: Mapping[str, Any], path: str) -> AllSeries:
    """Return every series by operation, client and interface, wire before zeep and REST before SOAP."""
    found = {}
    for index, data in enumerate(result["series"]):
        where = f"{path}: at $.series[{index}]"
        series = Series(
            data,
            distribution(data["histogram"], f"{where}.histogram"),
            distribution(data.get("response_histogram", ""), f"{where}.response_histogram"),
        )
        found[series.key] = series
    return dict(sorted(found.items(), key=lambda item: (item[0][1] != "wire", item[0][0], item[0][2])))
