"""When requests start: constant spacing or a Poisson process, fixed by the seed, divided among the workers.

Every worker computes the whole schedule and takes its own share of each segment, so that the shares add up to the
schedule without any message between workers.
"""

from collections import Counter

import numpy as np

from loadtests.clients.payloads import VARIANTS
from loadtests.schedule.plan import Plan, rotation

_NS = 1_000_000_000


class Schedule:
    """One worker's share of a plan; workers are numbered from 0."""

    def __init__(self, plan: Plan, worker: int, workers: int) -> None:
        if not 0 <= worker < workers:
            raise ValueError(f"worker {worker} of {workers}")
        self.plan = plan
        self.worker = worker
        self.workers = workers
        self._counts = self._arrival_counts()
        self._before = self._counted_before()
        self._turns = {
            (segment.interface, segment.client): rotation(plan.choices(segment.interface, segment.client), plan.weights)
            for segment in plan.segments
        }

    def _arrival_counts(self) -> list[int]:
        """Return the arrivals of each segment over all workers: the rate times the time that the segment is open.

        With constant spacing, rounding errors do not add up over segments.
        """
        plan = self.plan
        if not plan.open_model:
            return [0] * len(plan.segments)
        if plan.load.arrivals == "poisson":
            return [
                int(self._rng(index, 2).poisson(segment.rate * segment.active_s))
                for index, segment in enumerate(plan.segments)
            ]
        owed: dict[tuple[str, str, str], float] = {}
        counts = []
        for segment in plan.segments:
            key = (segment.phase, segment.interface, segment.client)
            owed[key] = owed.get(key, 0.5) + segment.rate * segment.active_s
            counts.append(int(owed[key] + 1e-9))
            owed[key] -= counts[-1]
        return counts

    def _counted_before(self) -> list[int]:
        """Return how many arrivals a segment's client and interface had in the segments before it.

        Workers and operations continue in turn from there: in short blocks the first one would otherwise get more.
        """
        so_far: Counter[tuple[str, str, str]] = Counter()
        before = []
        for segment, count in zip(self.plan.segments, self._counts, strict=True):
            key = (segment.phase, segment.interface, segment.client)
            before.append(so_far[key])
            so_far[key] += count
        return before

    def _rng(self, segment: int, purpose: int) -> np.random.Generator:
        return np.random.default_rng([self.plan.load.seed, purpose, self.plan.first_segment + segment])

    def count(self) -> int:
        """Return how many segments there are."""
        return len(self.plan.segments)

    def operations(self, segment: int) -> tuple[int, ...]:
        """Return the numbers of the operations of a segment's interface and client, by turns."""
        found = self.plan.segments[segment]
        return self._turns[found.interface, found.client]

    def users(self) -> int:
        """Return how many users of the closed model are this worker's."""
        return len(range(self.worker, self.plan.load.users or 0, self.workers))

    def total(self, segment: int) -> int:
        """Return a segment's arrivals over all workers."""
        return self._counts[segment]

    def share(self, segment: int) -> int:
        """Return how many of a segment's arrivals are this worker's."""
        return len(self._mine(segment))

    def _mine(self, segment: int) -> range:
        """Return the places of this worker's arrivals among a segment's."""
        return range((self.worker - self._before[segment]) % self.workers, self._counts[segment], self.workers)

    def due_ns(self, segment: int) -> list[int]:
        """Return the offsets of all arrivals in a segment, over all workers, in order."""
        count = self._counts[segment]
        start, end = self.plan.segments[segment].opens_ns, self.plan.segments[segment].end_ns
        rng = self._rng(segment, 3)
        if self.plan.load.arrivals == "poisson":
            places = np.sort(rng.random(count))
        else:  # a random phase, so that the schedule does not beat with the robot's clock
            places = (np.arange(count) + rng.random()) / max(count, 1)
        due: list[int] = (start + places * (end - start)).astype(np.int64).tolist()
        return due

    def arrivals(self, segment: int) -> list[tuple[int, int, int]]:
        """Return this worker's arrivals in a segment: (offset in ns, operation, payload), in order."""
        due = self.due_ns(segment)
        kinds = np.resize(np.roll(self.operations(segment), -self._before[segment]), len(due))
        rng = self._rng(segment, 4)
        rng.shuffle(kinds)
        payloads = rng.integers(VARIANTS, size=len(due)).tolist()
        made = list(zip(due, kinds.tolist(), payloads, strict=True))
        return [made[place] for place in self._mine(segment)]


def arrivals_due(plan: Plan, elapsed_s: float, *, phase: str) -> int:
    """Return how many arrivals of a phase were due in the segments that had ended by then."""
    schedule = Schedule(plan, 0, 1)
    return sum(
        schedule.total(index)
        for index, segment in enumerate(plan.segments)
        if segment.phase == phase and segment.end_ns <= elapsed_s * _NS + 1
    )
