"""Draw latency over the run and over the rate: heat map, medians of blocks, stalls, and the region of the knee."""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Any

from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import LogNorm
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

from reports.latency.figures.canvas import COLOUR, INK, LINE, MARK, SOFT, Panel, log_time_axis, picture

_LINES = (("p99_ms", "-", "99 %"), ("p95_ms", "-.", "95 %"), ("p50_ms", "--", "median"))


@picture(
    "load",
    "Response time and throughput over the offered rate. The shaded region is where the knee lies: below it all "
    "searches kept the criterion, above it none did. A filled marker is the median of a rate's trials that kept it, a "
    "hollow one that of its trials that missed it: a rate with both is uncertain. Where throughput leaves the dotted "
    "line, the robot answers less than it is asked.",
)
def load(result: Mapping[str, Any]) -> Iterator[Panel]:
    """Yield a panel of latency for each interface whose knee was searched, and one of throughput."""
    searches = [(search, curve) for search in result.get("knee_search", []) if (curve := _curve(search))]
    for search, curve in searches:
        yield _latency(search, curve)
    if searches:
        yield _throughput(searches)


def _curve(search: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return a point for the trials of each rate that kept the criterion and one for those that missed it: medians."""
    trials: defaultdict[tuple[float, bool], list[Mapping[str, Any]]] = defaultdict(list)
    for trial in search.get("curve", []):
        if trial["offered_rate"] > 0:
            trials[trial["offered_rate"], not trial["meets"]].append(trial)
    points = []
    for (rate, missed), found in sorted(trials.items()):
        point: dict[str, Any] = {"rate": rate, "meets": not missed}
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


_MOST_POINTS = 240
_STALL_FACTOR = 20
_STALL_FLOOR_MS = 20.0
_STALL_COLOUR = "#F0E442"
_MAPS = {"rest": "Blues", "soap": "Oranges", "rosbridge": "Greens"}


@dataclass(frozen=True, slots=True)
class Stall:
    """A period of the run in which a request waited far longer than usual; times in seconds since the start.

    Attributes:
        longest_ms: longest response time in the period; None if no request was answered.
        series: operation, client, interface.
    """

    start_s: float
    end_s: float
    longest_ms: float | None
    series: tuple[str, str, str]


def stalls(result: Mapping[str, Any]) -> list[Stall]:
    """Return the stalls: intervals whose longest response took 20 times the usual time and over 20 ms.

    The usual time is the median of the intervals' medians. An interval in which every request failed counts as well,
    and
    adjacent intervals are one stall.
    """
    found: list[Stall] = []
    for series in _nonempty(result):
        width = result["time_series"]["width_s"]
        medians = [point["p50_ms"] for point in series["points"] if point["p50_ms"] is not None]
        limit = max(_STALL_FLOOR_MS, _STALL_FACTOR * median(medians)) if medians else _STALL_FLOOR_MS
        open_stall: Stall | None = None
        for point in series["points"]:
            longest = point["max_ms"]
            silent = longest is None and point["errors"] > 0
            if not silent and (longest is None or longest <= limit):
                open_stall = None
                continue
            if open_stall is not None:
                found.pop()
                longest = max((x for x in (open_stall.longest_ms, longest) if x is not None), default=None)
            start = open_stall.start_s if open_stall is not None else point["t_s"]
            key = series["operation"], series["client"], series["interface"]
            open_stall = Stall(start, point["t_s"] + width, longest, key)
            found.append(open_stall)
    return found


@picture(
    "timeline",
    "Response time over the run. Line: median of each interval. Markers: its longest request. Crosses: failed "
    "requests. Yellow: stalls, in which a request took 20 times as long as usual and over 20 ms.",
)
def timeline(result: Mapping[str, Any]) -> Iterator[Panel]:
    """Yield a panel for each client and operation: median and longest response time over the run."""
    marks = stalls(result)
    timed = list(_nonempty(result))
    for operation, client in dict.fromkeys((s["operation"], s["client"]) for s in timed):
        drawn = [s for s in timed if (s["operation"], s["client"]) == (operation, client)]
        own = [stall for stall in marks if stall.series[:2] == (operation, client)]
        panel = Panel(
            f"{operation}, {client} client",
            f"Response times of {operation} with the {client} client over the run; "
            f"{len(own)} {'stall' if len(own) == 1 else 'stalls'} marked.",
        )
        for stall in own:
            panel.axes.axvspan(stall.start_s, stall.end_s, color=_STALL_COLOUR, alpha=0.5, linewidth=0)
        for series in drawn:
            _draw(panel, series)
        log_time_axis(panel.axes, "response time, ms")
        panel.axes.xaxis.set_major_locator(MaxNLocator(7, integer=True))
        panel.axes.set_xlabel("seconds since the start")
        longest = max(own, key=lambda stall: stall.longest_ms or 0.0, default=None)
        if longest is not None and longest.longest_ms is not None:
            late = longest.end_s > 0.8 * panel.axes.get_xlim()[1]  # there is no room to the right
            panel.axes.annotate(
                f"{longest.longest_ms:,.0f} ms",
                (longest.start_s if late else longest.end_s, longest.longest_ms),
                (-4 if late else 4, 0),
                textcoords="offset points",
                ha="right" if late else "left",
                va="center",
                color=INK,
            )
        panel.legend()
        yield panel


def _draw(panel: Panel, series: Mapping[str, Any]) -> None:
    interface = series["interface"]
    points = _thin_out([point for point in series["points"] if point["p50_ms"] is not None])
    colour = COLOUR[interface]
    times = [point["t_s"] for point in points]
    # Different dashes distinguish the two where both colours are printed as the same grey.
    dash = "-" if interface == "rest" else (0, (5, 1.5))
    panel.axes.plot(
        times,
        [point["p50_ms"] for point in points],
        color=colour,
        linewidth=1.5,
        linestyle=dash,
        label=f"{interface.upper()} median",
    )
    panel.axes.plot(
        times,
        [point["max_ms"] for point in points],
        MARK[interface],
        color=colour,
        markersize=3,
        fillstyle="none",
        markeredgewidth=0.9,
        label=f"{interface.upper()} longest",
    )
    failed = [point["t_s"] for point in series["points"] if point["errors"]]
    if failed:
        panel.axes.plot(
            failed,
            [0.97] * len(failed),
            "x",
            color=colour,
            markersize=6,
            markeredgewidth=1.6,
            transform=panel.axes.get_xaxis_transform(),
            label=f"{interface.upper()} errors",
        )


def _thin_out(points: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Return at most 240 points: of each group of neighbours the point with the longest request."""
    step = -(-len(points) // _MOST_POINTS) or 1
    groups = (points[start : start + step] for start in range(0, len(points), step))
    return [max(group, key=lambda point: point["max_ms"] or 0.0) for group in groups]


def _nonempty(result: Mapping[str, Any]) -> Sequence[Mapping[str, Any]]:
    series = result.get("time_series", {}).get("series", [])
    return [item for item in series if any(point["count"] or point["errors"] for point in item["points"])]


def leading(series: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Return the series of the "wire" client if any exist, otherwise all series, so that the page stays small."""
    return [item for item in series if item["client"] == "wire"] or list(series)


@picture(
    "heat",
    "Requests of the alternating blocks, by when they were sent and how long they took. A cell in a stronger colour "
    "holds more requests. Two bands mean two modes of latency. A step means that the robot or the machine changed.",
)
def heat(result: Mapping[str, Any]) -> Iterator[Panel]:
    """Yield a heat map for each series: time of the run by service time, in stronger colours for more requests."""
    found = result.get("heat_map") or {}
    edges = found.get("edges_ms", [])
    for series in leading(found.get("series", [])):
        columns = [column for column in series["columns"] if sum(column["counts"])]
        if not columns:
            continue
        name = f"{series['operation']}, {series['interface'].upper()}, {series['client']} client"
        panel = Panel(name, f"Heat map of the service times of {name} over the run.", height=2.6)
        cells = [
            ((column["t_s"], low), (column["t_s"] + found["width_s"], high), count)
            for column in columns
            for low, high, count in zip(edges, edges[1:], column["counts"], strict=False)
            if count  # empty cells are left out, because they would make the page large
        ]
        panel.axes.add_collection(
            PolyCollection(
                [[(left, low), (right, low), (right, high), (left, high)] for (left, low), (right, high), _ in cells],
                array=[count for *_, count in cells],
                cmap=_MAPS[series["interface"]],
                norm=LogNorm(vmin=0.5, vmax=max(2, *(count for *_, count in cells))),
            )
        )
        panel.axes.set_xlim(columns[0]["t_s"], columns[-1]["t_s"] + found["width_s"])
        panel.axes.set_ylim(min(low for (_, low), *_ in cells), max(high for _, (_, high), _ in cells))
        log_time_axis(panel.axes, "service time, ms")
        panel.axes.set_xlabel("seconds since the start")
        yield panel
