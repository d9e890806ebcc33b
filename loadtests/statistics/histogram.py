"""HdrHistogram's bins on NumPy arrays: one microsecond and three significant digits, up to an hour.

The bins are those of HdrHistogram (http://hdrhistogram.org), so that any of its readers can read our files. The
pure-Python recorder of the `hdrhistogram` package costs 2 us a value; here whole buffers are binned at once. Counts are
sparse: adding two histograms is adding counts, so that a merge of parts equals the histogram of the whole, in any
order.
"""

from collections.abc import Iterable
from typing import Any, Self

import numpy as np
import numpy.typing as npt
from hdrh.histogram import HdrHistogram

HIGHEST_US = 3_600_000_000
_HALF = 1024  # sub-buckets above the first bucket; 2048 in it, for three significant digits
_HALF_BITS = 10
_MASK = 2 * _HALF - 1

Ints = npt.NDArray[np.int64]
Floats = npt.NDArray[np.float64]
_NOTHING: Ints = np.zeros(0, dtype=np.int64)
_LEAST_SUMMED = 256
#: The quantiles that results give, by name.
SHARES = {"p50": 0.5, "p90": 0.9, "p95": 0.95, "p99": 0.99, "p999": 0.999}


def bins_of(values_us: Ints) -> Ints:
    """Return the bin of each value in microseconds; values out of range go to the first or the last bin."""
    values = np.clip(values_us, 0, HIGHEST_US)
    exponent = np.frexp((values | _MASK).astype(np.float64))[1].astype(np.int64)  # position of the highest bit
    bucket = exponent - (_HALF_BITS + 1)
    return ((bucket + 1) << _HALF_BITS) + (values >> bucket) - _HALF


BINS = int(bins_of(np.array([HIGHEST_US]))[0]) + 1


def edges_us(bins: Ints) -> tuple[Ints, Ints]:
    """Return lower edge and width of each bin, in microseconds."""
    bucket = np.maximum((bins >> _HALF_BITS) - 1, 0)
    sub = np.where(bins < 2 * _HALF, bins, (bins & (_HALF - 1)) + _HALF)
    return sub << bucket, np.int64(1) << bucket


