"""What a run says of two robots that took turns (`roaas load --against`): which is slower, and how sure that is."""

from collections.abc import Mapping
from typing import Any

from reports.latency.figures.canvas import COLOUR, Picture
from reports.latency.figures.ratios import Ratio, ratios
from reports.latency.numbers import interval, ms, ratio, share

WORDS = {"p50": "the median", "p99": "the 99th percentile"}
_TONES = {
    "slower": ("bad", "✗", "Slower than the other robot"),
    "not slower": ("good", "✓", "Not slower than the other robot"),
    "unclear": ("warning", "?", "Whether it is slower cannot be told"),
}
_TAGS = {"slower": ("bad", "✗"), "not slower": ("good", "✓"), "unclear": ("warning", "?")}


def short(result: Mapping[str, Any]) -> tuple[str, str, str] | None:
    """Tone, sign and words of the verdict; None where no other robot took part."""
    compared = result.get("against")
    return None if compared is None else _TONES[compared["verdict"]]


def sentence(result: Mapping[str, Any]) -> str:
    """The change that the verdict rests on: of those that decided it, the one with the highest upper bound."""
    compared = result["against"]
    changes = [change for change in compared["changes"] if change["ci95"] and change["verdict"] is not None]
    deciding = [change for change in changes if change["verdict"] == compared["verdict"]]
    if not deciding:
        return "No figure has an interval: measure longer."
    leading = max(deciding, key=lambda change: (change["quantile"] == "p50", change["ci95"][1]))
    where = f"{WORDS[leading['quantile']]} of {leading['operation']} over {leading['interface'].upper()}"
    times = f"{interval(leading['ci95'], of_ratio=True)} times as long as the other one"
    estimate = f"estimate {ratio(leading['ratio'])}, {ms(leading['difference_ms'])} ms"
    return (
        f"At {where} this robot takes {times} (95 % interval, {estimate}); {share(compared['tolerance'])} more is "
        "tolerated."
    )


def tag(change: Mapping[str, Any]) -> tuple[str, str] | None:
    """Tone and sign of one change's verdict; None where it is not judged."""
    return _TAGS.get(change["verdict"])


def picture(result: Mapping[str, Any]) -> Picture | None:
    """The ratios with their intervals, the tolerance as a dashed line."""
    compared = result.get("against")
    if compared is None:
        return None
    rows = [
        Ratio(
            f"{change['operation']}, {change['interface'].upper()}, {WORDS[change['quantile']].removeprefix('the ')}",
            change["ratio"],
            (change["ci95"][0], change["ci95"][1]) if change["ci95"] else None,
            COLOUR[change["interface"]],
        )
        for change in compared["changes"]
        if change["ratio"] is not None and change["verdict"] is not None
    ]
    return ratios(
        "against",
        "this robot over the other",
        rows,
        "Service time: how many times as long requests take on this robot as on the other one, with 95 % intervals. "
        "Right of 1 this robot is slower; the dashed line is what is tolerated.",
        mark=(1 + compared["tolerance"], f"tolerance, {share(compared['tolerance'])}"),
    )
