"""The rate at which a robot breaks down, found by repeated bisection: the `knee_search` of latency.json.

A search brackets the knee between a rate that met the criterion and one that missed it. Chance may fail a step: so a
step that missed is tried again, a bracket ends only where a second, higher rate missed too, and there are several
searches. Of n searches' estimates the lowest and the highest enclose the median with probability 1 - 2^(1 - n) (the
sign test's interval); the brackets' own ends make it no narrower.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

from loadtests.statistics.figures import rounded, rounded_interval
from loadtests.statistics.steps import Step

RESOLUTION = 1.08  # a bracket whose ends differ by no more is narrow enough
_GROWTH = 2.0
_NEAR = 1.5  # the next search begins this far from an earlier one's bracket
#: The end of a bracket needs a second rate, higher by no more than this factor, that missed too.
_CONFIRMED = 1.25
_MISSES, _MOST_TRIALS = 2, 5  # of one rate: misses in which the generator was on time; trials in all


@dataclass
class Search:
    """One search for the highest rate that meets the criterion.

    Attributes:
        lowest, highest: limits on the rate.
        near: the bracket of an earlier search.
        results: for each rate the trial that counts.
        tried: all trials.
    """

    lowest: float
    highest: float
    near: tuple[float, float] | None = None
    results: dict[float, Step] = field(default_factory=dict)
    tried: list[Step] = field(default_factory=list)

    @property
    def kept(self) -> float | None:
        """Return the highest rate that has met the criterion so far: what missed below it missed by chance."""
        return max((rate for rate, trial in self.results.items() if trial.meets), default=None)

    @property
    def missed(self) -> float | None:
        """Return the lowest rate above it that has missed the criterion."""
        return min(self._missed(), default=None)

    def _missed(self) -> list[float]:
        return [rate for rate, trial in self.results.items() if not trial.meets and rate > (self.kept or 0.0)]

    def next_rate(self) -> float | None:
        """Return the rate to try next; None when the bracket is narrow enough, or a limit is reached."""
        kept, missed = self.kept, self.missed
        if kept is None and missed is None:
            return self._within(self.near[0] / _NEAR if self.near else self.lowest)
        if missed is None:
            kept = kept or self.lowest
            return None if kept >= self.highest else self._within(kept * (_NEAR if self.near else _GROWTH))
        if kept is None:
            return None if missed <= self.lowest else self._within(missed / _GROWTH)
        if missed / kept > RESOLUTION:
            return math.sqrt(kept * missed)
        above = self._within(missed * _CONFIRMED)
        confirmed = any(missed < rate <= above for rate in self._missed())
        return None if confirmed or above <= missed else above

    def learn(self, rate: float, *trials: Step) -> None:
        """Add the trials of a rate, of which the last counts."""
        self.results[rate] = trials[-1]
        self.tried += trials

    def estimate(self) -> float | None:
        """Return the knee, between the ends of the bracket; None where an end was not found."""
        return None if self.kept is None or self.missed is None else math.sqrt(self.kept * self.missed)

    def _within(self, rate: float) -> float:
        return min(max(rate, self.lowest), self.highest)


def knee_search(interface: str, criterion: str, searches: list[Search]) -> dict[str, Any]:
    """Return the combined result of all searches for the knee of one interface."""
    found = [(search, estimate) for search in searches if (estimate := search.estimate()) is not None]
    estimates = [estimate for _, estimate in found]
    trials = [trial for search in searches for trial in search.tried]
    missed = [search.results[search.missed] for search, _ in found if search.missed is not None]
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
        "curve": sorted(trials, key=lambda trial: trial.offered_rate),
    }


def _decided(trials: Sequence[Step]) -> bool:
    """Return whether a rate is known to be kept or missed: a miss counts where the generator was not the limit."""
    if not trials:
        return False
    misses = sum(not trial.limited_by_generator for trial in trials)
    return trials[-1].meets or misses >= _MISSES or len(trials) >= _MOST_TRIALS


def search_again(searches: int, limits: tuple[float, float], attempt: Callable[[float], Step | None]) -> list[Search]:
    """Search several times within the limits; `attempt` tries a rate, and returns None when time is up."""
    found: list[Search] = []
    near: tuple[float, float] | None = None
    for _ in range(searches):
        search = Search(*limits, near=near)
        while (rate := search.next_rate()) is not None:
            trials: list[Step] = []
            while not _decided(trials):
                trial = attempt(rate)
                if trial is None:
                    return found
                trials.append(trial)
            search.learn(rate, *trials)
        found.append(search)
        if search.kept is not None and search.missed is not None:
            near = (search.kept, search.missed)
    return found
