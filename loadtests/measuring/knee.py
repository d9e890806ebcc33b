"""Offers rates until it is known where a robot gives way, and connections to see how latency grows with them."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from loadtests.measuring.executor import busiest
from loadtests.schedule.arrivals import arrivals_due
from loadtests.schedule.plan import BOTH, step_operation
from loadtests.statistics import steps
from loadtests.statistics.knee import knee_search, search_again

if TYPE_CHECKING:
    from collections.abc import Callable

    from loadtests.measuring.distributed_executor import Executor
    from loadtests.schedule.plan import Plan
    from loadtests.settings.settings import Settings

_LOWEST_RATE, _HIGHEST_RATE = 50.0, 50_000.0
_MOST_S = 600.0  # for all searches together


@dataclass
class Ladder:
    """Carries out short plans of one operation after the duel.

    Args:
        first: the duel's plan.
        stopped: whether somebody wants an end.
        announce: hears of each plan before it begins.
        tell: how things stand, for the terminal.
        used: number of the next segment.
    """

    first: Plan
    executor: Executor
    settings: Settings
    stopped: Callable[[], bool]
    announce: Callable[[Plan], None]
    tell: Callable[[str], None]
    used: int

    def __post_init__(self) -> None:
        self.operation = step_operation(self.first.operations)
        self.criterion = steps.Criterion.of(self.settings.thresholds, self.first.operations[self.operation])
        self.standing = [name for name in self.first.interfaces if self.operation in self.first.offered(name, "wire")]

    def run(self, interface: str, rate: float | None, users: int | None) -> dict[str, Any] | None:
        """One plan of one interface, at a rate or with so many users; None when there is to be an end."""
        if self.stopped():
            return None
        load = replace(self.first.load, rate=rate, users=users, duration_s=self.settings.steps.step_s, warmup_s=0.0)
        plan = replace(
            self.first,
            interfaces=(interface,),
            clients=("wire",),
            load=load,
            offers={f"{interface}/wire": [self.operation]},
            step_rate=rate or 0.0,
            robots=1,
            first_segment=self.used,
        )
        self.used += len(plan.segments)
        self.announce(plan)
        self.executor.run(plan, self.settings.steps.most_rate if users else None, lambda _: self.stopped())
        asked = arrivals_due(plan, plan.length_s, phase="step", interface=interface)
        result = steps.step_result(plan, self.executor.recorder, interface, asked, self.criterion)
        return None if self.stopped() else result | {"cpu_share": busiest(self.executor.members)}

    def knees(self) -> list[dict[str, Any]]:
        """Search each interface's knee, and that of both at once."""
        wanted = self.settings.steps
        until = time.monotonic() + _MOST_S
        limits = (min(_LOWEST_RATE, wanted.most_rate or _LOWEST_RATE), wanted.most_rate or _HIGHEST_RATE)
        found: list[dict[str, Any]] = []
        for interface in [*self.standing, *([BOTH] if {"rest", "soap"} <= set(self.standing) else [])]:

            def attempt(rate: float, interface: str = interface) -> dict[str, Any] | None:
                if time.monotonic() > until:
                    self.tell(f"knee: {_MOST_S:.0f} s are over: what has been found stands")
                    return None
                trial = self.run(interface, rate, None)
                if trial is not None:
                    kept = "kept" if trial["meets"] else trial["reason"]
                    self.tell(f"knee over {interface}: {rate:.0f}/s, p99 {trial['p99_ms'] or 0:.3f} ms: {kept}")
                return trial

            words = self.criterion.words(interface)
            found.append(knee_search(interface, words, search_again(wanted.knee_searches, limits, attempt)))
        return found

    def over_connections(self) -> list[dict[str, Any]]:
        """How latency and throughput grow with the number of connections that are always busy."""
        found: list[dict[str, Any]] = []
        for users in self.settings.steps.connections:
            for interface in self.standing:
                result = self.run(interface, None, users)
                if result is None:
                    return found
                kept = ("interface", "client", "count", "errors", "p50_ms", "p99_ms", "max_ms", "cpu_share")
                found.append(
                    {"connections": users, "rate": result["achieved_rate"]} | {name: result[name] for name in kept}
                )
                self.tell(
                    f"{users} connections over {interface}: {result['achieved_rate']:.0f}/s, "
                    f"p50 {result['p50_ms'] or 0:.3f} ms, p99 {result['p99_ms'] or 0:.3f} ms"
                )
        return found
