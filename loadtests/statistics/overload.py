"""Report a robot that gets more requests than it answers: answered and waiting requests, or that it is dead.

Two things can be at their end, the robot or the generator. The generator is where it used up its processor, or saw
late that a request was due; then the run is not valid (`verdict.invalid_because`). Otherwise requests that wait for a
connection wait for the robot, which has all connections.
"""

from collections.abc import Iterable

import msgspec

from loadtests.statistics.counts import MEASURED_PHASES, Counts
from loadtests.statistics.figures import rounded
from loadtests.statistics.histogram import Histogram
from loadtests.statistics.measured import Block, Measured

#: A robot that answers less than this share of the requests is overloaded.
LEAST_ANSWERED = 0.95
#: All connections count as busy from a block on if requests waited for one in this share of the later blocks.
_MOSTLY = 0.9


class Overload(msgspec.Struct, kw_only=True):
    """The `overload` of latency.json.

    Attributes:
        answered_rate, offered_rate: in a second of the measured part.
        connections: how many there were.
        busy_from_s: when all of them were taken, in seconds of load since the run's start; None if they never were.
        waited: requests that waited for a connection; waited_ms: for how long at the median.
        waiting_at_end: requests that were not answered when the measured part was over.
    """

    answered_rate: float
    offered_rate: float
    connections: int
    busy_from_s: float | None
    waited: int
    waited_ms: float | None
    waiting_at_end: int

    def sentence(self) -> str:
        """Return the overload as a sentence without its full stop."""
        said = f"the robot answered {self.answered_rate:,.0f}/s of {self.offered_rate:,.0f}/s offered"
        if self.busy_from_s is not None:
            said += f"; all {self.connections} connections were busy from second {self.busy_from_s:.0f} on"
        if self.waited and self.waited_ms is not None:
            said += f", and {self.waited:,} requests waited for one, half of them {self.waited_ms:,.0f} ms or longer"
        return f"{said}; {self.waiting_at_end:,} were not answered when the time was over"


def overload(measured: Measured, counts: Counts) -> Overload | None:
    """Return how a robot was overloaded; None if it kept up, or if users wait for it (closed model)."""
    plan, asked, achieved = measured.plan, counts.asked_rate, counts.achieved_rate
    if asked is None or achieved is None or plan.robots > 1:
        return None
    failed = sum(counts.failed.values()) / counts.sent if counts.sent else 0.0
    if achieved >= LEAST_ANSWERED * asked * (1 - failed):
        return None
    blocks = {
        block.number: block
        for name in plan.series_names()
        for block in sorted(measured.blocks(name, "warmup", *MEASURED_PHASES), key=lambda each: each.number)
    }
    waited = Histogram()
    for name in plan.series_names():
        for block in measured.blocks(name, *MEASURED_PHASES):
            waited.merge(block.cell.queued)
    return Overload(
        answered_rate=achieved,
        offered_rate=asked,
        connections=plan.connections,
        busy_from_s=rounded(_busy_from_s(blocks[number] for number in sorted(blocks))),
        waited=waited.total,
        waited_ms=rounded(waited.quantile_ms(0.5)),
        waiting_at_end=counts.waiting_at_end + counts.not_sent,
    )


def _busy_from_s(blocks: Iterable[Block]) -> float | None:
    """Return from when on requests waited for a connection in nearly every block."""
    found, busy = None, 0
    for seen, block in enumerate(reversed(list(blocks)), 1):
        if block.cell.queued.total:
            busy += 1
            found = block.start_s if busy >= _MOSTLY * seen else found
    return found


#: A robot counts as dead if no request has succeeded for _DEAD_S, although _DEAD_REQUESTS were sent.
_DEAD_S = 3.0
_DEAD_REQUESTS = 10
_LOOK_S = 0.5


class Liveness:
    """Decides by the counts of a run whether the robot is dead.

    Args:
        report_s: how late the counts may be, in seconds: workers report once a second.
    """

    def __init__(self, report_s: float) -> None:
        self._silence_s = _DEAD_S + report_s
        self._looked_s = 0.0
        self._alive = (0.0, 0, 0)  # time of the last success, and the numbers of successes and failures until then

    def is_due(self, elapsed_s: float) -> bool:
        """Return whether the next count is due; counting costs the load generator time."""
        return elapsed_s - self._looked_s >= _LOOK_S

    def dead_since(self, elapsed_s: float, succeeded: int, failed: int) -> float | None:
        """Return since when the robot has been silent, in seconds from the start; None unless that is long enough."""
        self._looked_s = elapsed_s
        since, before, failed_before = self._alive
        if succeeded > before or failed - failed_before < _DEAD_REQUESTS:
            self._alive = (elapsed_s, succeeded, failed if succeeded > before else failed_before)
            return None
        return since if elapsed_s - since > self._silence_s else None
