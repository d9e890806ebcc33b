"""Describe a latency result in sentences: the verdict, and remarks with their confidence intervals."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from reports.latency.distributions import AllSeries
from reports.latency.figures.timeline import Stall, stalls
from reports.latency.numbers import interval, ms, share
from reports.pages.page import counted, opened

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
    """Return the verdict for a page: the headline stored in the result, with the tone and sign that fit."""
    said = result["headline"]
    return Verdict(*_tone(result, series), said["words"], said["sentence"])


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
        *_failure_text(result, series),
        *_note_text(result),
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


def _failure_text(result: Mapping[str, Any], series: AllSeries) -> Iterator[str]:
    errors = sum(one.data["errors"] for one in series.values())
    if not errors and not result.get("errors"):
        return
    answered = sum(one.data["count"] for one in series.values())
    yield (
        f"{counted(errors, 'request')} of {errors + answered:,} failed; each counts with at least the time until it "
        "was given up."
    )


def _note_text(result: Mapping[str, Any]) -> Iterator[str]:
    """Yield the notes stored in the result as sentences, with a capital letter and a period."""
    yield from (f"{opened(note.rstrip('.'))}." for note in result.get("notes", []) if note)


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
