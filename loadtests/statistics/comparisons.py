"""Two sides compared: the comparisons, A/A controls and further interfaces of latency.json.

The A/A control, an interface against itself, is measured in the same blocks and for as long as the comparison. Where
its own interval does not contain 1, the method is biased in this run, by up to that much. Where the effect lies inside
its interval, an interface differs as much from itself. Neither is called a difference. Nor is one that the six parts
of the run do not agree about: a process that waits for a processor is slow for seconds, which its blocks share.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import msgspec

from loadtests.schedule.plan import SeriesName
from loadtests.statistics.figures import name_fields, rounded, rounded_interval, rounds_of
from loadtests.statistics.histogram import SHARES
from loadtests.statistics.intervals import LEAST_ROUNDS, Compared, compare, pooled_interval, samples_for_point
from loadtests.statistics.measured import Measured, Side
from loadtests.statistics.rounds import Interval, Unit

BASE = "rest"
WEB_SERVICES = (BASE, "soap")
COMPARED = ("mean", "p50", "p90", "p99")
Verdict = Literal["differs", "bounded", "noise", "none"]
CLAIMS = ("differs", "bounded")
#: An interval that includes both twice as long and half as long is inconclusive.
_SHARP = 2.0


class Ratio(msgspec.Struct, kw_only=True):
    """Two sides at one quantile, as in latency.json: the second minus the first, and the second divided by the first.

    Attributes:
        parts: the ratios of successive sixths of the run.
        reason: why there is no ratio, or no interval.
    """

    operation: str
    client: str
    quantile: str
    difference_ms: float | None
    ratio: float | None
    ci95: list[float] | None
    ci95_difference_ms: list[float] | None
    rounds: dict[str, Any] | None
    reason: str | None
    parts: list[float] = []


class AaControl(Ratio, kw_only=True):
    """An interface against itself: an entry of `noise_floor`."""

    interface: str


class Judged(Ratio, kw_only=True):
    """A ratio with the claim that the data allow."""

    between_runs: float | None = None
    noise_ci95: list[float] | None = None
    judgement: str = "none"
    bound: float | None = None
    judgement_reason: str | None = None

    def judge(self, control: Sequence[float] | None, deviation: float, *, controlled: bool = True) -> None:
        """Judge the ratio by `control`, the interval of the A/A control; `deviation` is in the ratio's interval.

        Without a control nothing is claimed, unless it is not `controlled`.
        """
        self.between_runs, self.noise_ci95 = rounded(deviation), rounded_interval(control)
        limits = control if controlled else control or (1.0, 1.0)
        found = judge(self.ratio, self.ci95, limits, self.parts) if self.ratio is not None else Judgement("none")
        self.judgement, self.bound = found.verdict, rounded(found.bound)
        self.judgement_reason = found.reason or self.reason


class SoapOverRest(Judged, kw_only=True):
    """SOAP compared with REST at one quantile: an entry of `comparisons`."""

    difference_ms: float | None = msgspec.field(name="soap_minus_rest_ms")


class OverRest(Ratio, kw_only=True):
    """A further interface, such as rosbridge, against REST: an entry of `further_interfaces`."""

    interface: str
    difference_ms: float | None = msgspec.field(name="minus_rest_ms")


def soap_over_rest(measured: Measured, deviation: float) -> list[SoapOverRest]:
    """Compare the service times of SOAP and REST, by operation, client and quantile, judged by the A/A control.

    The library clients have no A/A control of their own: the wire client's serves for them too.

    Args:
        measured: what was recorded.
        deviation: relative standard deviation of the ratio between runs, as far as this run cannot show it.
    """
    found: list[SoapOverRest] = []
    if measured.plan.robots > 1:
        return found  # robots took turns, not interfaces
    names = set(measured.plan.series_names())
    for operation in measured.plan.operations:
        clients = [
            client
            for client in measured.plan.clients
            if all((operation, interface, client) in names for interface in WEB_SERVICES)
        ]
        controls = {quantile: aa_interval(measured, operation, quantile) for quantile in COMPARED} if clients else {}
        found += [
            comparison(measured, operation, client, quantile, controls[quantile], deviation)
            for client in clients
            for quantile in COMPARED
        ]
    return found


def comparison(
    measured: Measured, operation: str, client: str, quantile: str, control: Interval | None, deviation: float
) -> SoapOverRest:
    """Compare SOAP and REST at one quantile, judged by `control`, the interval of the A/A control."""
    rest, soap = (Side("duel", (operation, interface, client)) for interface in WEB_SERVICES)
    entry = SoapOverRest(operation=operation, client=client, **compare_sides(measured, rest, soap, quantile, deviation))
    entry.judge(control, deviation)
    return entry


def aa_interval(measured: Measured, operation: str, quantile: str) -> Interval | None:
    """Return the interval of the ratio that SOAP and REST came to against themselves, both pooled."""
    client, seed = next(iter(measured.plan.clients), ""), measured.plan.load.seed
    parts = [
        _enough(measured.pair_blocks(*_against_itself((operation, interface, client))), quantile, seed, stream=stream)
        for stream, interface in enumerate(WEB_SERVICES)
        if (operation, interface, client) in measured.plan.series_names()
    ]
    known = [part for part in parts if part is not None]
    return pooled_interval(known) if len(known) == len(parts) else None


def _against_itself(name: SeriesName) -> tuple[Side, Side]:
    return Side("aa", name, "a"), Side("aa", name, "b")


def aa_controls(measured: Measured) -> list[AaControl]:
    """Return the `noise_floor` of latency.json: the A/A control of each interface; none without a client."""
    return [
        AaControl(**name_fields(name), **compare_sides(measured, *_against_itself(name), quantile))
        for client in measured.plan.clients[:1]
        for interface in measured.plan.interfaces
        for number in measured.plan.choices(interface, client)
        for name in [(measured.plan.operations[number], interface, client)]
        for quantile in COMPARED
    ]


def further_interfaces(measured: Measured) -> list[OverRest]:
    """Return the `further_interfaces` of latency.json: those beside SOAP and REST, each over REST."""
    names = measured.plan.series_names()
    return [
        OverRest(**name_fields(name), **compare_sides(measured, Side("duel", base), Side("duel", name), quantile))
        for name in names
        for base in [(name[0], BASE, name[2])]
        if name[1] not in WEB_SERVICES and base in names
        for quantile in COMPARED
    ]


def _samples(units: list[Unit]) -> int:
    """Return how many samples the side with fewer has."""
    return min((sum(unit.sides[side].total for unit in units) for side in (0, 1)), default=0)


def _samples_needed(quantile: str) -> int:
    return 2 if quantile == "mean" else samples_for_point(SHARES[quantile])


def _enough(units: list[Unit], quantile: str, seed: int, *, stream: int = 0, deviation: float = 0.0) -> Compared | None:
    """Compare two sides where both have enough samples."""
    enough = _samples(units) >= _samples_needed(quantile)
    return compare(units, quantile, seed, stream=stream, deviation=deviation) if enough else None


def compare_sides(
    measured: Measured, first: Side, second: Side, quantile: str, deviation: float = 0.0
) -> dict[str, Any]:
    """Compare two sides at one quantile; return the fields of a `Ratio`, without the sides' names."""
    units = measured.pair_blocks(first, second)
    result = _enough(units, quantile, measured.plan.load.seed, deviation=deviation)
    reason = None
    if result is None:
        reason = f"{_samples(units)} samples on one side; {quantile} needs {_samples_needed(quantile)}"
    elif result.ci95 is None:
        reason = f"no interval: fewer than {LEAST_ROUNDS} rounds of blocks"
    return {
        "quantile": quantile,
        "difference_ms": rounded(result.difference_ms) if result else None,
        "ratio": rounded(result.ratio) if result else None,
        "ci95": rounded_interval(result.ci95) if result else None,
        "ci95_difference_ms": rounded_interval(result.ci95_difference_ms) if result else None,
        "rounds": rounds_of(result.replicates, measured.pair_s(first.phase, first.name)) if result else None,
        "reason": reason,
        "parts": [round(part, 6) for part in result.parts] if result else [],
    }


