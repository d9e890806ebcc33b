"""One rate for a few seconds, and whether the robot met the criterion: a step of the search for the knee."""

import math
from dataclasses import dataclass
from typing import Self

import msgspec

from conformance.statement.load import ServiceLevel
from loadtests.schedule.arrivals import arrivals_due
from loadtests.schedule.plan import Plan
from loadtests.statistics.figures import rounded
from loadtests.statistics.measured import Measured, counted
from loadtests.statistics.recorder import Recorder

_MOST_P99_MS = 50.0
_MOST_ERRORS = 0.01
_LEAST_ACHIEVED = 0.95
#: From this share of a core on, the generator may be what limits the rate.
BUSY = 0.9


@dataclass(frozen=True)
class Criterion:
    """What a step has to meet.

    Attributes:
        limits: values in ms that quantiles of the response time have to be below, by quantile.
    """

    limits: dict[str, float]

    @classmethod
    def of(cls, level: ServiceLevel | None) -> Self:
        """Return the criterion by an operation's service level, or the usual one."""
        most = level.limits.items() if level else ()
        return cls({name.removesuffix("_ms"): ms for name, ms in most if name.endswith("_ms")} or {"p99": _MOST_P99_MS})

    def words(self) -> str:
        """Return the criterion as a sentence."""
        limits = ", ".join(f"{quantile} response time below {below:g} ms" for quantile, below in self.limits.items())
        return (
            f"{limits}, errors at most {_MOST_ERRORS:.0%}, {_LEAST_ACHIEVED:.0%} of the offered rate answered in time"
        )


class Step(msgspec.Struct, kw_only=True):
    """One rate over one interface: a point of the `curve` of a search for the knee in latency.json.

    Attributes:
        reason: why the step does not meet the criterion.
        achieved_rate: good responses in a second of the step, from its first responses on.
        cpu_share: the busiest generator process's share of a core.
        lag_p99_ms: how late the generator itself was.
    """

    interface: str
    client: str = "wire"
    offered_rate: float
    achieved_rate: float
    count: int
    errors: int
    dropped: int
    p50_ms: float | None
    p95_ms: float | None
    p99_ms: float | None
    max_ms: float | None
    meets: bool
    reason: str | None
    cpu_share: float | None = None
    lag_p99_ms: float | None = None

    @property
    def limited_by_generator(self) -> bool:
        """Return whether the generator was too busy, or itself too late, for the step to say anything of the robot."""
        return (self.cpu_share or 0.0) > BUSY or 2 * (self.lag_p99_ms or 0.0) > (self.p99_ms or math.inf)


def step_result(plan: Plan, recorder: Recorder, interface: str, operation: str, criterion: Criterion) -> Step:
    """Return the result of a plan of one interface that was carried out."""
    measured, name = Measured([plan], recorder), (operation, interface, "wire")
    asked = arrivals_due(plan, plan.length_s, phase="step")
    blocks = list(measured.blocks(name, "step"))
    whole = measured.total(name, "step")
    # Until its first responses come, even a robot that keeps up has answered nothing.
    first_s = (blocks[0].cell.response.quantile_ms(0.5) or 0.0) / 1e3 if blocks else 0.0
    seconds = max(plan.length_s - first_s, plan.length_s / 10)
    achieved, offered = recorder.in_time[plan.first_segment] / seconds, asked / plan.length_s
    reasons = []
    if achieved < _LEAST_ACHIEVED * offered:
        reasons.append(f"{achieved:.0f}/s answered of {offered:.0f}/s")
    started = whole.service.total + whole.errors
    if started and whole.errors / started > _MOST_ERRORS:
        reasons.append(f"{whole.errors} of {started} requests failed")
    response, lag = counted(whole, "response"), measured.spans("step", name).lag
    for quantile, below in criterion.limits.items():
        value = response.figure_ms(quantile)
        if value is not None and value >= below:
            reasons.append(f"{quantile} response time {value:.3f} ms is not below {below:g} ms")
    return Step(
        interface=interface,
        offered_rate=round(plan.step_rate or 0.0, 6),
        achieved_rate=round(achieved, 6),
        count=whole.service.total,
        errors=whole.errors,
        dropped=whole.dropped,
        meets=not reasons,
        reason="; ".join(reasons) or None,
        lag_p99_ms=rounded(lag.figure_ms("p99")),
        p50_ms=rounded(response.figure_ms("p50")),
        p95_ms=rounded(response.figure_ms("p95")),
        p99_ms=rounded(response.figure_ms("p99")),
        max_ms=rounded(response.figure_ms("max")),
    )
