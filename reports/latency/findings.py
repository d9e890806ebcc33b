"""What a latency result says, in sentences: the verdict first, each claim with its interval."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from reports.latency import against
from reports.latency.distributions import Series
from reports.latency.figures.spans import means
from reports.latency.figures.timeline import Stall, stalls
from reports.latency.numbers import interval, ms, rate, share
from reports.latency.of_series import cold, repeated, work
from reports.pages.page import opened

_MANY_FAR = 0.01
PAPER = {"rest_ms": 1.5, "soap_ms": 2.5, "ratio": 1.67}
"""What the paper reports: mean response times on localhost, and their ratio. It gives no spread and no method."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """The head of the report.

    Attributes:
        tone: "good", "bad", "warning" or "quiet".
        sentence: what was found, with its interval.
    """

    tone: str
    sign: str
    words: str
    sentence: str


def verdict(result: Mapping[str, Any], series: Mapping[tuple[str, str, str], Series]) -> Verdict:
    """The result's own headline, and the tone in which it is said."""
    said = result["headline"]
    return Verdict(*_tone(result, series), said["words"], said["sentence"])


def _tone(result: Mapping[str, Any], series: Mapping[tuple[str, str, str], Series]) -> tuple[str, str]:
    outcomes = {threshold["outcome"] for threshold in result.get("thresholds", [])}
    following = (result.get("against") or {}).get("verdict")
    if not result["valid"] or "missed" in outcomes:
        return "bad", "✗"
    if "inconclusive" in outcomes or not any(one.data["count"] for one in series.values()):
        return "warning", "?"
    if following is not None:
        return against.TAGS[following]
    return ("good" if outcomes else "quiet"), "✓"


def remarks(result: Mapping[str, Any], series: Mapping[tuple[str, str, str], Series]) -> list[str]:
    """Further findings, a sentence each: stalls, knee, failures, and the run's own notes."""
    return [
        *_server_share(series),
        *work(series),
        *cold(series),
        *repeated(series),
        *_further(result),
        *_followed(result),
        *_stalled(result),
        *_two_modes(series),
        *_knees(result),
        *_searched(result),
        *_failed(result, series),
        *_noted(result),
    ]


def _server_share(series: Mapping[tuple[str, str, str], Series]) -> list[str]:
    """How much of what SOAP takes more the server spends, by the wire client, where the robot says it."""
    told = []
    for (operation, client, interface), soap in series.items():
        rest = series.get((operation, client, "rest"))
        if (client, interface) != ("wire", "soap") or rest is None:
            continue
        rest_parts, soap_parts = means(rest), means(soap)
        extra = sum(soap_parts.values()) - sum(rest_parts.values())
        if "server" in rest_parts and "server" in soap_parts and extra > 0:
            server = soap_parts["server"] - rest_parts["server"]
            told.append(
                f"Of the {ms(extra)} ms that SOAP takes more for {operation} on average, the server spends "
                f"{ms(server)} ms."
            )
    return told


def _further(result: Mapping[str, Any]) -> list[str]:
    """What each interface beside SOAP and REST takes at the median."""
    return [
        f"{way['interface'].capitalize()} takes {interval(way['ci95'], of_ratio=True)} times as long as REST at the "
        f"median for {way['operation']}, with the {way['client']} client (95 % interval), "
        f"{ms(way['minus_rest_ms'])} ms more."
        for way in result.get("further_interfaces", [])
        if way["quantile"] == "p50" and way["ci95"]
    ]


def _followed(result: Mapping[str, Any]) -> list[str]:
    """How long a delivery takes over each way until the application has it."""
    ways = result.get("end_to_end", {}).get("ways", [])
    told = [
        f"{ms(way['to_application_ms']['p50'])} ms over {way['interface'].upper()}"
        for way in ways
        if way["to_application_ms"]["p50"] is not None
    ]
    lost = sum(way["lost"] for way in ways)
    missing = f" {lost:,} answered well never arrived." if lost else ""
    return [f"The application has a delivery after {', '.join(told)} at the median.{missing}"] if told else []


