"""HdrHistogram's bins on NumPy arrays: one microsecond and three significant digits, up to an hour.

The bins are those of HdrHistogram (http://hdrhistogram.org), so that any of its readers takes our files; the
pure-Python recorder of the `hdrhistogram` package costs 2 us a value, and here whole buffers are binned at
once. Counts are kept sparsely: adding two histograms is adding counts, hence a merge of parts equals the
histogram of the whole, whatever the order.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from hdrh.histogram import HdrHistogram

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

HIGHEST_US = 3_600_000_000
_HALF = 1024  # sub-buckets above the first bucket; 2048 in it, for three significant digits
_HALF_BITS = 10
_MASK = 2 * _HALF - 1

Ints = npt.NDArray[np.int64]
Floats = npt.NDArray[np.float64]


def bins_of(values_us: Ints) -> Ints:
    """The bin of each value, in whole microseconds; values out of range go to the first or the last bin."""
    values = np.clip(values_us, 0, HIGHEST_US)
    exponent = np.frexp((values | _MASK).astype(np.float64))[1].astype(np.int64)  # position of the highest bit
    bucket = exponent - (_HALF_BITS + 1)
    return ((bucket + 1) << _HALF_BITS) + (values >> bucket) - _HALF


BINS = int(bins_of(np.array([HIGHEST_US]))[0]) + 1


def edges_us(bins: Ints) -> tuple[Ints, Ints]:
    """Lower edge and width of each bin, in microseconds."""
    bucket = np.maximum((bins >> _HALF_BITS) - 1, 0)
    sub = np.where(bins < 2 * _HALF, bins, (bins & (_HALF - 1)) + _HALF)
    return sub << bucket, np.int64(1) << bucket


class Histogram:
    """Counts by bin, with the exact number, sum and extremes (nanoseconds) beside them."""

    __slots__ = ("counts", "highest_ns", "lowest_ns", "sum_ns", "total")

    def __init__(self) -> None:
        self.counts: dict[int, int] = {}
        self.total = 0
        self.sum_ns = 0
        self.highest_ns = 0
        self.lowest_ns = 0

    def record(self, values_ns: Ints) -> None:
        """Add values, in nanoseconds."""
        if not len(values_ns):
            return
        found, counts = np.unique(bins_of(values_ns // 1000), return_counts=True)
        self._add(found.tolist(), counts.tolist())
        self._note(len(values_ns), int(values_ns.sum()), int(values_ns.min()), int(values_ns.max()))

    def merge(self, other: Histogram) -> None:
        """Add another histogram's counts."""
        if other.total:
            self._add(other.counts.keys(), other.counts.values())
            self._note(other.total, other.sum_ns, other.lowest_ns, other.highest_ns)

    def _add(self, bins: Iterable[int], counts: Iterable[int]) -> None:
        mine = self.counts
        for index, count in zip(bins, counts, strict=True):
            mine[index] = mine.get(index, 0) + count

    def _note(self, total: int, sum_ns: int, lowest_ns: int, highest_ns: int) -> None:
        self.lowest_ns = min(self.lowest_ns, lowest_ns) if self.total else lowest_ns
        self.highest_ns = max(self.highest_ns, highest_ns)
        self.total += total
        self.sum_ns += sum_ns

    def arrays(self) -> tuple[Ints, Ints]:
        """Occupied bins in ascending order, and their counts."""
        bins = np.array(sorted(self.counts), dtype=np.int64)
        return bins, np.array([self.counts[index] for index in bins.tolist()], dtype=np.int64)

    def mean_ms(self) -> float | None:
        """The mean, exact; None without values."""
        return self.sum_ns / self.total / 1e6 if self.total else None

    def quantile_ms(self, quantile: float) -> float | None:
        """The value below which a share of the values lies, interpolated in its bin; None without values."""
        if not self.total:
            return None
        bins, counts = self.arrays()
        found = float(quantiles_us(bins, counts[None, :].astype(np.float64), quantile)[0]) / 1e3
        return min(max(found, self.lowest_ns / 1e6), self.highest_ns / 1e6)

    def encode(self) -> str:
        """HdrHistogram V2, compressed, base64: for its readers in any language."""
        encoded: bytes = self.as_hdr().encode()
        return encoded.decode("ascii")

    def as_hdr(self) -> HdrHistogram:
        """The same counts in the `hdrhistogram` package's class."""
        hdr = HdrHistogram(1, HIGHEST_US, 3)
        for index, count in self.counts.items():
            hdr.counts[index] = count
        if self.total:
            bins, _ = self.arrays()
            hdr.set_internal_tacking_values(int(bins[0]), int(bins[-1]), self.total)
        return hdr

    def pack(self) -> list[object]:
        """A form that msgpack carries; see `unpack`."""
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
    def unpack(cls, packed: list[object]) -> Histogram:
        """Read what `pack` wrote."""
        made = cls()
        total, sum_ns, lowest, highest, bins, counts = packed
        if not isinstance(bins, bytes) or not isinstance(counts, bytes):
            raise TypeError(f"a packed histogram holds bytes, not {type(bins).__name__}")
        made._add(np.frombuffer(bins, "<i4").tolist(), np.frombuffer(counts, "<i8").tolist())
        made.total, made.sum_ns, made.lowest_ns, made.highest_ns = (
            int(str(n)) for n in (total, sum_ns, lowest, highest)
        )
        return made


def quantiles_us(bins: Ints, counts: Floats, quantile: float) -> Floats:
    """A quantile of many histograms over the same bins, in microseconds.

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


def from_counts(counts: Mapping[int, int]) -> Histogram:
    """A histogram from counts alone; its sum and extremes are those of the bins' middles."""
    made = Histogram()
    if counts:
        made._add(counts.keys(), counts.values())  # noqa: SLF001 -- a constructor of the class
        bins, numbers = made.arrays()
        lower, width = edges_us(bins)
        middles = lower * 1000 + width * 500
        made._note(int(numbers.sum()), int((middles * numbers).sum()), int(middles[0]), int(middles[-1]))  # noqa: SLF001 -- as above
    return made
