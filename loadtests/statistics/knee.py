"""The rate at which a robot breaks down, found by repeated bisection: the `knee_search` of latency.json.

A search brackets the knee between a rate that met the criterion and one that missed it. It is repeated, because a
single search ends where one step fails by chance. Of n searches' estimates the lowest and the highest enclose the
median with probability 1 - 2^(1 - n) (the sign test's interval); the brackets' own ends make it no narrower.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from loadtests.statistics.figures import rounded, rounded_interval
from loadtests.statistics.steps import Step

RESOLUTION = 1.08  # a bracket whose ends differ by no more is narrow enough
_GROWTH = 2.0
_NEAR = 1.5  # the next search begins this far from an earlier one's bracket


@dataclass
class Search:
    """One search for the highest rate that meets the criterion.

    Attributes:
        lowest, highest: limits on the rate.
        kept: the highest rate that has met the criterion so far.
        missed: the lowest rate that has missed it.
        trials: all trials, by rate.
    """

    lowest: float
    highest: float
    near: tuple[float, float] | None = None
    kept: float | None = None
    missed: float | None = None
    trials: dict[float, Step] = field(default_factory=dict)

    def next_rate(self) -> float | None:
        """Return the rate to try next; None when the bracket is narrow enough, or a limit is reached."""
        if self.kept is None and self.missed is None:
            return self._within(self.near[0] / _NEAR if self.near else self.lowest)
        if self.missed is None:
            kept = self.kept or self.lowest
            return None if kept >= self.highest else self._within(kept * (_NEAR if self.near else _GROWTH))
        if self.kept is None:
            return None if self.missed <= self.lowest else self._within(self.missed / _GROWTH)
        return None if self.missed / self.kept <= RESOLUTION else math.sqrt(self.kept * self.missed)

    def learn(self, rate: float, trial: Step) -> None:
        """Add the result of a trial."""
        self.trials[rate] = trial
        if trial.meets:
            self.kept = max(rate, self.kept or rate)
        else:
            self.missed = min(rate, self.missed or rate)

    def estimate(self) -> float | None:
        """Return the knee, between the ends of the bracket; None where an end was not found."""
        return None if self.kept is None or self.missed is None else math.sqrt(self.kept * self.missed)

    def _within(self, rate: float) -> float:
        return min(max(rate, self.lowest), self.highest)


def knee_search(interface: str, criterion: str, searches: list[Search]) -> dict[str, Any]:
    """Return the combined result of all searches for the knee of one interface."""
    found = [(search, estimate) for search in searches if (estimate := search.estimate()) is not None]
    estimates = [estimate for _, estimate in found]
    trials = [trial for search in searches for trial in search.trials.values()]
    missed = [search.trials[search.missed] for search, _ in found if search.missed in search.trials]
    busy = sum(trial.limited_by_generator for trial in missed)
    kept = [search.kept for search in searches if search.kept is not None]
    failing = [trial.offered_rate for trial in trials if trial.errors or trial.dropped]
    lowest = min((search.kept or 0.0 for search, _ in found), default=0.0)
    highest = max((search.missed or 0.0 for search, _ in found), default=0.0)
    return {
        "interface": interface,
        "criterion": criterion,
        "searches": len(searches),
        "rate": rounded(math.exp(sum(map(math.log, estimates)) / len(estimates))) if estimates else None,
        "interval": rounded_interval((lowest, highest)) if estimates else None,
        "confidence": rounded(1 - 2.0 ** (1 - len(estimates))) if estimates else None,
        "brackets": [[rounded(search.kept), rounded(search.missed)] for search in searches],
        "held_up_to": rounded(max(kept, default=None)) if not estimates and kept else None,
        "errors_from": rounded(min(failing, default=None)),
        "reason": missed[0].reason if missed else None,
        "limited_by": None if not missed else ("generator" if 2 * busy > len(missed) else "robot"),
        "trials": len(trials),
    }


def search_again(searches: int, limits: tuple[float, float], attempt: Callable[[float], Step | None]) -> list[Search]:
    """Search several times within the limits; `attempt` tries a rate, and returns None when time is up."""
    found: list[Search] = []
    near: tuple[float, float] | None = None
    for _ in range(searches):
        search = Search(*limits, near=near)
        while (rate := search.next_rate()) is not None:
            trial = attempt(rate)
            if trial is None:
                return found
            search.learn(rate, trial)
        found.append(search)
        if search.kept is not None and search.missed is not None:
            near = (search.kept, search.missed)
    return found
