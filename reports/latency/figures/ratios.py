"""Draw what compares: ratios with their intervals, and the parts of a request's time side by side.

A ratio is of SOAP to REST, of a new run to an old one, or of one robot to another. The parts of a request's time
(build, wire, server, parse) are stacked, for each client.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from textwrap import fill

from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from reports.latency.distributions import AllSeries, Series
from reports.latency.figures.canvas import (
    INK,
    LABEL,
    PAPER_COLOUR,
    SOFT,
    SPAN_COLOUR,
    SPAN_HATCH,
    Panel,
    Picture,
    milliseconds,
    picture,
)

SPANS = ("build", "wire", "server", "parse")


@dataclass(frozen=True, slots=True)
class Ratio:
    """A row of a figure of ratios; `interval` is the ratio's 95 % interval, or None if the run is too short."""

    label: str
    ratio: float
    interval: tuple[float, float] | None
    colour: str = INK


def ratios(
    name: str, title: str, rows: Sequence[Ratio], caption: str, *, mark: tuple[float, str] | None = None
) -> Picture | None:
    """Return a figure with a dot and an interval bar for each row, or None without rows.

    The axis is logarithmic and includes 1. `mark` is a reference value, drawn as a dashed line, and its label.
    """

    @picture(name, caption)
    def panels() -> Iterator[Panel]:
        if rows:
            yield _panel(title, rows, mark)

    return panels()


def _panel(title: str, rows: Sequence[Ratio], mark: tuple[float, str] | None) -> Panel:
    text = "; ".join(f"{row.label}: {row.ratio:.3g}" for row in rows)
    panel = Panel(title, f"{title}. {text}", height=1.45 + 0.34 * len(rows))
    axes = panel.axes
    axes.axvline(1.0, color=INK, linewidth=0.9)
    if mark is not None:
        axes.axvline(mark[0], color=PAPER_COLOUR, linestyle=(0, (4, 3)), linewidth=1.4, label=mark[1])
    for place, row in enumerate(rows):
        if row.interval is not None:
            axes.plot(row.interval, [place, place], color=row.colour, linewidth=5, alpha=0.35, solid_capstyle="butt")
        axes.plot([row.ratio], [place], "o", color=row.colour, markersize=5)
        axes.annotate(
            f"{row.ratio:.2f}",
            (1.0, place),
            (6, 0),
            xycoords=("axes fraction", "data"),
            textcoords="offset points",
            va="center",
            color=SOFT,
        )
    axes.set_yticks(range(len(rows)), [fill(row.label, LABEL) for row in rows])
    axes.set_ylim(len(rows) - 0.4, -0.6)
    axes.set_xscale("log")
    low, high = axes.get_xlim()
    low, high = min(low, 0.8), max(high, 1.25)
    axes.set_xlim(low, high)
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_locator(FixedLocator(_ticks(low, high)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.grid(visible=False, axis="y")
    panel.legend()
    return panel


def _ticks(low: float, high: float) -> list[float]:
    """Return axis ticks between `low` and `high`, as fine as possible without overlapping labels; they include 1."""
    scales = (
        (0.8, 0.9, 1.0, 1.1, 1.2, 1.3, 1.4, 1.5),
        (0.25, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 4.0),
        (0.001, 0.01, 0.1, 0.3, 1.0, 3.0, 10.0, 100.0, 1000.0),
    )
    scale = next((scale for scale in scales if scale[0] * 0.8 <= low and high <= scale[-1] * 1.2), scales[-1])
    return [tick for tick in scale if low <= tick <= high]


@picture(
    "spans",
    "Mean time that a request spends in each part. Build: the client makes the request. Wire: the client sends, the "
    "network transmits, the robot reads. Server: the robot's own work, as its Server-Timing header states it; "
    "without that header it is part of wire. Parse: the client reads the response.",
)
def spans(series: AllSeries) -> Iterator[Panel]:
    """Yield a panel for each client: stacked bars of the mean spans of each operation and interface."""
    for client in dict.fromkeys(key[1] for key in series):
        bars = {s.name: means(s) for key, s in series.items() if key[1] == client and s.data["count"]}
        bars = {name: parts for name, parts in bars.items() if parts}
        if bars:
            yield _panel_spans(client, bars)


def means(series: Series) -> dict[str, float]:
    """Return the mean time (ms) of each observed span of a request; means can be added, quantiles cannot."""
    observed = {name: series.data["spans_ms"][name] for name in SPANS}
    return {name: part["mean"] for name, part in observed.items() if part is not None and part["mean"] is not None}


def _panel_spans(client: str, bars: Mapping[str, Mapping[str, float]]) -> Panel:
    text = "; ".join(
        f"{name}: " + ", ".join(f"{span} {time:.3g} ms" for span, time in parts.items()) for name, parts in bars.items()
    )
    panel = Panel(
        f"{client} client", f"Mean time spent with the {client} client. {text}", height=1.5 + 0.42 * len(bars)
    )
    longest = max(sum(parts.values()) for parts in bars.values())
    for span in SPANS:
        left = [sum(parts.get(s, 0.0) for s in SPANS[: SPANS.index(span)]) for parts in bars.values()]
        width = [parts.get(span, 0.0) for parts in bars.values()]
        if any(width):
            panel.axes.barh(
                [fill(name, LABEL) for name in bars],
                width,
                left=left,
                height=0.62,
                color=SPAN_COLOUR[span],
                hatch=SPAN_HATCH[span],
                edgecolor="white",
                linewidth=0.8,
                label=span,
            )
    for row, parts in enumerate(bars.values()):
        total = sum(parts.values())
        panel.axes.text(total + longest * 0.02, row, milliseconds(round(total, 3)), va="center", color=INK)
    panel.axes.set_xlim(0, longest * 1.16)
    panel.axes.invert_yaxis()
    panel.axes.grid(visible=False, axis="y")
    panel.axes.set_xlabel("mean, milliseconds")
    panel.legend(columns=4)
    return panel
