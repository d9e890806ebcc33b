"""Draw a stratified sample of the generated mutants, and estimate the kill rate of all from it."""

import math
import random
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from proof.selftest.generated.judging import KILLED, NOT_REACHED, SURVIVED, GeneratedResult
from proof.selftest.generated.mutant import GeneratedMutant

# Standard deviations of the normal distribution that contain 95 %.
_Z: Final = 1.959964


def sample(mutants: Iterable[GeneratedMutant], number: int, seed: int) -> list[GeneratedMutant]:
    """Return ``number`` mutants (or all, if there are fewer), taking one of each stratum (operator, class) in turn.

    The strata are in random order, so that small samples with different seeds leave out different strata.
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
    """The kill rate of those mutants that altered at least one message.

    Attributes:
        killed: number of mutants killed.
        survived: number of mutants that survived.
        not_reached: number of mutants that altered no message; they do not count.
    """

    killed: int
    survived: int
    not_reached: int

    @property
    def share(self) -> float:
        """Return killed / (killed + survived); 1 where both are zero."""
        return self.killed / self.reached if self.reached else 1.0

    @property
    def reached(self) -> int:
        """Return the number of mutants that altered at least one message."""
        return self.killed + self.survived

    @property
    def bound(self) -> float:
        """Return the lower bound of Wilson's 95 % interval for the share (E. B. Wilson, JASA 22, 1927)."""
        return self._wilson(-1) if self.reached else 0.0

    @property
    def top(self) -> float:
        """Return the upper bound of the same interval."""
        return min(1.0, self._wilson(1)) if self.reached else 1.0

    def _wilson(self, side: int) -> float:
        n, p = self.reached, self.share
        centre = p + _Z**2 / (2 * n)
        return (centre + side * _Z * math.sqrt(p * (1 - p) / n + _Z**2 / (4 * n**2))) / (1 + _Z**2 / n)

    def words(self) -> str:
        """Return the rate as a phrase for people."""
        reached = f"{self.killed} of {self.reached} ({self.share:.1%}, at least {self.bound:.1%})"
        return f"{reached}, {self.not_reached} not reached" if self.not_reached else reached


def rate_of(results: Iterable[GeneratedResult]) -> Rate:
    """Return the kill rate of some results."""
    outcomes = [result.outcome for result in results]
    return Rate(outcomes.count(KILLED), outcomes.count(SURVIVED), outcomes.count(NOT_REACHED))


def rates_by(results: Iterable[GeneratedResult], key: str) -> dict[str, Rate]:
    """Return kill rates grouped by a key of group_of()."""
    groups: dict[str, list[GeneratedResult]] = defaultdict(list)
    for result in results:
        groups[group_of(result, key)].append(result)
    return {name: rate_of(group) for name, group in sorted(groups.items())}


def group_of(result: GeneratedResult, key: str) -> str:
    """Return the group in which a result is counted.

    Args:
        result: the result.
        key: ``operator``, ``when`` it strikes, ``class``, ``clause`` of the contract, ``operation``, or ``effort`` of
            the last run.
    """
    mutant = result.mutant
    operator, _, when = mutant.operator.partition("@")
    return {
        "operator": operator,
        "when": when or "always",
        "class": mutant.exchange.class_,
        "clause": _clause(mutant),
        "operation": mutant.exchange.name,
        "effort": result.effort,
    }[key]


def _clause(mutant: GeneratedMutant) -> str:
    """Return the clause of the contract that a mutant breaks: that of headers or formats, or of its operation."""
    exchange = mutant.exchange
    if exchange.clause and mutant.operator.startswith("header-"):
        return "HTTP"
    if exchange.clause and exchange.side == "rest" and mutant.name.endswith((":xml", ":text")):
        return "Formats"
    return exchange.clause or exchange.class_