def _stalled(result: Mapping[str, Any]) -> list[str]:
    """Stalls as moments of the robot: those of several series that overlap are one."""
    moments: list[list[Stall]] = []
    for stall in sorted(stalls(result), key=lambda stall: stall.start_s):
        if moments and stall.start_s < max(other.end_s for other in moments[-1]):
            moments[-1].append(stall)
        else:
            moments.append([stall])
    if not moments:
        return []
    longest = max((stall for moment in moments for stall in moment), key=lambda stall: stall.longest_ms or 0.0)
    operation, client, interface = longest.series
    told = "no request was answered" if longest.longest_ms is None else f"{ms(longest.longest_ms)} ms"
    which = "" if len(moments) == 1 else ", the longest"
    sentence = (
        f"{_count(len(moments), 'stall')}{which} in seconds {longest.start_s:.0f} to {longest.end_s:.0f}: {told} "
        f"({operation}, {interface.upper()}, {client})."
    )
    return [sentence]


def _two_modes(series: Mapping[tuple[str, str, str], Series]) -> list[str]:
    """A sentence for each series that has two modes, and one on those of which many requests lie far off."""
    told, far = [], []
    for one in series.values():
        found = one.data.get("modes")
        if found is None:
            continue
        name = f"{one.name} ({one.data['client']} client)"
        if found["split_ms"] is not None:
            usual, other = found["medians_ms"]
            told.append(
                f"{name} has two modes: {share(found['share_above'])} of the requests take more than "
                f"{ms(found['split_ms'])} ms, about {ms(other)} ms, and the others about {ms(usual)} ms."
            )
        elif found["beyond_five_medians"] >= _MANY_FAR:
            far.append(f"{share(found['beyond_five_medians'])} of {name}")
    return [*told, f"Over five times the median take: {', '.join(far)}."] if far else told


def _knees(result: Mapping[str, Any]) -> list[str]:
    told: list[str] = []
    explained: set[str] = set()
    for knee in result.get("knee", []):
        name = knee["interface"].upper()
        # One criterion serves both interfaces, as a rule: it is told once.
        criterion = "" if knee["criterion"] in explained else f" ({knee['criterion']})"
        explained.add(knee["criterion"])
        if knee["highest_rate"] is None:
            told.append(f"{name} met the criterion at no offered rate{criterion}.")
            continue
        sentence = f"{name} holds up to {rate(knee['highest_rate'])} requests/s{criterion}"
        missed = knee.get("first_rate_missed")
        if missed is None:
            told.append(f"{sentence}, the highest rate offered: the knee lies above it.")
            continue
        because = f": {knee['reason']}" if knee.get("reason") else ""
        limit = " The generator, not the robot, was the limit." if knee.get("limited_by") == "generator" else ""
        told.append(f"{sentence}; it gave way at {rate(missed)} requests/s{because}.{limit}")
    return told


def _searched(result: Mapping[str, Any]) -> list[str]:
    """Where the robot gives way, by bisection."""
    told = []
    for knee in result.get("knee_search", []):
        name = "REST and SOAP at once" if knee["interface"] == "both" else knee["interface"].upper()
        if knee["rate"] is None:
            held = knee.get("held_up_to")
            told.append(f"{name}: no knee up to {rate(held)} requests/s." if held else f"{name}: no knee was found.")
            continue
        low, high = knee["interval"]
        limit = " The generator, not the robot, was the limit." if knee.get("limited_by") == "generator" else ""
        first = knee.get("errors_from")
        failing = "" if first is None else f" Requests failed from {rate(first)} requests/s on."
        told.append(
            f"{name}: gives way at {rate(knee['rate'])} requests/s ({rate(low)} to {rate(high)}, "
            f"{knee['searches']} searches).{failing}{limit}"
        )
    return told


def _failed(result: Mapping[str, Any], series: Mapping[tuple[str, str, str], Series]) -> list[str]:
    errors = sum(one.data["errors"] for one in series.values())
    if not errors and not result.get("errors"):
        return ["No request failed."] if any(one.data["count"] for one in series.values()) else []
    answered = sum(one.data["count"] for one in series.values())
    counted = (
        "they count as at least their age when they were given up"
        if all("counted" in one.data for one in series.values())
        else "they are in no figure of time"
    )
    return [f"{_count(errors, 'request')} of {errors + answered:,} failed; {counted}."]


def _noted(result: Mapping[str, Any]) -> list[str]:
    """The result's notes, which are clauses, as sentences."""
    return [f"{opened(note.rstrip('.'))}." for note in result.get("notes", []) if note]


def _count(number: int, noun: str) -> str:
    return f"{number:,} {noun}{'' if number == 1 else 's'}"
