"""Decode the latency distributions of a result file from their HDR histograms.

A histogram holds whole microseconds in HdrHistogram's V2 encoding, compressed, in base64. It is decoded once into three
arrays in milliseconds, from which every curve is drawn.
"""

import base64
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
from reports.given_files import unzipped
from reports.pages.untrusted import excerpt

Floats = NDArray[np.float64]
_US_PER_MS = 1000.0
_TAIL = 0.025
"""Share beyond each bound of a two-sided 95 % interval."""
_HEADER, _DIGITS = 8, 15
"""Bytes before the compressed part of an encoding; where in it the number of significant digits is."""
_MOST_BYTES, _MOST_DIGITS = 4 << 20, 4
"""Of the unpacked encoding; with 5 digits a histogram takes 50 MB, and `roaas load` writes 3."""
_MOST_SERIES = 1000


@dataclass(frozen=True, slots=True)
class Distribution:
    """The latencies of a series, grouped by the buckets of the HDR histogram.

    Attributes:
        low_ms: lower edge of each bucket that is not empty, ascending.
        high_ms: upper edge of each bucket (half a microsecond beyond its highest value).
        counts: number of values in each bucket.
    """

    low_ms: Floats
    high_ms: Floats
    counts: NDArray[np.int64]

    @property
    def total(self) -> int:
        """Return the number of values in all buckets."""
        return int(self.counts.sum())

    def quantiles(self, at: Floats) -> Floats:
        """Return the latencies (ms) at the quantiles `at` (0 to 1), interpolated inside a bucket."""
        reached = np.cumsum(self.counts)
        rank = np.clip(at, 0.0, 1.0) * self.total
        index = np.minimum(np.searchsorted(reached, rank, side="left"), len(reached) - 1)
        inside = (rank - (reached[index] - self.counts[index])) / self.counts[index]
        width = self.high_ms[index] - self.low_ms[index]
        result: Floats = self.low_ms[index] + np.clip(inside, 0.0, 1.0) * width
        return result

    @property
    def highest_supported(self) -> float:
        """Return the highest quantile whose 95 % interval has an upper bound, given the number of values.

        The largest of n values lies above the q-quantile with probability 1 - q**n; that is at least 97.5 %
        up to q = 0.025**(1/n).
        """
        return math.exp(math.log(_TAIL) / self.total)


def distribution(encoded: str, where: str) -> Distribution | None:
    """Decode an HDR histogram and return its distribution, or None if the histogram is empty.

    Args:
        encoded: base64 of the V2 encoding.
        where: the place in the result file, for the error message.

    Raises:
        ResultInvalidError: the histogram cannot be decoded.
    """
    if not encoded:
        return None
    try:
        if unzipped(base64.b64decode(encoded)[_HEADER:], zlib.MAX_WBITS, _MOST_BYTES)[_DIGITS] > _MOST_DIGITS:
            raise ValueError(f"more than {_MOST_DIGITS} significant digits")  # noqa: TRY301 - as all others
        histogram = HdrHistogram.decode(encoded)
        # The library's own iterator visits every empty bucket, which is slow.
        held = np.flatnonzero(np.asarray(histogram.counts))
        values = [histogram.get_value_from_index(int(index)) for index in held]
    except (
        HdrCookieException, HdrLengthException, AssertionError, ArithmeticError, LookupError, RuntimeError, TypeError,
        ValueError, zlib.error,
    ) as error:  # fmt: skip
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
    """A series (one operation, client and interface) of a latency result, with its decoded distributions.

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
        """Return (operation, client, interface), which identify a series."""
        return self.data["operation"], self.data["client"], self.data["interface"]

    @property
    def name(self) -> str:
        """Return the series' name as pages show it: operation and interface."""
        return f"{self.data['operation']}, {self.data['interface'].upper()}"


AllSeries = Mapping[tuple[str, str, str], Series]
"""The series of a result by operation, client and interface."""


def all_series(result: Mapping[str, Any], path: str) -> AllSeries:
    """Return every series of a result by (operation, client, interface), with decoded histograms.

    The wire client comes before zeep, and REST before SOAP. `path` is the result's file, for error messages.
    """
    found = {}
    if len(result["series"]) > _MOST_SERIES:
        raise ResultInvalidError(f"{path}: at $.series: more than {_MOST_SERIES:,} series")
    for index, data in enumerate(result["series"]):
        where = f"{path}: at $.series[{index}]"
        series = Series(
            data,
            distribution(data["histogram"], f"{where}.histogram"),
            distribution(data.get("response_histogram", ""), f"{where}.response_histogram"),
        )
        found[series.key] = series
    return dict(sorted(found.items(), key=lambda item: (item[0][1] != "wire", item[0][0], item[0][2])))
