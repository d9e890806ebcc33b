"""How much is tried: numbers of cases and time, by what the user asks and by how fast the robot answers."""

from __future__ import annotations

import math
import random
import zlib
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from collections.abc import Sequence

_Item = TypeVar("_Item")
EFFORTS = ("quick", "standard", "deep")
_FACTORS = {"quick": 0.1, "standard": 1.0}
_BUDGETS_S = {"quick": 2.0, "standard": 10.0}
_FEWEST = 3


@dataclass(frozen=True)
class Speed:
    """Robots that answer about as fast get the same cases: so that a run stays bounded, and chance has no say in it.

    Attributes:
        name: of the class.
        up_to_ms: how long the slowest of them take for an answer, ms.
        share: of the cases that a fast robot gets.
    """

    name: str
    up_to_ms: float
    share: float

    @property
    def remark(self) -> str:
        """What a reader has to know of a run at this speed; empty where nothing was left out."""
        if self.share == 1:
            return ""
        return (
            f"The robot answers slowly (class {self.name!r}: {self.says}). To keep the run short, of cases that are "
            f"many one in {1 / self.share:.0f} was tried, but at least {_FEWEST}, and of alternatives a few."
        )

    @property
    def says(self) -> str:
        """Which robots are in the class, in words."""
        before = max((speed.up_to_ms for speed in SPEEDS if speed.up_to_ms < self.up_to_ms), default=0.0)
        if self.up_to_ms == math.inf:
            return f"more than about {before:g} ms for an answer"
        return f"about {before:g} to {self.up_to_ms:g} ms for an answer"


# A robot on a network nearby is local, even one that is written in Python and on a loaded machine; one on a wireless
# link is near, whether it keeps connections or not; an Arduino is far.
SPEEDS = (Speed("local", 40, 1.0), Speed("near", 130, 0.2), Speed("far", 800, 0.05), Speed("slow", math.inf, 0.02))
# Only what is so much beyond a class's bound is in the next one.
_CLEARLY = 1.25


@dataclass(frozen=True)
class Effort:
    """How much is tried.

    Attributes:
        name: quick, standard or deep.
        usual_ms: how long the robot usually takes to answer, ms.
        minutes: how long a deep run should take, about.
        speed: class of the robot by that.
    """

    name: str = "standard"
    usual_ms: float = 1.0
    minutes: float = 10.0
    speed: Speed = SPEEDS[0]

    def seen(self, usual_ms: float) -> Effort:
        """The effort for a robot of which an interface usually answers within so many ms; never more than before."""
        usual_ms = max(self.usual_ms, usual_ms)
        speeds = SPEEDS[SPEEDS.index(self.speed) :]
        speed = next(one for one in speeds if usual_ms <= _CLEARLY * one.up_to_ms)
        return replace(self, usual_ms=usual_ms, speed=speed)

    @property
    def factor(self) -> float:
        """Cases in relation to standard effort against a fast robot."""
        return _FACTORS.get(self.name, max(1.0, self.minutes)) * self.speed.share

    def cases(self, standard: int) -> int:
        """How many cases to try where ``standard`` are tried at standard effort; never fewer than three."""
        return max(min(_FEWEST, standard), round(standard * self.factor))

    @property
    def budget_s(self) -> float:
        """Time after which one exploration stops looking for further cases, s."""
        return _BUDGETS_S.get(self.name, 10.0 * max(1.0, self.minutes))

    @property
    def slow(self) -> bool:
        """Whether each request costs so much time that few have to do (an Arduino takes hundreds of milliseconds)."""
        return self.speed.share < 1

    def subsample(self, items: Sequence[_Item], count: int) -> list[_Item]:
        """All items with a robot that answers quickly; with a slow one ``count`` of them, spread evenly."""
        if not self.slow or len(items) <= count:
            return list(items)
        return [items[index * len(items) // count] for index in range(count)]

    def draw(self, items: Sequence[_Item], standard: int, seed: str) -> list[_Item]:
        """So many of the items as cases() says of ``standard``, in their order, the same ones for one seed."""
        count = self.cases(standard)
        if len(items) <= count:
            return list(items)
        chooser = random.Random(zlib.crc32(seed.encode()))  # noqa: S311 - no secret
        return [items[index] for index in sorted(chooser.sample(range(len(items)), count))]
