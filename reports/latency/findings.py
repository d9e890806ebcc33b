"""Describe a latency result in sentences: verdict, remarks with confidence intervals, and what users will notice.

The bounds are Nielsen's (Usability Engineering, 1993, section 5.5, after Miller 1968): a response within 0.1 s seems
immediate, within 1 s the delay is noticed but does not interrupt a train of thought, and beyond that people wait.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from reports.latency.distributions import AllSeries
from reports.latency.figures.timeline import Stall, stalls
from reports.latency.numbers import interval, ms, rate, share
from reports.pages.page import counted, opened
from reports.pages.untrusted import excerpt

_AT_ONCE_MS, _FLOW_MS = 100.0, 1000.0
#: Share of the requests that are at most as slow as a quantile, in words.
_TAILS = {"p99": "99 of 100", "p95": "95 of 100", "p90": "9 of 10"}
_BEYOND = {"p99": "1 of 100", "p95": "1 of 20", "p90": "1 of 10"}  # share of the requests that are slower, in words
_MOST = 6


def sentences(result: Mapping[str, Any]) -> list[str]:
    """Return sentences for each series of the leading client, the slowest first, and what else limits them."""
    own = [item for item in result["series"] if item["client"] == "wire"] or result["series"]
    told = [item for item in own if item["count"] and item["response_ms"]["p50"] is not None]
    if not told or not result.get("trustworthy", result["valid"]):
        return ["This run does not show what a user of the robot will notice; the reasons are below."]
    told.sort(key=lambda item: -_tail(item)[1])
    lines = [sentence for item in told[:_MOST] for sentence in _of_series(item, result)]
    if len(told) > _MOST:
        lines.append(f"The other {len(told) - _MOST} are faster than these.")
    return [*lines, *_of_streams(result), *_of_stops(result), *_limits(result, any(map(_failures, told)))]


def _failures(one: Mapping[str, Any]) -> int:
    """Return how many requests of a series failed, or never got a connection."""
    number: int = one["errors"] + one.get("dropped", 0)
    return number


def _tail(one: Mapping[str, Any]) -> tuple[str, float]:
    """Return the quantile farthest in the tail up to p99 that the series has, and its value."""
    times = one["response_ms"]
    name = next((name for name in _TAILS if times[name] is not None), "p50")
    return name, times[name]


def _of_series(one: Mapping[str, Any], result: Mapping[str, Any]) -> Iterator[str]:
    several = len({each["interface"] for each in result["series"]}) > 1
    name = excerpt(one["operation"], 100) + (f" over {one['interface'].upper()}" if several else "")
    half, (quantile, slow) = one["response_ms"]["p50"], _tail(one)
    if quantile == "p50":
        yield f"{name}: half of the responses take {ms(half)} ms or less; there are too few to say more."
    elif slow < _AT_ONCE_MS <= ((one["ci95_ms"].get(quantile) or [0.0])[-1]):
        yield (
            f"{name}: a person probably notices no delay. {_TAILS[quantile]} responses come within {ms(slow)} ms, but "
            "by its 95 % interval that may be more than the 100 ms below which a delay seems immediate."
        )
    elif slow < _AT_ONCE_MS:
        yield (
            f"{name}: a person notices no delay. {_TAILS[quantile]} responses come within {ms(slow)} ms, and a delay "
            "below about 100 ms seems immediate."
        )
    elif half < _AT_ONCE_MS:
        delay = "a short delay" if slow < _FLOW_MS else "a wait"
        yield (
            f"{name}: a person usually notices no delay (half of the responses come within {ms(half)} ms), but "
            f"{_BEYOND[quantile]} takes {ms(slow)} ms or more, which is noticed as {delay}."
        )
    else:
        delay = "a short delay" if half < _FLOW_MS else "a wait"
        yield (
            f"{name}: a person notices {delay} each time. Half of the responses take {ms(half)} ms or more, and "
            f"{_BEYOND[quantile]} takes {ms(slow)} ms or more."
        )
    if slow > 0 and quantile != "p50" and not result.get("overload"):
        yield (
            f"A control loop that waits for each response of {name} can run about "
            f"{rate(float(f'{1000 / slow:.2g}'))} times a second, and is late in {_BEYOND[quantile]} turns."
        )
    failed = _failures(one)
    if failed:
        total, dropped = one["count"] + failed, one.get("dropped", 0)
        vain = f" ({dropped:,} of them got no connection in time)" if dropped else ""
        yield f"{name}: {failed:,} of {total:,} requests failed{vain}{_how_often(failed / total, result, one)}."


def _of_streams(result: Mapping[str, Any]) -> Iterator[str]:
    """Yield how old the data is that a display shows, for each stream and for polling beside it."""
    for item in result.get("streams", []):
        ages, intervals = item["age_ms"], item["interval_ms"]
        name = f"{excerpt(item['name'], 100)}, {'polled' if item['kind'] == 'polling' else 'streamed'}"
        if item.get("stamped") and item.get("clock") == "not known":
            yield f"{name}: the age of the data is not known, because the robot's clock is not."
        elif ages and intervals:
            error = item.get("age_error_ms") or 0.0
            old = f"{ms(ages['p50'])} ms old when it comes ({ms(ages['max'])} ms at most)"
            if error:
                least = max(0.0, ages["p50"] - error)
                old = (
                    f"{ms(least)} to {ms(ages['p50'] + error)} ms old when it comes (the robot's clock is known to "
                    f"± {ms(error)} ms only)"
                )
            yield (
                f"{name}: the data is {old}, and a display that shows it until the next shows data that is up to "
                f"{ms(ages['max'] + error + intervals['max'])} ms old."
            )


def _of_stops(result: Mapping[str, Any]) -> Iterator[str]:
    """Yield how late a stop took effect, alone and beside other operators."""
    found = result.get("operators") or {"by_number": [], "error": None}
    for item in found["by_number"]:
        if not item["stops"]:
            continue
        number = "One operator" if item["operators"] == 1 else f"Each of {item['operators']} operators reads the state"
        rest, late = item["rest_ms"], item["late"]
        promised = found.get("promised_ms")
        yield (
            f"{number}: a stop takes effect after {ms(rest['p50'])} ms at the median and {ms(rest['max'])} ms at most "
            f"(± {ms(item['known_to_ms'])} ms"
            + (f"; the motion map promises {ms(promised)} ms" if promised else "")
            + (f", which {late} of {item['stops']} stops did not keep" if late else "")
            + ")."
        )
    if found["error"]:
        yield f"How late a stop takes effect is not known: {excerpt(found['error'], 200)}."


def _how_often(share: float, result: Mapping[str, Any], one: Mapping[str, Any]) -> str:
    """Return how often that is at the rate of the run."""
    plan = result["plan"]
    weights = plan.get("weights") or dict.fromkeys(plan["operations"], 1)
    whole = plan.get("rate")
    if not whole or one["operation"] not in weights:
        return ""
    every = 1 / (share * whole * weights[one["operation"]] / sum(weights.values()))
    return f": at this load, one every {every:.2g} s"


def _limits(result: Mapping[str, Any], failed: bool) -> Iterator[str]:  # noqa: FBT001 -- whether any request failed
    plan = result["plan"]
    users = f"{plan.get('users')} user{'' if plan.get('users') == 1 else 's'}"
    load = f"at {rate(plan['rate'])} requests/s" if plan.get("rate") else f"with {users}"
    if plan.get("stages"):
        load = f"in {len(plan['stages'])} stages of up to {rate(plan['rate'])} requests/s"
    near = (result["environment"].get("robot") or {}).get("same_machine")
    network = " on the robot's own machine: a network adds its delay" if near else ""
    yield f"{'' if failed else 'No request failed. '}Measured {load} for {plan['duration_s']:g} s{network}."
    if plan["model"] == "closed":
        whose = "The scenario's users wait" if plan.get("scenario") else "Each user waits"
        yield (
            f"{whose} for a response before the next request (closed model): a slow robot gets fewer requests. "
            "Requests at a fixed rate, as with --rate, may take longer than these."
        )


_MANY_FAR = 0.01
PAPER = {"rest_ms": 1.5, "soap_ms": 2.5, "ratio": 1.67}
"""The paper's mean response times on localhost, and their ratio; it gives neither spread nor method."""

