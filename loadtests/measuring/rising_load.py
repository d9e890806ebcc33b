"""Raise the rate until the robot breaks down."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

from loadtests.measuring.distributed_executor import Executor
from loadtests.measuring.executor import busiest
from loadtests.schedule.plan import BOTH, SERIES, Plan, step_operation
from loadtests.settings.settings import Settings
from loadtests.statistics.knee import Criterion, Step, knee_search, search_again, step_result

_LOWEST_RATE, _HIGHEST_RATE = 50.0, 50_000.0
_MOST_S = 600.0  # for all searches together


@dataclass
class RisingLoad:
    """Carries out short plans of one operation after the comparison.

    Args:
        first: the comparison's plan.
        stopped: returns whether to end.
        tell: writes progress to the terminal.
    """

    first: Plan
    executor: Executor
    settings: Settings
    stopped: Callable[[], bool]
    tell: Callable[[str], None]
    _next_segment: int = field(init=False)

    def __post_init__(self) -> None:
        self._next_segment = self.first.first_segment + len(self.first.segments)
        self._operation = step_operation(self.first.operations)
        name = self.first.operations[self._operation]
        self._criterion = Criterion.of(self.settings.slo.get(name))
        self._interfaces = [n for n in self.first.interfaces if self._operation in self.first.choices(n, "wire")]

    def _run(self, interface: str, rate: float) -> Step | None:
        """Offer a rate over an interface; None if the run was stopped."""
        if self.stopped():
            return None
        load = replace(
            self.first.load, rate=rate, users=None, stages=(), duration_s=self.settings.steps.step_s, warmup_s=0.0
        )
        plan = replace(
            self.first,
            interfaces=(interface,),
            clients=("wire",),
            load=load,
            offers={f"{interface}/wire": [self._operation]},
            step_rate=rate,
            robots=1,
            first_segment=self._next_segment,
        )
        self._next_segment += len(plan.segments)
        spans = self.executor.recorder.spans  # kept by series: those of the step before would count for this one too
        for key in [key for key in spans if SERIES[key[0]][0] == "step"]:
            del spans[key]
        self.executor.run(plan, None, lambda _: self.stopped())
        if self.stopped():
            return None
        result = step_result(plan, self.executor.recorder, interface, plan.operations[self._operation], self._criterion)
        result.cpu_share = busiest(self.executor.members)
        return result

    def knees(self) -> list[dict[str, Any]]:
        """Search the knee of each interface, and of both together; empty if the settings ask for no search."""
        wanted = self.settings.steps
        if not wanted.knee_searches:
            return []
        until = time.monotonic() + _MOST_S
        limits = (min(_LOWEST_RATE, wanted.most_rate or _LOWEST_RATE), wanted.most_rate or _HIGHEST_RATE)
        found: list[dict[str, Any]] = []
        for interface in [*self._interfaces, *([BOTH] if {"rest", "soap"} <= set(self._interfaces) else [])]:

            def attempt(rate: float, search: int, interface: str = interface) -> Step | None:
                if time.monotonic() > until:
                    self.tell(f"knee: ended after {_MOST_S:.0f} s, with the searches done so far")
                    return None
                result = self._run(interface, rate)
                if result is not None:
                    times = f"p50 {result.p50_ms or 0:.3f} ms, p99 {result.p99_ms or 0:.3f} ms"
                    self.tell(
                        f"knee over {interface}, search {search} of {wanted.knee_searches}: {rate:.0f}/s "
                        f"{f'kept: {times}' if result.meets else f'missed: {result.reason}'}"
                    )
                return result

            found.append(knee_search(interface, self._criterion, search_again(wanted.knee_searches, limits, attempt)))
        return found
