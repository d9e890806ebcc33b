"""Draw latency over the run: a heat map of all requests, and the median of each block."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from matplotlib.collections import PolyCollection
from matplotlib.colors import LogNorm

from reports.latency.figures.canvas import COLOUR, MARK, Panel, log_time_axis, picture


def leading(series: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Return the series of the "wire" client if any exist, otherwise all series, so that the page stays small."""
    return [one for one in series if one["client"] == "wire"] or list(series)


@picture(
    "heat",
    "Requests of the alternating blocks, by when they were sent and how long they took. A darker cell holds more "
    "requests. Two bands mean that latency has two modes. A step means that the robot or the machine changed.",
)
def heat(result: Mapping[str, Any]) -> Iterator[Panel]:
    """Yield a heat map for each series: time of the run by service time, darker cells for more requests."""
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


_MAPS = {"rest": "Blues", "soap": "Oranges", "rosbridge": "Greens"}


@picture("blocks", "The median of each short block of one interface. The confidence intervals come from their scatter.")
def blocks(result: Mapping[str, Any]) -> Iterator[Panel]:
    """Yield a panel for each client and operation: the median latency of each block over the run.

    The confidence intervals are computed from these medians.
    """
    found = leading([block for block in result.get("blocks", []) if block["phase"] == "duel"])
    kinds = ((block["client"], operation) for block in found for operation in block["p50_ms"])
    for client, operation in dict.fromkeys(kinds):
        panel = Panel(f"{operation}, {client} client", f"Medians of the blocks of {operation}, {client} client.")
        for interface in (name for name in COLOUR if any(block["interface"] == name for block in found)):
            points = [
                (block["t_s"], block["p50_ms"][operation])
                for block in found
                if (block["interface"], block["client"]) == (interface, client)
                and block["p50_ms"].get(operation) is not None
            ]
            panel.axes.plot(
                [time for time, _ in points],
                [median for _, median in points],
                MARK[interface],
                color=COLOUR[interface],
                markersize=3.5,
                alpha=0.7,
                label=interface.upper(),
            )
        log_time_axis(panel.axes, "median of a block, ms")
        panel.axes.set_xlabel("seconds since the start")
        panel.legend()
        yield panel
