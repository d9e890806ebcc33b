"""Recorded figures by series: sums over blocks, and the units from which intervals are resampled.

A request that failed, or that never started, counts in every figure: with the time until it was given up, and with no
less than the slowest response of its series. Otherwise a robot that hangs on its slow requests would look fast.
"""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from loadtests.schedule.plan import SERIES, Plan, Segment, SeriesName
from loadtests.statistics.histogram import Histogram
from loadtests.statistics.recorder import Cell, Recorder, Spans
from loadtests.statistics.rounds import Unit


def counted_times(cell: Cell, time: str, floor_ns: int | None = None) -> Histogram:
    """Return a cell's `service` or `response` times, failed requests included.

    A failed request counts with no less than `floor_ns`, by default the slowest response of the cell.
    """
    answered: Histogram = getattr(cell, time)
    failed: Histogram = getattr(cell, f"failed_{time}")
    if not failed.total:
        return answered
    return Histogram.sum_of([answered, failed.at_least(answered.highest_ns if floor_ns is None else floor_ns)])


class Side(NamedTuple):
    """One of two compared sides: a phase, a series, and its label in that phase (`a` or `b` in the A/A control)."""

    phase: str
    name: SeriesName
    label: str | None = None


class Block(NamedTuple):
    """The records of one operation in one segment.

    Attributes:
        plan: the plan of the repeat, or of this part of it.
        number: the number of the segment, over all plans.
        segment: when, and over which interface.
        cell: the recorded times and errors.
    """

    plan: Plan
    number: int
    segment: Segment
    cell: Cell

    @property
    def pair(self) -> tuple[int, int]:
        """Return the repeat and the pair's number in the run: blocks that are compared with one another share them."""
        return self.plan.repeat, self.plan.first_segment + self.segment.pair

    @property
    def start_s(self) -> float:
        """Return when the block began, in seconds of load since the run's start."""
        return self.plan.offset_s + self.segment.start_ns / 1e9


class Measured:
    """The cells of one run, or of several repeats of the run, by series.

    Args:
        plans: the plan of each repeat, or of each of its parts, in order.
        recorder: the records.
    """

    def __init__(self, plans: Sequence[Plan], recorder: Recorder) -> None:
        self.plans = list(plans)
        self.plan = self.plans[0]
        self.recorder = recorder

    @property
    def repeats(self) -> list[int]:
        """Return the numbers of the repeats."""
        return list(dict.fromkeys(plan.repeat for plan in self.plans))

    def blocks(self, name: SeriesName, *phases: str, label: str | None = None, alike: bool = True) -> Iterator[Block]:
        """Yield the blocks of a series in some phases, in order of time; those in which nothing happened are left out.

        Args:
            name: the series.
            phases: which phases. Where one side is measured alone, its requests in the A/A control are like all others,
                so that `duel` means both.
            label: only blocks of this label.
            alike: whether `duel` may mean both.
        """
        operation, interface, client = name
        operation_number = self.plan.operations.index(operation)
        phases = self.alike(phases) if alike else phases
        for plan in self.plans:
            for number, segment in enumerate(plan.segments, plan.first_segment):
                if segment.phase not in phases or (segment.interface, segment.client) != (interface, client):
                    continue
                cell = self.recorder.cells.get((number, operation_number))
                if cell is not None and label in {None, segment.label}:
                    yield Block(plan, number, segment, cell)

    def alike(self, phases: tuple[str, ...]) -> tuple[str, ...]:
        """Return the phases whose requests are alike: the duel's and the A/A control's where there is only one side."""
        return ("duel", "aa") if phases == ("duel",) and self.plan.alone else phases

    def total(self, name: SeriesName, *phases: str) -> Cell:
        """Return the sum of a series' cells."""
        whole = Cell()
        for block in self.blocks(name, *phases):
            whole.merge(block.cell)
        return whole

    def pairs(
        self, phase: str, name: SeriesName, time: str = "service", label: str | None = None
    ) -> dict[tuple[int, int], Histogram]:
        """Return the times of all requests of each pair of blocks, failed ones included, by repeat and pair."""
        cells: defaultdict[tuple[int, int], Cell] = defaultdict(Cell)
        for block in self.blocks(name, phase, label=label):
            cells[block.pair].merge(block.cell)
        floor = max((getattr(cell, time).highest_ns for cell in cells.values()), default=0)
        return {pair: counted_times(cell, time, floor) for pair, cell in cells.items()}

    def units(self, name: SeriesName, time: str, phase: str = "duel") -> list[Unit]:
        """Return the units that a series' intervals are resampled from."""
        return [Unit(pair[0], (side,)) for pair, side in sorted(self.pairs(phase, name, time).items())]

    def whole(self, name: SeriesName, time: str, phase: str = "duel") -> Histogram:
        """Return the times of all requests of a series, failed ones included."""
        return Histogram.sum_of(self.pairs(phase, name, time).values())

    def pair_blocks(self, first: Side, second: Side) -> list[Unit]:
        """Return the pairs of blocks that hold two sides, with the service times of both."""
        one, other = (self.pairs(side.phase, side.name, label=side.label) for side in (first, second))
        return [Unit(pair[0], (one[pair], other[pair])) for pair in sorted(set(one) & set(other))]

    def pair_s(self, phase: str, name: SeriesName) -> float:
        """Return the time between one pair of a series' blocks and the next, in seconds of the run."""
        pairs = len({block.pair for block in self.blocks(name, phase)})
        return sum(plan.load.duration_s for plan in self.plans) / max(1, pairs)

    def spans(self, phase: str, name: SeriesName) -> Spans:
        """Return where a series' time went."""
        operation, interface, client = name
        whole, number = Spans(), self.plan.operations.index(operation)
        for each in self.alike((phase,)):
            whole.merge(self.recorder.spans.get((SERIES.index((each, interface, client)), number), Spans()))
        return whole
