"""The sentence that sums up a run: effect, interval, A/A control and p99, or that the run is inconclusive.

Terminal, page and Markdown all show this sentence.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import msgspec

from loadtests.schedule.plan import IDLE_RATE, Plan
from loadtests.statistics.against import DECIDING, NOT_SLOWER, SLOWER, UNCLEAR, Against, Change
from loadtests.statistics.comparisons import Judged, SoapOverRest
from loadtests.statistics.counts import Counts
from loadtests.statistics.figures import Figures, Series, plain_quantiles, rounded
from loadtests.statistics.histogram import Histogram
from loadtests.statistics.measured import Measured
from loadtests.statistics.overload import Overload
from loadtests.statistics.service_levels import BROKEN, NOT_KNOWN

MOST_CPU = 0.95
#: How late requests may start, as a share of the median and of the p99 of the service time in blocks whose requests all
#: started on time: a generator that waits for a processor measures its own waiting as service time.
MOST_LAG = {"p50": 0.10, "p99": 0.20}
#: A shorter lag does not count, because a process needs this long to wake up, ms.
LEAST_LAG_MS = {"p50": 0.05, "p99": 0.3}
LEAST_ACHIEVED = 0.95  # a run must achieve this share of its rate
MOST_ERRORS = 0.01


class GeneratorFigures(msgspec.Struct, kw_only=True):
    """Figures on the load generator: the `generator` of latency.json, whose JSON Schema describes each field."""

    cpu_share: float | None
    lag_ms: Figures
    lag_limits_ms: Figures
    real_time: bool
    late: int
    connects: int
    resends: int


def generator_figures(measured: Measured, cpu_share: float | None) -> GeneratorFigures:
    """Return figures on the load generator, over all measured phases.

    Args:
        measured: the records.
        cpu_share: the busiest worker's share of a core.
    """
    plan, counters = measured.plan, measured.recorder.counters
    lag, service, late = Histogram(), Histogram(), 0
    for name in plan.series_names():
        for phase in ("duel", "aa", "against"):
            if phase == "aa" and plan.alone:
                continue  # those of the duel are both
            cell = measured.total(name, phase)
            late += cell.late
            if name[2] == plan.clients[0]:
                for block in measured.blocks(name, phase):
                    if block.cell.late <= block.cell.queued.total:  # late only for want of a free connection
                        service.merge(block.cell.service)
                lag.merge(measured.spans(phase, name).lag)
    return GeneratorFigures(
        cpu_share=rounded(cpu_share),
        lag_ms=plain_quantiles(lag),
        lag_limits_ms=_lag_limits(service),
        real_time=counters.get("real time", 0) > 0,
        late=late,
        connects=counters.get("connects", 0),
        resends=counters.get("resends", 0),
    )


def _lag_limits(service: Histogram) -> Figures:
    """Return the greatest lag that is acceptable for the service time of blocks that started on time."""
    return {
        name: rounded(max(share * (service.figure_ms(name) or 0.0), LEAST_LAG_MS[name]))
        for name, share in MOST_LAG.items()
    }


def invalid_because(
    figures: GeneratorFigures, counts: Counts, plan: Plan, pacing: str, spoilt: Sequence[str]
) -> tuple[list[str], list[str]]:
    """Return the reasons why the figures do not describe the robot, and notes.

    Args:
        figures: on the load generator.
        counts: counts of the requests.
        plan: the plan that the generator had to carry out.
        pacing: the clock that started the requests.
        spoilt: remarks on the generator's machine, which may have made requests late.
    """
    reasons: list[str] = []
    notes: list[str] = []
    if not counts.answered:
        reasons.append("no request succeeded: nothing was measured")
    if figures.cpu_share is not None and figures.cpu_share > MOST_CPU:
        reasons.append(
            f"the generator was busy {figures.cpu_share:.0%} of the time, so that it measured itself: "
            "use more --processes or a lower rate"
        )
    if plan.open_model:
        # Two robots are compared by their service times, which begin at the actual start: lag affects both alike.
        (notes if plan.robots > 1 else reasons).extend(_late(figures, plan, pacing, spoilt))
        if counts.lost > (1 - LEAST_ACHIEVED) * counts.asked:
            reasons.append(f"{counts.lost} of {counts.asked} requests were neither sent nor given up")
    if figures.resends:
        reasons.append(f"a client library silently retried {figures.resends} requests")
    return reasons, notes


def _late(figures: GeneratorFigures, plan: Plan, pacing: str, spoilt: Sequence[str]) -> list[str]:
    late = [
        f"{lag:.3f} ms ({name}; a valid run allows {limit:.3f} ms)"
        for name, limit in figures.lag_limits_ms.items()
        if limit is not None and (lag := figures.lag_ms[name] or 0.0) > limit
    ]
    if not late:
        return []
    causes = "; ".join(spoilt) or "the generator's machine is overloaded"
    needed = "with CAP_SYS_NICE and a processor left for the robot"
    if not plan.mostly_idle:
        needed = f"at up to {IDLE_RATE:,.0f} requests/s for each of its processes"
    hint = "" if figures.real_time else f"; {needed}, the generator would run before other processes"
    return [f"requests started {' and '.join(late)} after their time ({pacing}): {causes}{hint}"]


def failures(counts: Counts) -> list[str]:
    """Return why the robot's failures leave nothing to compare; service levels are judged all the same."""
    found, failed = [], sum(counts.failed.values())
    if failed > MOST_ERRORS * counts.sent:
        found.append(f"{failed} of {counts.sent} requests failed ({failed / counts.sent:.1%})")
    if counts.not_sent > MOST_ERRORS * max(1, counts.asked):
        found.append(f"{counts.not_sent} of {counts.asked} requests never started: no connection was free in time")
    return found


