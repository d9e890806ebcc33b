"""Latency and throughput over the offered load, up to where the robot gives way."""

from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from reports.latency.figures.canvas import COLOUR, MARK, SOFT, Panel, Picture, drawing, gather, log_time_axis


def load(result: Mapping[str, Any]) -> Picture | None:
    """Two panels: latency over the offered rate, and achieved over offered rate; the knee as a vertical line."""
    steps = [step for step in result.get("steps", []) if step["offered_rate"] > 0]
    if not steps:
        return None
    knees = result.get("knee", [])
    with drawing():
        return gather(
            "load",
            "A load that rises in steps. Latency: response time, 99th percentile as a line, median dashed. "
            "Throughput: what came through of what was offered; on the grey line everything did. "
            "Vertical lines: the highest rate that met the criterion. Hollow: a step that did not meet it.",
            [_latency(steps, knees), _throughput(steps, knees)],
        )


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
    log_time_axis(panel.axes, "y", "response time, ms")
    _finish(panel, knees)
    return panel


def _throughput(steps: Sequence[Mapping[str, Any]], knees: Sequence[Mapping[str, Any]]) -> Panel:
    panel = Panel("throughput over load", "Achieved over offered rate; the table of steps holds its figures.")
    rates = sorted({step["offered_rate"] for step in steps})
    panel.axes.plot(rates, rates, color=SOFT, linewidth=0.9, linestyle=":", label="all offered")
    for interface, own in _by_interface(steps).items():
        panel.axes.plot(
            [step["offered_rate"] for step in own],
            [step["achieved_rate"] for step in own],
            color=COLOUR[interface],
            linewidth=1.6,
            label=interface.upper(),
        )
        for step in own:
            _mark(panel, step, step["achieved_rate"], interface)
    panel.axes.set_yscale("log")
    panel.axes.set_ylabel("achieved requests/s")
    _plain(panel.axes.yaxis)
    _finish(panel, knees)
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
