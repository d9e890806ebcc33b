"""What was recorded, by series: cells added up, and the units that are resampled.

A request that was not answered as it should be, or that never started, counts in every figure: as at least the time
until it was given up, and as no less than the slowest answer of its series. Else a robot that hangs on what it is
slow at would look quick.
"""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from loadtests.schedule.plan import SERIES, Plan, Segment, SeriesName
from loadtests.statistics.histogram import Histogram
from loadtests.statistics.recorder import Cell, Recorder, Spans
from loadtests.statistics.rounds import Unit


def counted(cell: Cell, time: str, floor_ns: int) -> Histogram:
    """A cell's `service` or `response` times with those that failed, each of them no less than `floor_ns`."""
    answered: Histogram = getattr(cell, time)
    failed: Histogram = getattr(cell, f"failed_{time}")
    if not failed.total:
        return answered
    whole = Histogram()
    whole.merge(answered)
    whole.merge(failed.at_least(floor_ns))
    return whole


class Side(NamedTuple):
    """One of two that are compared: a phase, a series, and the label by which it goes there, if any."""

    phase: str
    name: SeriesName
    label: str | None = None


class Measured:
    """The cells of one run, or of several repeats of it, by series.

    Args:
        plans: of each repeat, in order.
    """

    def __init__(self, plans: Sequence[Plan], recorder: Recorder) -> None:
        self.plans = list(plans)
        self.plan = self.plans[0]
        self.recorder = recorder

    def blocks(
        self, phase: str, name: SeriesName, label: str | None = None
    ) -> Iterator[tuple[tuple[int, int], Segment, Cell]]:
        """A series' cells in order of time: (repeat, pair), segment, cell."""
        operation, interface, client = name
        number = self.plan.operations.index(operation)
        for plan in self.plans:
            for index, segment in enumerate(plan.segments):
                if (segment.phase, segment.interface, segment.client) != (phase, interface, client):
                    continue
                if label is not None and segment.label != label:
                    continue
                cell = self.recorder.cells.get((plan.first_segment + index, number))
                if cell is not None:
                    yield (plan.repeat, segment.pair), segment, cell

    def total(self, phase: str, name: SeriesName) -> Cell:
        """A series' cells added up."""
        whole = Cell()
        for _, _, cell in self.blocks(phase, name):
            whole.merge(cell)
        return whole

    def pairs(
        self, phase: str, name: SeriesName, time: str = "service", label: str | None = None
    ) -> dict[tuple[int, int], Histogram]:
        """All requests of each pair of blocks, failed ones included, by repeat and pair."""
        cells: defaultdict[tuple[int, int], Cell] = defaultdict(Cell)
        for place, _, cell in self.blocks(phase, name, label):
            cells[place].merge(cell)
        floor = max((getattr(cell, time).highest_ns for cell in cells.values()), default=0)
        return {place: counted(cell, time, floor) for place, cell in cells.items()}

    def units(self, name: SeriesName, time: str, phase: str = "duel") -> list[Unit]:
        """What is resampled for a series' intervals."""
        return [Unit(place[0], (side,)) for place, side in sorted(self.pairs(phase, name, time).items())]

    def whole(self, name: SeriesName, time: str, phase: str = "duel") -> Histogram:
        """All requests of a series, failed ones included."""
        found = Histogram()
        for histogram in self.pairs(phase, name, time).values():
            found.merge(histogram)
        return found

    def paired(self, first: Side, second: Side) -> list[Unit]:
        """The pairs that hold two sides, with the service times of both."""
        sides = [self.pairs(side.phase, side.name, label=side.label) for side in (first, second)]
        return [Unit(place[0], (sides[0][place], sides[1][place])) for place in sorted(set(sides[0]) & set(sides[1]))]

    def spans(self, phase: str, name: SeriesName) -> Spans:
        """Where a series' time went."""
        operation, interface, client = name
        key = (SERIES.index((phase, interface, client)), self.plan.operations.index(operation))
        return self.recorder.spans.get(key, Spans())