def says_nothing(comparisons: Sequence[SoapOverRest]) -> list[str]:
    """Return the reasons why no comparison supports a claim; empty if one does, or if there was no comparison."""
    medians = [entry for entry in comparisons if entry.quantile == "p50"]
    if not medians or any(entry.judgement != "none" for entry in medians):
        return []
    reasons = dict.fromkeys(str(entry.judgement_reason) for entry in medians)
    return [f"SOAP and REST cannot be compared: {'; '.join(reasons)}"]


_ORDER = {"delivery": 0, "pose": 1, "coffee": 2}  # described operations stay in the order of the options
_TAIL = "p99"
_TENTHS_MS = 10
_SURE = 0.9
_MOST_IN_SHORT = 3  # further series that the sentence names
_AGAINST = {
    SLOWER: "Slower than the other robot",
    NOT_SLOWER: "Not slower than the other robot",
    UNCLEAR: "Inconclusive whether it is slower than the other robot",
}
_WORTHLESS = "Not valid"
_INTERRUPTED = "Interrupted"
_STOPPED = "The robot stopped answering"
_OVERLOADED = "The robot is overloaded"
_UNDECIDED = "This run is inconclusive"
_NOTHING = "No series has enough successful requests for a figure."


@dataclass(frozen=True)
class Found:
    """Results of a run from which the headline is made.

    Attributes:
        plan: the plan of the run.
        most_rate: the limit on the rate, which caps the closed model.
        worthless: why the figures say nothing about the robot.
        undecided: why the run has nothing to compare; service levels are judged all the same.
        levels: outcomes of the service levels.
        overload: how the robot was overloaded, if it was.
        knees: the `knee_search` of latency.json.
        interrupted: by Ctrl-C, and valid until then.
        stopped: from when on the robot answered nothing, if it did not go on.
        busy: how busy the generator's machine was, if it had no processor to spare.
    """

    plan: Plan
    most_rate: float | None = None
    series: Sequence[Series] = ()
    comparisons: Sequence[SoapOverRest] = ()
    against: Against | None = None
    worthless: Sequence[str] = field(default=())
    undecided: Sequence[str] = field(default=())
    levels: Sequence[str] = ()
    overload: Overload | None = None
    knees: Sequence[Mapping[str, Any]] = ()
    interrupted: bool = False
    stopped: str = ""
    busy: str = ""


