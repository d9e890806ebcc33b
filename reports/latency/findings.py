"""What a latency result says, in sentences: the verdict first, each claim with its interval."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from reports.latency import against
from reports.latency.distributions import Series
from reports.latency.figures.spans import means
from reports.latency.figures.timeline import Stall, stalls
from reports.latency.numbers import interval, ms, rate, ratio, share
from reports.latency.of_series import cold, repeated, work

_MANY_FAR = 0.01
_MISSED = 1  # the exit code of a run whose thresholds are missed, be it because requests failed
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
    """The verdict on a result as a whole: valid or not first, thresholds next, then what was found."""
    found = headline(result, series) + _modes_in_short(series)
    if not result["valid"] and not (result.get("exit_code") == _MISSED and result.get("thresholds") and series):
        return Verdict("bad", "✗", "Not valid: these figures say nothing about the robot", found)
    outcomes = [threshold["outcome"] for threshold in result.get("thresholds", [])]
    missed, unsure = outcomes.count("missed"), outcomes.count("inconclusive")
    if missed:
        return Verdict("bad", "✗", f"{missed} of {_count(len(outcomes), 'threshold')} missed", found)
    if unsure:
        return Verdict("warning", "?", f"{unsure} of {_count(len(outcomes), 'threshold')} undecided", found)
    if not any(one.data["count"] for one in series.values()):
        return Verdict("warning", "?", "Nothing was measured", found)
    return Verdict(*_good_news(result, len(outcomes)), found)


def _good_news(result: Mapping[str, Any], met: int) -> tuple[str, str, str]:
    """Tone, sign and words of a valid result that missed none of its thresholds, of which it `met` so many."""
    compared = against.short(result)
    if compared is not None:
        return compared
    if met:
        return "good", "✓", "The threshold is met" if met == 1 else f"All {met} thresholds are met"
    return "quiet", "✓", _in_short(result)


def headline(result: Mapping[str, Any], series: Mapping[tuple[str, str, str], Series]) -> str:
    """How SOAP compares with REST at the median, for the operation and client that tell most; or robot with robot."""
    if result.get("against"):
        return against.sentence(result)
    leading = _leading(result)
    if leading is None:
        return _alone(series)
    operation, client = leading["operation"], leading["client"]
    told = result.get("headline")
    if told is not None:
        differs = leading["judgement"] in {"differs", "bounded"}
        return str(told["sentence"]) + (_server_share(series, operation, client) if differs else "")
    where = f"for {operation}, with the {client} client"
    low, high = leading["ci95"]
    if low <= 1 <= high or _within_noise(result, leading):
        return (
            f"No difference between SOAP and REST can be shown at the median {where}: SOAP takes {ratio(low)} to "
            f"{ratio(high)} times as long (95 % interval, estimate {ratio(leading['ratio'])})."
        )
    return (
        f"SOAP takes {ratio(low)} to {ratio(high)} times as long as REST at the median {where} (95 % interval, "
        f"estimate {ratio(leading['ratio'])}).{_server_share(series, operation, client)}"
    )


def remarks(result: Mapping[str, Any], series: Mapping[tuple[str, str, str], Series]) -> list[str]:
    """Further findings, a sentence each: noise floor, stalls, knee, failures."""
    return [
        *_noise(result),
        *work(series),
        *cold(series),
        *repeated(series),
        *_other_ways(result),
        *_followed(result),
        *_stalled(result),
        *_two_modes(series),
        *_knees(result),
        *_searched(result),
        *_failed(result, series),
    ]


def _leading(result: Mapping[str, Any]) -> Mapping[str, Any] | None:
    usable = [c for c in result["comparisons"] if c["quantile"] == "p50" and c["ci95"] and c["ratio"]]
    order = {"delivery": 0, "pose": 1, "coffee": 2}
    return min(usable, key=lambda c: (c["client"] != "wire", order[c["operation"]]), default=None)


def _in_short(result: Mapping[str, Any]) -> str:
    leading = _leading(result)
    if leading is None:
        return "Valid measurement"
    told = result.get("headline")
    if told is not None:
        return str(told["words"])
    low, high = leading["ci95"]
    if low <= 1 <= high or _within_noise(result, leading):
        return "No difference between SOAP and REST can be shown"
    return f"SOAP takes {ratio(leading['ratio'])} times as long as REST"


def _within_noise(result: Mapping[str, Any], leading: Mapping[str, Any]) -> bool:
    """Whether an interface differs from itself by as much: asked of files that hold no judgement of their own."""
    return any(
        noise["ci95"] and noise["ci95"][0] <= leading["ratio"] <= noise["ci95"][1]
        for noise in result.get("noise_floor", [])
        if all(noise[key] == leading[key] for key in ("operation", "client", "quantile"))
    )


def _alone(series: Mapping[tuple[str, str, str], Series]) -> str:
    """What can be said where SOAP and REST cannot be compared."""
    for one in series.values():
        if one.data["count"] and one.data["service_ms"]["p50"] is not None:
            bounds = one.data["ci95_ms"]["p50"]
            sure = f" (95 % interval {interval(bounds)} ms)" if bounds else " (too few requests for an interval)"
            return (
                f"Half of {one.name} requests took at most {ms(one.data['service_ms']['p50'])} ms{sure}. SOAP and REST "
                "cannot be compared by this run."
            )
    return "No series has enough successful requests for a figure."


def _server_share(series: Mapping[tuple[str, str, str], Series], operation: str, client: str) -> str:
    rest, soap = series.get((operation, client, "rest")), series.get((operation, client, "soap"))
    if rest is None or soap is None:
        return ""
    rest_parts, soap_parts = means(rest), means(soap)
    if "server" not in rest_parts or "server" not in soap_parts:
        return " How much of that the server spends is not known: it sends no Server-Timing."
    extra = sum(soap_parts.values()) - sum(rest_parts.values())
    server = soap_parts["server"] - rest_parts["server"]
    if extra <= 0:
        return ""
    return f" Of SOAP's extra {ms(extra)} ms on average, the server spends {ms(server)} ms."


def _noise(result: Mapping[str, Any]) -> list[str]:
    leading = _leading(result)
    key = (leading["operation"], leading["client"]) if leading else ("delivery", "wire")
    for noise in result.get("noise_floor", []):
        if (noise["operation"], noise["client"]) == key and noise["quantile"] == "p50" and noise["ci95"]:
            sentence = (
                f"Noise floor: {noise['interface'].upper()} against itself, measured in the same way, comes to "
                f"{interval(noise['ci95'], of_ratio=True)} times (95 % interval)."
            )
            return [sentence]
    return []


def _other_ways(result: Mapping[str, Any]) -> list[str]:
    """What each interface beside SOAP and REST takes at the median."""
    return [
        f"{way['interface'].capitalize()} takes {interval(way['ci95'], of_ratio=True)} times as long as REST at the "
        f"median for {way['operation']}, with the {way['client']} client (95 % interval), "
        f"{ms(way['minus_rest_ms'])} ms more."
        for way in result.get("other_ways", [])
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


def _modes_in_short(series: Mapping[tuple[str, str, str], Series]) -> str:
    """What the verdict has to say where a median stands for two kinds of request."""
    names = [one.name for one in series.values() if (one.data.get("modes") or {}).get("split_ms") is not None]
    return f" {', '.join(dict.fromkeys(names))}: two modes, for which no one figure stands." if names else ""


def _two_modes(series: Mapping[tuple[str, str, str], Series]) -> list[str]:
    """A sentence for each series that has two modes, or a share of requests far beyond the median."""
    told = []
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
        elif found["far"] >= _MANY_FAR:
            told.append(f"{share(found['far'])} of the requests of {name} take over five times the median.")
    return told


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


def _count(number: int, noun: str) -> str:
    return f"{number:,} {noun}{'' if number == 1 else 's'}"
