"""Carries out the stepped load: up until no interface is left that keeps to the criterion."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from loadtests.measuring.executor import busiest
from loadtests.schedule.arrivals import arrivals_due
from loadtests.schedule.plan import step_operation
from loadtests.statistics import steps

if TYPE_CHECKING:
    from collections.abc import Callable

    from loadtests.measuring.distributed_executor import Executor
    from loadtests.schedule.plan import Plan
    from loadtests.settings.settings import Settings


def step_load(
    first: Plan,
    executor: Executor,
    settings: Settings,
    stopped: Callable[[], bool],
    announce: Callable[[Plan], None],
    tell: Callable[[str], None],
) -> list[dict[str, Any]]:
    """Step the load up after the `first` plan, until it is `stopped`; returns the `steps` of latency.json.

    `announce` hears of each step's plan before it begins, and `tell` how things stand, for the terminal.
    """
    operation = step_operation(first.operations)
    criterion = steps.Criterion.of(settings.thresholds, first.operations[operation])
    standing = [name for name in first.interfaces if operation in first.offered(name, "wire")]
    used = first.first_segment + len(first.segments)
    found: list[dict[str, Any]] = []
    for rate in settings.steps.rates:
        if not standing or stopped():
            break
        plan = replace(
            first,
            interfaces=tuple(standing),
            clients=("wire",),
            load=replace(first.load, rate=rate, users=None, duration_s=settings.steps.step_s, warmup_s=0.0),
            offers={f"{name}/wire": [operation] for name in standing},
            step_rate=rate,
            first_segment=used,
        )
        used += len(plan.segments)
        announce(plan)
        executor.run(plan, None, lambda _: stopped())
        for interface in list(standing):
            asked = arrivals_due(plan, plan.length_s, phase="step", interface=interface)
            result = steps.step_result(plan, executor.recorder, interface, asked, criterion)
            found.append(result | {"cpu_share": busiest(executor.members)})
            kept = "" if result["meets"] else f": {result['reason']}"
            tell(
                f"step {rate:g}/s over {interface}: p50 {result['p50_ms'] or 0:.3f} ms, "
                f"p99 {result['p99_ms'] or 0:.3f} ms{kept}"
            )
            if not result["meets"]:
                standing.remove(interface)
    return found