def headline(found: Found) -> dict[str, str]:
    """Return the `headline` of latency.json: a few `words`, and a `sentence` that stands alone."""
    words, sentence = _verdict(found)
    if knees := list(_knees(found.knees)):
        said = f"{'. '.join(knees)}."
        if found.worthless and not found.interrupted and any(search["rate"] for search in found.knees):
            words, sentence = knees[0], f"{said} The other times are not valid, because {'; '.join(found.worthless)}."
        elif found.interrupted or found.worthless or found.overload is not None or found.undecided:
            sentence = f"{sentence} {said}"
        else:
            words, sentence = words if found.levels else knees[0], f"{said} {sentence}"
    if found.busy and not found.worthless:
        sentence += (
            f" Measured on a busy machine ({found.busy}): another run will differ by more than the intervals say, "
            "most of all at the 99th percentile."
        )
    return {"words": words, "sentence": sentence}


def _verdict(found: Found) -> tuple[str, str]:
    """Return words and sentence of a run without its search for a knee."""
    if found.interrupted:
        return _INTERRUPTED, f"{_INTERRUPTED}; until then: {_result_words(found)[1]}"
    if found.stopped:
        return _STOPPED, f"{_STOPPED}: {found.stopped}."
    if found.worthless:
        return _WORTHLESS, f"These figures say nothing about the robot, because {'; '.join(found.worthless)}."
    judged = _levels(found.levels)
    if found.overload is not None:
        return judged or _OVERLOADED, f"{_OVERLOADED}: {found.overload.sentence()}.{_answered_text(found)}"
    if found.undecided:
        return judged or _UNDECIDED, f"{_UNDECIDED}, because {'; '.join(found.undecided)}."
    words, sentence = _result_words(found)
    return judged or words, sentence + _two_modes(found.series)