AGAINST = {"slower": ("bad", "✗"), "not slower": ("good", "✓"), "unclear": ("warning", "?")}
"""Tone and sign of the verdicts of `roaas load --against`."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """The verdict at the top of a latency page.

    Attributes:
        tone: "good", "bad", "warning" or "quiet"; it sets the colour.
        sign: the sign beside the words, such as "✓".
        words: the verdict in a few words.
        sentence: the measured result, with its interval.
    """

    tone: str
    sign: str
    words: str
    sentence: str


def verdict(result: Mapping[str, Any], series: AllSeries) -> Verdict:
    """Return the verdict for a page: the headline stored in the result, whose sentence does not repeat its words."""
    words, sentence = result["headline"]["words"], result["headline"]["sentence"]
    return Verdict(*_tone(result, series), words, opened(re.sub(rf"\A{re.escape(words)}[.:] ", "", sentence)))


def _tone(result: Mapping[str, Any], series: AllSeries) -> tuple[str, str]:
    outcomes = {entry["outcome"] for entry in result.get("slo", [])}
    following = (result.get("against") or {}).get("verdict")
    if not result["valid"] or "broken" in outcomes:
        return "bad", "✗"
    if "not known" in outcomes or not any(one.data["count"] for one in series.values()):
        return "warning", "?"
    if following is not None:
        return AGAINST[following]
    return ("good" if outcomes else "quiet"), "✓"


def remarks(result: Mapping[str, Any], series: AllSeries) -> list[str]:
    """Return further observations, a sentence each: stalls, failed requests, and the run's own notes."""
    return [
        *work(series),
        *repeat_text(series),
        *_further(result),
        *_stall_text(result),
        *_two_modes(series),
        *_failure_text(series),
        *(f"{opened(note.rstrip('.'))}." for note in result.get("notes", []) if note),
    ]


