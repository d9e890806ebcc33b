"""Draw latency and throughput over the offered rate, with the region in which the robot's knee lies."""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from statistics import median
from typing import Any

from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from reports.latency.figures.canvas import COLOUR, LINE, MARK, SOFT, Panel, log_time_axis, picture

_LINES = (("p99_ms", "-", "99 %"), ("p95_ms", "-.", "95 %"), ("p50_ms", "--", "median"))


@picture(
    "load",
    "Response time and throughput over the offered rate. The shaded region is where the knee lies: below it all "
    "searches kept the criterion, above it none did. A hollow marker is a rate that did not keep it. Of several trials "
    "of a rate the median is drawn. Where throughput leaves the dotted line, the robot answers less than it is asked.",
)
def load(result: Mapping[str, Any]) -> Iterator[Panel]:
    """Yield a panel of latency for each interface whose knee was searched, and one of throughput."""
    searches = [(search, curve) for search in result.get("knee_search", []) if (curve := _curve(search))]
    for search, curve in searches:
        yield _latency(search, curve)
    if searches:
        yield _throughput(searches)


def _curve(search: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return a point for each rate, with the medians of its trials."""
    trials: defaultdict[float, list[Mapping[str, Any]]] = defaultdict(list)
    for trial in search.get("curve", []):
        if trial["offered_rate"] > 0:
            trials[trial["offered_rate"]].append(trial)
    points = []
    for rate, found in sorted(trials.items()):
        point: dict[str, Any] = {"rate": rate, "meets": any(trial["meets"] for trial in found)}
        for key in ("achieved_rate", "p50_ms", "p95_ms", "p99_ms"):
            values = [trial[key] for trial in found if trial.get(key) is not None]
            point[key] = median(values) if values else None
        points.append(point)
    return points


def _latency(search: Mapping[str, Any], curve: Sequence[Mapping[str, Any]]) -> Panel:
    name = search["interface"]
    panel = Panel(
        f"latency over load, {name.upper()}", f"Response time of {name} over the offered rate, with the knee's region."
    )
    for key, style, word in _LINES:
        _line(panel.axes, name, [(each["rate"], each[key], each["meets"]) for each in curve], style, word)
    _region(panel.axes, search)
    log_time_axis(panel.axes, "response time, ms")
    _rates(panel.axes)
    panel.legend(4)
    return panel


def _throughput(searches: Sequence[tuple[Mapping[str, Any], Sequence[Mapping[str, Any]]]]) -> Panel:
    panel = Panel("throughput over load", "Answered requests per second over the offered rate.")
    axes, every = panel.axes, [each["rate"] for _, curve in searches for each in curve]
    axes.plot([min(every), max(every)], [min(every), max(every)], ":", color=SOFT, label="as offered")
    for search, curve in searches:
        name = search["interface"]
        points = [(each["rate"], each["achieved_rate"], each["meets"]) for each in curve]
        _line(axes, name, points, "-", name.upper())
        _region(axes, search)
    axes.set_yscale("symlog", linthresh=1)
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.0f}"))
    axes.set_ylabel("answered requests/s")
    _rates(axes)
    panel.legend(4)
    return panel


def _line(axes: Axes, name: str, points: Sequence[tuple[float, float | None, bool]], style: str, label: str) -> None:
    """Draw a line; the marker of a rate that did not keep the criterion is hollow."""
    shown = [(rate, value, meets) for rate, value, meets in points if value is not None]
    colour = COLOUR[name]
    axes.plot([rate for rate, *_ in shown], [value for _, value, _ in shown], style, color=colour, label=label)
    for rate, value, meets in shown:
        filled = colour if meets else "white"
        axes.plot([rate], [value], MARK[name], color=colour, markersize=4, markerfacecolor=filled)


def _region(axes: Axes, search: Mapping[str, Any]) -> None:
    """Shade from the lowest to the highest end of the searches' brackets."""
    low, high = search["interval"] or (None, None)
    if low and high:
        axes.axvspan(low, high, color=LINE, zorder=0)


def _rates(axes: Axes) -> None:
    axes.set_xlabel("offered requests/s")
    axes.set_xscale("log")
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0), numticks=9))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.0f}" if value >= 1 else f"{value:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