def _knees(searches: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Yield for each interface the rate at which the robot breaks down, as a sentence without its full stop."""
    for knee in searches:
        name = "REST and SOAP at once" if knee["interface"] == "both" else knee["interface"].upper()
        if knee["rate"] is None:
            held = knee["held_up_to"]
            up_to = f"did not break down up to {held:,.0f} requests/s" if held else "met the criterion at no rate"
            yield f"{name} {up_to}"
            continue
        low, high = knee["interval"]
        first = knee["errors_from"]
        yield (
            f"{name} breaks down at {knee['rate']:,.0f} requests/s ({low:,.0f} to {high:,.0f} in {knee['searches']} "
            f"search{'' if knee['searches'] == 1 else 'es'}{_sureness(knee)})"
            + ("" if first is None else f"; requests failed from {first:,.0f} requests/s on")
            + ("; the generator, not the robot, was the limit" if knee["limited_by"] == "generator" else "")
        )


def _sureness(knee: Mapping[str, Any]) -> str:
    """Return how sure it is that the knee lies between the searches' results, where that is less than usual."""
    few, needed, confidence = knee.get("step_requests"), knee.get("needed_requests", 0), knee.get("confidence") or 0.0
    if few is not None and few < needed:
        return f"; not sure: a step had {few:,} requests, and its criterion needs {needed:,}: longer --step-duration"
    if knee["searches"] == 1:
        return ", whose error only more searches show"
    return "" if confidence >= _SURE else f", at {confidence:.0%} confidence"


def _answered_text(found: Found) -> str:
    """Return a sentence on the requests that an overloaded robot answered: from when they were due, and when sent."""
    series = [entry for entry in found.series if entry.service_ms[DECIDING] is not None]
    if not series:
        return ""
    entry = min(series, key=_rank)
    due, sent = _ms(entry.response_ms[DECIDING]), _ms(entry.service_ms[DECIDING])
    since_sent = "" if due == sent else f", and {sent} ms or longer from when they were sent"
    return f" Half of the {entry.operation} requests took {due} ms or longer from when they were due{since_sent}."


def _levels(outcomes: Sequence[str]) -> str | None:
    """Return a text on the limits of service levels that were broken and kept; None if there are none."""
    number = f"{len(outcomes)} service level{'' if len(outcomes) == 1 else 's'}"
    for outcome in (BROKEN, NOT_KNOWN):
        if outcome in outcomes:
            return f"{outcomes.count(outcome)} of {number} {outcome}"
    if not outcomes:
        return None
    return "The service level is kept" if len(outcomes) == 1 else f"All {number} are kept"


def _result_words(found: Found) -> tuple[str, str]:
    """Return two forms of the result, a few words and a sentence, for a run without service levels or errors."""
    if found.against is not None:
        return _other_robot(found, found.against)
    medians = [entry for entry in found.comparisons if entry.quantile == DECIDING]
    if medians:
        leading = min(medians, key=_rank)
        words, sentence = _ratio_words(leading, _TWO_INTERFACES)
        tail = next(
            entry
            for entry in found.comparisons
            if (entry.quantile, entry.operation, entry.client) == (_TAIL, leading.operation, leading.client)
        )
        return words, f"{sentence}{_tail(tail)}: {leading.operation}, {_how(leading, found)}."
    series = [entry for entry in found.series if entry.service_ms[DECIDING] is not None]
    if not series:
        return "Nothing was measured", _NOTHING
    first = min(series, key=_rank)
    words, sentence = _alone(first, found)
    others = [entry for entry in series if entry is not first and entry.client == first.client]
    return words, " ".join([sentence, *map(_in_short, others[:_MOST_IN_SHORT])])


def _rank(entry: SoapOverRest | Series) -> tuple[bool, int]:
    return entry.client != "wire", _ORDER.get(entry.operation, 0)


def _how(entry: SoapOverRest | Series | Change, found: Found) -> str:
    """Return the client and the load, as the end of a sentence."""
    load = found.plan.load
    if load.stages:
        rates = [rate for rate, _ in load.stages]
        return f"{entry.client} client, {len(rates)} stages of up to {max(rates):g} requests/s"
    if load.users is None:
        return f"{entry.client} client, {load.rate:g} requests/s"
    users = f"{entry.client} client, {load.users} user{'' if load.users == 1 else 's'}"
    if found.plan.scenario:
        users += " of a scenario in the closed model"
    if found.most_rate is None:
        return users
    return f"{users} under a cap of {found.most_rate:g} requests/s, which is part of the figures"


def _ms(value: float | None) -> str:
    value = value or 0.0
    return f"{value:,.3f}" if abs(value) < _TENTHS_MS else f"{value:,.1f}"


def _more(value: float | None) -> str:
    return f"{_ms(abs(value or 0.0))} ms {'more' if (value or 0.0) >= 0 else 'less'}"


def _between(bounds: Sequence[float] | None, least: int = 2) -> str:
    """Return an interval of ratios, with as many digits as tell its ends apart."""
    low, high = bounds or (1.0, 1.0)
    digits = next((digits for digits in range(least, 4) if f"{low:.{digits}f}" != f"{high:.{digits}f}"), 4)
    return f"{low:.{digits}f} to {high:.{digits}f}"


_TWO_INTERFACES = ("SOAP takes {} times as long as REST", "SOAP and REST")
_TWO_ROBOTS = ("This robot takes {} times as long as the other one", "the two robots")


def _ratio_words(entry: Judged, names: tuple[str, str]) -> tuple[str, str]:
    """Return two forms of a comparison, a few words and a sentence; `names` are a claim and the two sides."""
    claim, sides = names
    where = "at the median" if entry.quantile == DECIDING else "at the 99th percentile"
    control = f"A/A control {_between(entry.noise_ci95)}" if entry.noise_ci95 else "no A/A control"
    sure = f"95 % interval {_between(entry.ci95)}"
    if entry.judgement == "differs":
        words = claim.format(f"{entry.ratio:.2f}")
        return words, f"{words} {where} ({sure}, {control}; {_more(entry.difference_ms)})"
    if entry.judgement == "bounded":
        words = claim.format(_least(entry))
        return words, f"{words} {where} ({sure}, corrected by this run's {control})"
    if entry.judgement == "noise":
        words = f"No significant difference between {sides}"
        return words, f"{words} {where} ({sure}, {control}; a factor beyond {entry.bound:.2f} is excluded)"
    words = f"The comparison of {sides} is inconclusive"
    return words, f"{words} {where} ({entry.judgement_reason})"


def _least(entry: Judged) -> str:
    return f"{'at least' if (entry.bound or 0.0) > 1 else 'at most'} {entry.bound:.2f}"


def _tail(entry: Judged) -> str:
    """Return the second half of a sentence: the comparison of the p99."""
    if entry.judgement == "differs":
        return f", and {entry.ratio:.2f} times at the 99th percentile ({_between(entry.ci95)})"
    if entry.judgement == "bounded":
        return f", and {_least(entry)} times at the 99th percentile"
    if entry.judgement == "noise":
        return f"; 99th percentile: not significant (a factor beyond {entry.bound:.2f} is excluded)"
    return "; 99th percentile: inconclusive"


def _other_robot(found: Found, compared: Against) -> tuple[str, str]:
    """Return verdict and sentence of the change that decides: of several, the one with the highest upper bound."""
    words = _AGAINST[compared.verdict]
    deciding = [change for change in compared.changes if change.ci95 and change.verdict == compared.verdict]
    if not deciding:
        return words, "No figure of the two robots has an interval: measure longer."
    leading = max(deciding, key=lambda change: (change.quantile == DECIDING, (change.ci95 or [0.0])[-1]))
    tail = next(change for change in compared.changes if _figure(change) == (*_figure(leading)[:3], _TAIL))
    return words, (
        f"{_ratio_words(leading, _TWO_ROBOTS)[1]}{'' if tail is leading else _tail(tail)}; "
        f"{1 + compared.tolerance:.4g} times is tolerated: {leading.operation} over "
        f"{leading.interface.upper()}, {_how(leading, found)}."
    )


def _figure(entry: Change) -> tuple[str, str, str, str]:
    return entry.operation, entry.interface, entry.client, entry.quantile


def _alone(entry: Series, found: Found) -> tuple[str, str]:
    """Return two forms of a single series' result, which has no other series to be compared with."""
    words = f"Half of the {entry.operation} requests over {entry.interface.upper()} take {_at_most(entry, DECIDING)}"
    tail = (
        "; they are too few for a 99th percentile"
        if entry.service_ms[_TAIL] is None
        else f", and 99 of 100 take {_at_most(entry, _TAIL)}{'' if found.busy else _sure(entry, _TAIL)}"
    )
    return words, f"{words}{_sure(entry, DECIDING)}{tail}: {_how(entry, found)}."


def _in_short(entry: Series) -> str:
    tail = "" if entry.service_ms[_TAIL] is None else f", and 99 of 100 {_at_most(entry, _TAIL)}"
    return f"{entry.operation} over {entry.interface.upper()}: half {_at_most(entry, DECIDING)}{tail}."


def _at_most(entry: Series, quantile: str) -> str:
    """Return a quantile as text: as a lower bound if it falls among requests without a response."""
    side = "at least" if quantile in entry.at_least else "at most"
    return f"{side} {_ms(entry.service_ms[quantile])} ms"


def _sure(entry: Series, quantile: str) -> str:
    bounds = entry.ci95_ms[quantile]
    return f" (95 % interval within this run {_ms(bounds[0])} to {_ms(bounds[1])} ms)" if bounds else ""


def _two_modes(series: Sequence[Series]) -> str:
    """Return a warning where a median stands for two kinds of request."""
    names = dict.fromkeys(
        f"{entry.operation} over {entry.interface.upper()}"
        for entry in series
        if (entry.modes or {}).get("split_ms") is not None
    )
    return f" Two modes, so that no single figure describes the series: {', '.join(names)}." if names else ""