@dataclass(frozen=True)
class Judgement:
    """The claim that a comparison supports.

    Attributes:
        verdict: `differs`: the ratio is significant; `bounded`: it is at least beyond `bound`; `noise`: it is not
            significant, and one beyond `bound` is excluded; `none`: inconclusive.
        bound: a ratio; for `noise` a factor of 1 or more, whichever side is slower.
        reason: why no more can be claimed.
    """

    verdict: Verdict
    bound: float | None = None
    reason: str | None = None


def judge(
    ratio: float, effect: Sequence[float] | None, control: Sequence[float] | None, parts: Sequence[float] = ()
) -> Judgement:
    """Judge a ratio by its 95 % interval, by the interval of the A/A control, and by whether the run's parts agree."""
    if effect is None or control is None:
        return Judgement("none", reason=f"the run is too short for an {'' if effect is None else 'A/A '}interval")
    if ratio < 1:  # the same question from the other side
        inverse = [1 / max(part, 1e-9) for part in parts]
        mirrored = judge(1 / ratio, (1 / effect[1], 1 / effect[0]), (1 / control[1], 1 / control[0]), inverse)
        return mirrored if mirrored.verdict != "bounded" else replace(mirrored, bound=1 / (mirrored.bound or 1.0))
    low, high = effect
    reach = max(control[1], 1 / control[0])
    biased, agreed = not control[0] <= 1 <= control[1], all(part > 1 for part in parts)
    if not biased and agreed and ratio > reach and low > 1:
        return Judgement("differs")
    if biased and agreed and (bound := _beyond_bias(ratio, low, control)) > 1:
        return Judgement("bounded", bound, _bias_text(control))
    bound = max(high, 1 / low) * (reach if biased else 1.0)
    if bound > _SHARP:
        return Judgement("none", bound, f"even a factor of {_SHARP:g} is not excluded")
    inside = _bias_text(control) if biased else "an interface differs from itself by as much (A/A control)"
    if not agreed:
        inside = f"the {len(parts)} parts of the run do not agree: {min(parts):.2f} to {max(parts):.2f} times"
    return Judgement("noise", bound, inside)


def _beyond_bias(ratio: float, low: float, control: Sequence[float]) -> float:
    """Return the least ratio that is left after the bias that the A/A control shows.

    Ratio and bias come from different blocks, so that their uncertainties add as variances do (JCGM 100:2008, GUM,
    5.1.2), on the logarithmic scale. The direction of the bias is unknown: the worse one is assumed.
    """
    bias, uncertain = math.sqrt(control[0] * control[1]), math.log(control[1] / control[0]) / 2
    return ratio / max(bias, 1 / bias) * math.exp(-math.hypot(math.log(ratio / low), uncertain))


def _bias_text(control: Sequence[float]) -> str:
    return f"the A/A control came to {min(control):.3f} to {max(control):.3f} times, which does not include 1"
