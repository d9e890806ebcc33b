"""How much is tried: numbers of cases and time, by what the user asks and by how fast the robot answers."""

from __future__ import annotations

import random
import zlib
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from collections.abc import Sequence

_Item = TypeVar("_Item")
EFFORTS = ("quick", "standard", "deep")
_FACTORS = {"quick": 0.1, "standard": 1.0}
_BUDGETS_S = {"quick": 2.0, "standard": 10.0}
# A robot that answers within this many milliseconds gets all cases; a slower one fewer, so that a run stays bounded.
_FAST_MS = 10.0
_FEWEST = 3
# A robot on a network nearby answers sooner, even one that is written in Python and on a loaded machine.
_SLOW_MS = 50.0


@dataclass(frozen=True)
class Effort:
    """How much is tried.

    Attributes:
        name: quick, standard or deep.
        usual_ms: how long the robot usually takes to answer, ms.
        minutes: how long a deep run should take, about.
    """

    name: str = "standard"
    usual_ms: float = 1.0
    minutes: float = 10.0

    @property
    def factor(self) -> float:
        """Cases in relation to standard effort against a fast robot."""
        asked = _FACTORS.get(self.name, max(1.0, self.minutes))
        return asked * min(1.0, _FAST_MS / max(self.usual_ms, 0.001))

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
        return self.usual_ms > _SLOW_MS

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
