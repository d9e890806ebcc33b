"""Latency over the load: over the offered rate up to saturation, and over the number of busy connections."""

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
    """Yield latency over the offered rate, with knees as vertical lines, and over the number of busy connections."""
    steps = [step for step in result.get("steps", []) if step["offered_rate"] > 0]
    crowds = [one for one in result.get("over_connections", []) if one["p50_ms"] is not None]
    if steps:
        yield _latency(steps, result.get("knee", []))
    if crowds:
        yield _crowd(crowds)


def _latency(steps: Sequence[Mapping[str, Any]], knees: Sequence[Mapping[str, Any]]) -> Panel:
    panel = Panel("latency over load", "Response time over the offered rate; the table of steps holds its figures.")
    for interface, own in _by_interface(steps).items():
        for key, style, label in (("p99_ms", "-", "99 %"), ("p50_ms", "--", "median")):
            shown = [step for step in own if step[key] is not None]
            rates = [step["offered_rate"] for step in shown]
            panel.axes.plot(
                rates,
                [step[key] for step in shown],
                style,
                color=COLOUR[interface],
                linewidth=1.6,
                label=f"{interface.upper()} {label}",
            )
            for step in shown:
                _mark(panel, step, step[key], interface)
    log_time_axis(panel.axes, "response time, ms")
    _finish(panel, knees)
    return panel


def _crowd(crowds: Sequence[Mapping[str, Any]]) -> Panel:
    told = "; ".join(f"{one['interface'].upper()}, {one['connections']}: {one['rate']:,.0f}/s" for one in crowds)
    panel = Panel("latency over connections", f"Response time over the number of busy connections. Answered: {told}.")
    for interface in dict.fromkeys(one["interface"] for one in crowds):
        for key, style, label in (("p99_ms", "-", "99 %"), ("p50_ms", "--", "median")):
            shown = [one for one in crowds if one["interface"] == interface and one[key] is not None]
            panel.axes.plot(
                [one["connections"] for one in shown],
                [one[key] for one in shown],
                style,
                marker=MARK[interface],
                markersize=5,
                color=COLOUR[interface],
                linewidth=1.6,
                label=f"{interface.upper()} {label}",
            )
    log_time_axis(panel.axes, "response time, ms")
    panel.axes.set_xscale("log")
    panel.axes.set_xlabel("connections that are always busy")
    panel.axes.set_xticks(sorted({one["connections"] for one in crowds}))
    panel.axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.0f}"))
    panel.axes.xaxis.set_minor_formatter(NullFormatter())
    panel.legend()
    return panel


def _finish(panel: Panel, knees: Sequence[Mapping[str, Any]]) -> None:
    for knee in knees:
        if knee["highest_rate"]:
            # Two knees may lie at one rate: the dashes interlock, so that both stay visible.
            offset = 0 if knee["interface"] == "rest" else 5
            panel.axes.axvline(
                knee["highest_rate"], color=COLOUR[knee["interface"]], linewidth=1.3, linestyle=(offset, (5, 5))
            )
    panel.axes.set_xscale("log")
    panel.axes.set_xlabel("offered requests/s")
    _plain(panel.axes.xaxis)
    panel.legend()


def _plain(axis: Any) -> None:
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0), numticks=9))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.0f}" if value >= 1 else f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def _mark(panel: Panel, step: Mapping[str, Any], value: float, interface: str) -> None:
    panel.axes.plot(
        [step["offered_rate"]],
        [value],
        MARK[interface],
        color=COLOUR[interface],
        markersize=5,
        markerfacecolor=COLOUR[interface] if step["meets"] else "white",
    )


def _by_interface(steps: Sequence[Mapping[str, Any]]) -> dict[str, list[Mapping[str, Any]]]:
    found: dict[str, list[Mapping[str, Any]]] = {}
    for step in sorted(steps, key=lambda step: (step["interface"], step["offered_rate"])):
        found.setdefault(step["interface"], []).append(step)
    return found