class Histogram:
    """Counts by bin, with the exact number, sum and extremes (nanoseconds).

    Added counts wait in arrays until there are enough of them, or until they are read: a merge costs some 10 ns a bin,
    and adding bin by bin to a dict ten times that.
    """

    __slots__ = ("_bins", "_counts", "_pending", "_waiting", "highest_ns", "lowest_ns", "sum_ns", "total")

    def __init__(self) -> None:
        self._bins: Ints = _NOTHING
        self._counts: Ints = _NOTHING
        self._pending: list[tuple[Ints, Ints]] = []
        self._waiting = 0
        self.total = 0
        self.sum_ns = 0
        self.highest_ns = 0
        self.lowest_ns = 0

    @classmethod
    def sum_of(cls, parts: "Iterable[Histogram]") -> Self:
        """Return a histogram of all values of others."""
        whole = cls()
        for part in parts:
            whole.merge(part)
        return whole

    @classmethod
    def of(cls, values_ns: Iterable[int]) -> Self:
        """Return a histogram of values in nanoseconds."""
        made = cls()
        made.record(np.array(list(values_ns), dtype=np.int64))
        return made

    def record(self, values_ns: Ints) -> None:
        """Add values, in nanoseconds."""
        if not len(values_ns):
            return
        found, counts = np.unique(bins_of(values_ns // 1000), return_counts=True)
        self._add(found, counts)
        self._note(len(values_ns), int(values_ns.sum()), int(values_ns.min()), int(values_ns.max()))

    def merge(self, other: "Histogram") -> None:
        """Add another histogram's counts."""
        if other.total:
            self._add(*other.arrays())
            self._note(other.total, other.sum_ns, other.lowest_ns, other.highest_ns)

    def _add(self, bins: Ints, counts: Ints) -> None:
        self._pending.append((bins, counts))
        self._waiting += len(bins)
        if self._waiting > _LEAST_SUMMED + 2 * len(self._bins):  # memory stays in proportion to the bins
            self._settle()

    def _settle(self) -> None:
        """Add the arrays of values that have not been counted yet to the bins."""
        parts = [(self._bins, self._counts), *self._pending]
        bins, counts = (np.concatenate([part[side] for part in parts]) for side in (0, 1))
        summed = np.bincount(bins, weights=counts)  # as floats: exact up to 2**53
        self._bins = np.flatnonzero(summed)
        self._counts = summed[self._bins].astype(np.int64)
        self._pending, self._waiting = [], 0

    def _note(self, total: int, sum_ns: int, lowest_ns: int, highest_ns: int) -> None:
        self.lowest_ns = min(self.lowest_ns, lowest_ns) if self.total else lowest_ns
        self.highest_ns = max(self.highest_ns, highest_ns)
        self.total += total
        self.sum_ns += sum_ns

    def arrays(self) -> tuple[Ints, Ints]:
        """Return the occupied bins in ascending order, and their counts; do not change them."""
        if self._pending:
            self._settle()
        return self._bins, self._counts

    def at_least(self, floor_ns: int) -> "Histogram":
        """Return the histogram with each value below `floor_ns` raised to it; the sum is exact to a bin's width."""
        made = Histogram()
        if not self.total:
            return made
        bins, counts = self.arrays()
        least = int(bins_of(np.array([floor_ns // 1000]))[0])
        low = bins < least
        lower, width = edges_us(bins[~low])
        raised = int(counts[low].sum())
        made._add(np.append(bins[~low], least), np.append(counts[~low], raised))
        beyond = int(((lower + width / 2) * counts[~low]).sum() * 1000)
        made._note(
            self.total, beyond + raised * floor_ns, max(self.lowest_ns, floor_ns), max(self.highest_ns, floor_ns)
        )
        return made

    def figure_ms(self, name: str) -> float | None:
        """Return the mean, the maximum or a quantile by its name; None without values."""
        if name in SHARES:
            return self.quantile_ms(SHARES[name])
        return self.mean_ms() if name == "mean" or not self.total else self.highest_ns / 1e6

    def mean_ms(self) -> float | None:
        """Return the exact mean; None without values."""
        return self.sum_ns / self.total / 1e6 if self.total else None

    def quantile_ms(self, quantile: float) -> float | None:
        """Return a quantile, interpolated in its bin; None without values."""
        if not self.total:
            return None
        bins, counts = self.arrays()
        found = float(quantiles_us(bins, counts[None, :].astype(np.float64), quantile)[0]) / 1e3
        return min(max(found, self.lowest_ns / 1e6), self.highest_ns / 1e6)

    def encode(self) -> str:
        """Return HdrHistogram V2, compressed, in base64, which readers in any language understand."""
        encoded: bytes = self.as_hdr().encode()
        return encoded.decode("ascii")

    def as_hdr(self) -> HdrHistogram:
        """Return the counts in the `hdrhistogram` package's class."""
        hdr = HdrHistogram(1, HIGHEST_US, 3)
        bins, counts = self.arrays()
        for index, count in zip(bins.tolist(), counts.tolist(), strict=True):
            hdr.counts[index] = count
        if self.total:
            hdr.set_internal_tacking_values(int(bins[0]), int(bins[-1]), self.total)
        return hdr

    def pack(self) -> list[Any]:
        """Return the histogram in a form that msgpack carries."""
        bins, counts = self.arrays()
        return [
            self.total,
            self.sum_ns,
            self.lowest_ns,
            self.highest_ns,
            bins.astype("<i4").tobytes(),
            counts.astype("<i8").tobytes(),
        ]

    @classmethod
    def unpack(cls, packed: list[Any]) -> Self:
        """Return the histogram that `pack` wrote."""
        made = cls()
        total, sum_ns, lowest, highest, bins, counts = packed
        made._bins = np.frombuffer(bins, "<i4").astype(np.int64)
        made._counts = np.frombuffer(counts, "<i8").astype(np.int64)
        made.total, made.sum_ns, made.lowest_ns, made.highest_ns = total, sum_ns, lowest, highest
        return made


def quantiles_us(bins: Ints, counts: Floats, quantile: float) -> Floats:
    """Return a quantile of each of many histograms over the same bins, in microseconds.

    Args:
        bins: occupied bins in ascending order, shape (bins,).
        counts: shape (histograms, bins); each row holds at least one count.
        quantile: 0 to 1.

    Returns:
        Shape (histograms,), linear within the bin in which the rank falls.
    """
    lower, width = edges_us(bins)
    summed = np.cumsum(counts, axis=1)
    rank = quantile * summed[:, -1]
    index = np.argmax(summed >= np.maximum(rank, np.finfo(float).tiny)[:, None], axis=1)
    rows = np.arange(len(counts))
    inside = counts[rows, index]
    before = summed[rows, index] - inside
    share = np.where(inside > 0, (rank - before) / np.maximum(inside, 1e-12), 0.0)
    found: Floats = lower[index] + width[index] * np.clip(share, 0.0, 1.0)
    return found