def _further(result: Mapping[str, Any]) -> Iterator[str]:
    """Yield for each interface other than SOAP and REST how its median time compares with REST's."""
    for way in result.get("further_interfaces", []):
        if way["quantile"] == "p50" and way["ci95"]:
            yield (
                f"{way['interface'].capitalize()} takes {interval(way['ci95'], of_ratio=True)} times as long as REST "
                f"at the median for {way['operation']}, with the {way['client']} client (95 % interval), "
                f"{ms(way['minus_rest_ms'])} ms more."
            )


def _stall_text(result: Mapping[str, Any]) -> Iterator[str]:
    """Yield one sentence on all stalls and the longest; overlapping stalls of several series count as one."""
    moments: list[list[Stall]] = []
    for stall in sorted(stalls(result), key=lambda stall: stall.start_s):
        if moments and stall.start_s < max(other.end_s for other in moments[-1]):
            moments[-1].append(stall)
        else:
            moments.append([stall])
    if not moments:
        return
    longest = max((stall for moment in moments for stall in moment), key=lambda stall: stall.longest_ms or 0.0)
    operation, client, interface = longest.series
    what = "no request was answered" if longest.longest_ms is None else f"a request took {ms(longest.longest_ms)} ms"
    which = "" if len(moments) == 1 else "; the longest"
    yield (
        f"{counted(len(moments), 'stall')}{which} in seconds {longest.start_s:.0f} to {longest.end_s:.0f} of the run: "
        f"{what} ({operation}, {interface.upper()}, {client})."
    )


def _two_modes(series: AllSeries) -> Iterator[str]:
    """Yield a sentence for each series with a bimodal latency, and one on requests over five times the median."""
    far = []
    for one in series.values():
        found = one.data.get("modes")
        if found is None:
            continue
        name = f"{one.name} ({one.data['client']} client)"
        if found["split_ms"] is not None:
            usual, other = found["medians_ms"]
            yield (
                f"{name} has two modes: {share(found['share_above'])} of the requests take more than "
                f"{ms(found['split_ms'])} ms, about {ms(other)} ms, and the others about {ms(usual)} ms."
            )
        elif found["beyond_five_medians"] >= _MANY_FAR:
            far.append(f"{share(found['beyond_five_medians'])} of {name}")
    if far:
        yield f"Requests over five times the median: {', '.join(far)}."


def _failure_text(series: AllSeries) -> Iterator[str]:
    errors = sum(one.data["errors"] for one in series.values())
    if not errors:
        return
    answered = sum(one.data["count"] for one in series.values())
    yield (
        f"{counted(errors, 'request')} of {errors + answered:,} failed; each counts with at least the time until it "
        "was given up."
    )


#: If the robot's own times over two interfaces differ by this factor, it does different work for them.
_OTHER_WORK = 1.5


def work(series: AllSeries) -> Iterator[str]:
    """Yield a remark for each operation whose server time differs by 1.5 times or more between REST and SOAP."""
    for (operation, client, interface), rest in series.items():
        soap = series.get((operation, client, "soap"))
        if interface != "rest" or client != "wire" or soap is None:
            continue
        spent = [float((one.data["spans_ms"]["server"] or {}).get("p50") or 0.0) for one in (rest, soap)]
        if 0 < _OTHER_WORK * min(spent) <= max(spent):
            yield (
                f"{operation.capitalize()}: by its Server-Timing header the robot itself works for {ms(spent[0])} ms "
                f"over REST and {ms(spent[1])} ms over SOAP at the median. That is not the same work."
            )


def repeat_text(series: AllSeries) -> Iterator[str]:
    """Yield a remark for each series with repeats, on the range of their medians.

    It also says how many of the repeats' intervals do not contain the overall median.
    """
    for one in series.values():
        repeats = [repeat for repeat in one.data.get("repeats", []) if repeat["p50"] and repeat["ci95_ms"]["p50"]]
        whole = one.data["service_ms"]["p50"]
        if len(repeats) > 1 and whole:
            missed = sum(not low <= whole <= high for low, high in (repeat["ci95_ms"]["p50"] for repeat in repeats))
            medians = [repeat["p50"] for repeat in repeats]
            yield (
                f"{one.name}, {one.data['client']}: medians of {len(repeats)} repeats from {ms(min(medians))} to "
                f"{ms(max(medians))} ms; the intervals of {missed} of them do not contain the overall median."
            )
