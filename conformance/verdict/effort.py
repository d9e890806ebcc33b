"""How many cases and how much time a run uses, depending on the requested effort and the robot's response time."""

from __future__ import annotations

import heapq
import math
import random
import zlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from operator import itemgetter
from typing import TypeVar

_Item = TypeVar("_Item")
EFFORTS = ("quick", "standard", "deep")
#: Duration of a deep run without --minutes.
DEEP_MINUTES = 10.0
# Share of the standard cases, by effort.
_FACTORS = {"quick": 0.1, "standard": 1.0}
_BUDGETS_S = {"quick": 2.0, "standard": 10.0}
_FEWEST = 3
# Share of the values of one kind that a fast robot gets at quick effort.
_KEPT = {"quick": 0.5}
# Greatest factor by which load may lengthen a run: beside other programs, a run takes twice its time.
_LONGEST = 3.0


@dataclass(frozen=True)
class Speed:
    """A class of robots with similar response times, which all get the same number of cases.

    Fixed classes keep a run bounded and independent of small differences in time.

    Attributes:
        name: the name of the class.
        up_to_ms: the longest usual response time in the class, ms.
        share: share of a fast robot's cases, 0 to 1.
    """

    name: str
    up_to_ms: float
    share: float

    @property
    def remark(self) -> str:
        """The report's remark on omitted cases; empty if none were omitted."""
        if self.share == 1:
            return ""
        return (
            f"The robot answers slowly (class {self.name!r}: {self.says}). To keep the run short, of cases that are "
            f"many one in {1 / self.share:.0f} was tried, but at least {_FEWEST}, and of alternatives a few."
        )

    @property
    def says(self) -> str:
        """A description of the robots in the class."""
        before = max((speed.up_to_ms for speed in SPEEDS if speed.up_to_ms < self.up_to_ms), default=0.0)
        if self.up_to_ms == math.inf:
            return f"more than about {before:g} ms for an answer"
        return f"about {before:g} to {self.up_to_ms:g} ms for an answer"


# Classes of speed: local is a robot on a nearby network, even in Python on a loaded machine; near is a wireless link;
# far is an Arduino.
SPEEDS = (Speed("local", 40, 1.0), Speed("near", 130, 0.2), Speed("far", 800, 0.05), Speed("slow", math.inf, 0.02))
# A speed must exceed a class's bound by this factor to count as the next class.
_CLEARLY = 1.25


# Response time above which a robot gets proportionally more time, ms.
_UNHURRIED_MS = 100.0


@dataclass
class Tally:
    """Counts of generated cases.

    Attributes:
        planned: number of cases of all explorations.
        cut_short: number of cases that time did not allow, by check.
    """

    planned: int = 0
    cut_short: dict[str, int] = field(default_factory=dict)

    @property
    def share(self) -> float:
        """The share of planned cases for which time sufficed, 0 to 1."""
        cut = sum(self.cut_short.values())
        return 1 - cut / max(self.planned, cut, 1)


@dataclass(frozen=True)
class Effort:
    """How much a run tries.

    Attributes:
        name: quick, standard or deep.
        usual_ms: the robot's usual response time, ms.
        minutes: approximate duration of a deep run, min.
        speed: the robot's class by response time.
    """

    name: str = "standard"
    usual_ms: float = 1.0
    minutes: float = DEEP_MINUTES
    speed: Speed = SPEEDS[0]

    def slowed_to(self, usual_ms: float, shortest_ms: float | None = None) -> Effort:
        """Return the effort after an interface's response time was measured; it never increases.

        Args:
            usual_ms: the median response time, ms.
            shortest_ms: the shortest one, ms, by which the class is chosen: a busy machine makes some responses late,
                and a slow robot all; by default ``usual_ms``.
        """
        usual_ms, shortest_ms = max(self.usual_ms, usual_ms), usual_ms if shortest_ms is None else shortest_ms
        speeds = SPEEDS[SPEEDS.index(self.speed) :]
        speed = next(one for one in speeds if shortest_ms <= _CLEARLY * one.up_to_ms)
        return replace(self, usual_ms=usual_ms, speed=speed)

    @property
    def factor(self) -> float:
        """Number of cases relative to standard effort with a fast robot."""
        return _FACTORS.get(self.name, max(1.0, self.minutes)) * self.speed.share

    def cases(self, standard: int) -> int:
        """Return the number of cases where standard effort has ``standard``; at least three."""
        return max(min(_FEWEST, standard), round(standard * self.factor))

    @property
    def budget_s(self) -> float:
        """Planned time of one exploration, s: it decides the number of cases; no clock does."""
        return _BUDGETS_S.get(self.name, 10.0 * max(1.0, self.minutes))

    @property
    def longest_s(self) -> float:
        """Time after which one exploration stops trying further cases, s.

        It is a bound for robots that take far longer than planned, so that the same seed gives the same cases on a busy
        machine as well. A slow robot gets fewer cases, but the fewest take longer than a fast robot's many.
        """
        return _LONGEST * self.budget_s * max(1.0, self.usual_ms / _UNHURRIED_MS)

    @property
    def slow(self) -> bool:
        """Whether the robot responds so slowly that only few requests are affordable, like an Arduino."""
        return self.speed.share < 1

    def subsample(self, items: Sequence[_Item], count: int) -> list[_Item]:
        """Return all items for a fast robot, and ``count`` evenly spaced ones for a slow robot."""
        return _evenly(items, count if self.slow else len(items))

    def alternatives(self, items: Sequence[_Item], count: int) -> list[_Item]:
        """Return values of one kind: as subsample(), and at quick effort every second one."""
        return _evenly(items, count if self.slow else max(count, math.ceil(len(items) * _KEPT.get(self.name, 1.0))))

    def draw(self, items: Sequence[_Item], standard: int, seed: str) -> list[_Item]:
        """Return ``cases(standard)`` of the items at random, in their order; the same ones for the same seed."""
        count = self.cases(standard)
        if len(items) <= count:
            return list(items)
        chooser = random.Random(zlib.crc32(seed.encode()))  # noqa: S311 - no secret
        return [items[index] for index in sorted(chooser.sample(range(len(items)), count))]

    def draw_first(self, items: Sequence[_Item], others: Sequence[_Item], standard: int, seed: str) -> list[_Item]:
        """Return draw() of the items, filled up with others if there are too few."""
        chosen = self.draw(items, standard, seed)
        left = self.cases(standard) - len(chosen)
        chooser = random.Random(zlib.crc32(seed.encode()))  # noqa: S311 - no secret
        return [*chosen, *chooser.sample(others, min(max(left, 0), len(others)))]

    def draw_passing(self, items: Iterable[_Item], standard: int, seed: str) -> list[_Item]:
        """Return the same of items that pass by, of which all together may be too many to keep."""
        chooser = random.Random(zlib.crc32(seed.encode()))  # noqa: S311 - no secret
        ranked = ((chooser.random(), index, item) for index, item in enumerate(items))
        chosen = heapq.nsmallest(self.cases(standard), ranked, key=itemgetter(0))
        return [item for _, _, item in sorted(chosen, key=itemgetter(1))]


def _evenly(items: Sequence[_Item], count: int) -> list[_Item]:
    if len(items) <= count:
        return list(items)
    return [items[index * len(items) // count] for index in range(count)]
