"""Draw the time that requests spend in each span (build, wire, server, parse), stacked, for each client."""

from collections.abc import Iterator, Mapping
from textwrap import fill

from reports.latency.distributions import AllSeries, Series
from reports.latency.figures.canvas import INK, LABEL, SPAN_COLOUR, SPAN_HATCH, Panel, milliseconds, picture

SPANS = ("build", "wire", "server", "parse")


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
            yield _panel(client, bars)


def means(series: Series) -> dict[str, float]:
    """Return the mean time (ms) of each observed span of a request; means can be added, quantiles cannot."""
    observed = {name: series.data["spans_ms"][name] for name in SPANS}
    return {name: part["mean"] for name, part in observed.items() if part is not None and part["mean"] is not None}


def _panel(client: str, bars: Mapping[str, Mapping[str, float]]) -> Panel:
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
