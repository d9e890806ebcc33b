"""Show two robots measured alternately in one run (`roaas load --against`): verdict signs and a figure."""

from collections.abc import Mapping
from typing import Any

from reports.latency.figures.canvas import COLOUR, Picture
from reports.latency.figures.ratios import Ratio, ratios
from reports.latency.numbers import share

_WORDS = {"p50": "median", "p99": "99th percentile"}
TAGS = {"slower": ("bad", "✗"), "not slower": ("good", "✓"), "unclear": ("warning", "?")}


def tag(change: Mapping[str, Any]) -> tuple[str, str] | None:
    """Return CSS tone and sign for the verdict on one compared quantile, or None if it was not judged."""
    return TAGS.get(change["verdict"])


def picture(result: Mapping[str, Any]) -> Picture | None:
    """Return a figure of the ratios of service times of both robots, or None without a second robot.

    Each ratio has its 95 % interval; a dashed line marks the tolerance.
    """
    compared = result.get("against")
    if compared is None:
        return None
    rows = [
        Ratio(
            f"{change['operation']}, {change['interface'].upper()}, {_WORDS[change['quantile']]}",
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
        "Service time on this robot divided by service time on the other one, with 95 % intervals. Right of 1 this "
        "robot is slower. The dashed line is the tolerance.",
        mark=(1 + compared["tolerance"], f"tolerance, {share(compared['tolerance'])}"),
    )
