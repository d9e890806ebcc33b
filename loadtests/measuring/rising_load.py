"""Raise the rate until the robot breaks down, and the number of connections to see how latency grows with it."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from loadtests.measuring.distributed_executor import Executor
from loadtests.measuring.executor import busiest
from loadtests.schedule.plan import BOTH, Plan, step_operation
from loadtests.settings.settings import Settings
from loadtests.statistics.knee import knee_search, search_again
from loadtests.statistics.steps import Criterion, Step, step_result

_LOWEST_RATE, _HIGHEST_RATE = 50.0, 50_000.0
_MOST_S = 600.0  # for all searches together


@dataclass
class RisingLoad:
    """Carries out short plans of one operation after the comparison.

    Args:
        first: the comparison's plan.
        stopped: returns whether to end.
        announce: receives each plan before it begins.
        tell: writes progress to the terminal.
    """

    first: Plan
    executor: Executor
    settings: Settings
    stopped: Callable[[], bool]
    announce: Callable[[Plan], None]
    tell: Callable[[str], None]
    _next_segment: int = field(init=False)

    def __post_init__(self) -> None:
        self._next_segment = self.first.first_segment + len(self.first.segments)
        self._operation = step_operation(self.first.operations)
        name = self.first.operations[self._operation]
        self._criterion = Criterion.of(self.settings.thresholds, name, self.settings.slo.get(name))
        self._interfaces = [n for n in self.first.interfaces if self._operation in self.first.offered(n, "wire")]

    def _run(self, interfaces: Sequence[str], *, rate: float | None = None, users: int | None = None) -> list[Step]:
        """Run a plan at a rate or with a number of users, interface after interface; empty if the run was stopped."""
        if self.stopped():
            return []
        load = replace(self.first.load, rate=rate, users=users, duration_s=self.settings.steps.step_s, warmup_s=0.0)
        plan = replace(
            self.first,
            interfaces=tuple(interfaces),
            clients=("wire",),
            load=load,
            offers={f"{name}/wire": [self._operation] for name in interfaces},
            step_rate=rate or 0.0,
            robots=1,
            first_segment=self._next_segment,
        )
        self._next_segment += len(plan.segments)
        self.announce(plan)
        self.executor.run(plan, self.settings.steps.most_rate if users else None, lambda _: self.stopped())
        if self.stopped():
            return []
        cpu_share = busiest(self.executor.members)
        results = [
            step_result(plan, self.executor.recorder, name, plan.operations[self._operation], self._criterion)
            for name in interfaces
        ]
        for result in results:
            result.cpu_share = cpu_share
        return results

    def steps(self) -> list[Step]:
        """Return the `steps` of latency.json: up to the rate at which no interface meets the criterion any more."""
        standing = self._interfaces
        found: list[Step] = []
        for rate in self.settings.steps.rates:
            results = self._run(standing, rate=rate) if standing else []
            if not results:
                break
            for result in results:
                self._tell_rate("step", result)
            found += results
            standing = [result.interface for result in results if result.meets]
        return found

    def _tell_rate(self, what: str, result: Step) -> None:
        kept = "kept" if result.meets else result.reason
        self.tell(
            f"{what} over {result.interface}: {result.offered_rate:.0f}/s, p50 {result.p50_ms or 0:.3f} ms, "
            f"p99 {result.p99_ms or 0:.3f} ms: {kept}"
        )

    def knees(self) -> list[dict[str, Any]]:
        """Search the knee of each interface, and of both together; empty if the settings ask for no search."""
        wanted = self.settings.steps
        if not wanted.knee_searches:
            return []
        until = time.monotonic() + _MOST_S
        limits = (min(_LOWEST_RATE, wanted.most_rate or _LOWEST_RATE), wanted.most_rate or _HIGHEST_RATE)
        found: list[dict[str, Any]] = []
        for interface in [*self._interfaces, *([BOTH] if {"rest", "soap"} <= set(self._interfaces) else [])]:

            def attempt(rate: float, interface: str = interface) -> Step | None:
                if time.monotonic() > until:
                    self.tell(f"knee: ended after {_MOST_S:.0f} s, with the searches done so far")
                    return None
                results = self._run([interface], rate=rate)
                if not results:
                    return None
                self._tell_rate("knee", results[0])
                return results[0]

            words = self._criterion.words(interface)
            found.append(knee_search(interface, words, search_again(wanted.knee_searches, limits, attempt)))
        return found

    def over_connections(self) -> list[dict[str, Any]]:
        """Return how latency and throughput grow with the number of busy connections."""
        found: list[dict[str, Any]] = []
        kept = ("interface", "client", "count", "errors", "p50_ms", "p99_ms", "max_ms", "cpu_share")
        for users in self.settings.steps.connections:
            for interface in self._interfaces:
                results = self._run([interface], users=users)
                if not results:
                    return found
                (result,) = results
                found.append(
                    {"connections": users, "rate": result.achieved_rate}
                    | {name: getattr(result, name) for name in kept}
                )
                self.tell(
                    f"{users} connections over {interface}: {result.achieved_rate:.0f}/s, "
                    f"p50 {result.p50_ms or 0:.3f} ms, p99 {result.p99_ms or 0:.3f} ms"
                )
        return found
