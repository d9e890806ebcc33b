"""Draw latency over the load: over the offered rate up to saturation, and over the number of busy connections."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from reports.latency.figures.canvas import COLOUR, MARK, Panel, log_time_axis, picture


@picture(
    "load",
    "Response time under increasing load: the 99th percentile as a solid line, the median dashed. Over the offered "
    "rate: a vertical line is the highest rate that met the criterion, a hollow marker is a step that did not. Over "
    "the number of connections that are always busy: where latency doubles with it, the robot is saturated.",
)
def load(result: Mapping[str, Any]) -> Iterator[Panel]:
    """Yield panels of latency over the offered rate and over the number of busy connections, if measured.

    A vertical line marks the knee, the highest rate that met the latency criterion.
    """
    steps = [step for step in result.get("steps", []) if step["offered_rate"] > 0]
    crowds = [one for one in result.get("over_connections", []) if one["p50_ms"] is not None]
    if steps:
        yield _latency(steps, result.get("knee", []))
    if crowds:
        yield _crowd(crowds)


def _latency(steps: Sequence[Mapping[str, Any]], knees: Sequence[Mapping[str, Any]]) -> Panel:
    panel = Panel("latency over load", "Response time over the offered rate; the table of steps holds its figures.")
    _lines(panel, sorted(steps, key=lambda step: (step["interface"], step["offered_rate"])), "offered_rate")
    for knee in knees:
        if knee["highest_rate"]:
            # The dashes of two knees at the same rate interlock, so that both stay visible.
            offset = 0 if knee["interface"] == "rest" else 5
            panel.axes.axvline(
                knee["highest_rate"], color=COLOUR[knee["interface"]], linewidth=1.3, linestyle=(offset, (5, 5))
            )
    panel.axes.set_xlabel("offered requests/s")
    panel.axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0), numticks=9))
    panel.legend()
    return panel


def _crowd(crowds: Sequence[Mapping[str, Any]]) -> Panel:
    text = "; ".join(f"{one['interface'].upper()}, {one['connections']}: {one['rate']:,.0f}/s" for one in crowds)
    panel = Panel("latency over connections", f"Response time over the number of busy connections. Answered: {text}.")
    _lines(panel, crowds, "connections")
    panel.axes.set_xlabel("connections that are always busy")
    panel.axes.set_xticks(sorted({one["connections"] for one in crowds}))
    panel.legend()
    return panel


def _lines(panel: Panel, points: Sequence[Mapping[str, Any]], over: str) -> None:
    """Draw p99 and median of each interface; the marker of a point that did not meet the criterion is hollow."""
    axes = panel.axes
    for interface in dict.fromkeys(one["interface"] for one in points):
        colour = COLOUR[interface]
        for key, style, name in (("p99_ms", "-", "99 %"), ("p50_ms", "--", "median")):
            shown = [one for one in points if one["interface"] == interface and one[key] is not None]
            label = f"{interface.upper()} {name}"
            axes.plot([one[over] for one in shown], [one[key] for one in shown], style, color=colour, label=label)
            for one in shown:
                filled = colour if one.get("meets", True) else "white"
                axes.plot([one[over]], [one[key]], MARK[interface], color=colour, markersize=5, markerfacecolor=filled)
    log_time_axis(axes, "response time, ms")
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.0f}" if value >= 1 else f"{value:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
