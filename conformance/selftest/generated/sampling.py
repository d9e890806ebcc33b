"""A sample of the mutants by rule that has every operator and every class in it, and what it says of all."""

import math
import random
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from conformance.selftest.generated.judging import KILLED, NOT_REACHED, SURVIVED, GeneratedResult
from conformance.selftest.generated.mutant import GeneratedMutant

# Of the normal distribution, for 95 %.
_Z: Final = 1.959964


def sample(mutants: Iterable[GeneratedMutant], number: int, seed: int) -> list[GeneratedMutant]:
    """Return ``number`` mutants (all, if there are no more), one of each stratum (operator, class) in turn.

    The strata are dealt out in random order, so that a small sample leaves out others with each seed.
    """
    dice = random.Random(seed)  # noqa: S311 - a sample that can be drawn again, nothing secret
    strata: dict[tuple[str, str], list[GeneratedMutant]] = defaultdict(list)
    for mutant in mutants:
        strata[mutant.operator, mutant.exchange.class_].append(mutant)
    for group in strata.values():
        dice.shuffle(group)
    order = list(strata)
    dice.shuffle(order)
    chosen: list[GeneratedMutant] = []
    while order and len(chosen) < number:
        chosen += [strata[stratum].pop() for stratum in order][: number - len(chosen)]
        order = [stratum for stratum in order if strata[stratum]]
    return chosen


@dataclass(frozen=True)
class Rate:
    """How many of the mutants that altered something were killed.

    Attributes:
        killed: how many; survived: how many were not; not_reached: how many altered nothing, and do not count.
    """

    killed: int
    survived: int
    not_reached: int

    @property
    def share(self) -> float:
        """Killed of those that altered something; 1 where none did."""
        return self.killed / self.reached if self.reached else 1.0

    @property
    def reached(self) -> int:
        """How many altered something."""
        return self.killed + self.survived

    @property
    def bound(self) -> float:
        """The lower end of Wilson's 95 % interval for the share (E. B. Wilson, JASA 22, 1927)."""
        n, p = self.reached, self.share
        if not n:
            return 0.0
        centre = p + _Z**2 / (2 * n)
        return (centre - _Z * math.sqrt(p * (1 - p) / n + _Z**2 / (4 * n**2))) / (1 + _Z**2 / n)

    def words(self) -> str:
        """For people."""
        reached = f"{self.killed} of {self.reached} ({self.share:.1%}, at least {self.bound:.1%})"
        return f"{reached}, {self.not_reached} not reached" if self.not_reached else reached


def rate_of(results: Iterable[GeneratedResult]) -> Rate:
    """Return the rate of some results."""
    outcomes = [result.outcome for result in results]
    return Rate(outcomes.count(KILLED), outcomes.count(SURVIVED), outcomes.count(NOT_REACHED))


def rates_by(results: Iterable[GeneratedResult], key: str) -> dict[str, Rate]:
    """Return rates by ``operator`` (with its mode), ``class`` or ``effort`` (of the last run)."""
    groups: dict[str, list[GeneratedResult]] = defaultdict(list)
    for result in results:
        mutant = result.mutant
        names = {"operator": mutant.operator, "class": mutant.exchange.class_, "effort": result.effort}
        groups[names[key]].append(result)
    return {name: rate_of(group) for name, group in sorted(groups.items())}
