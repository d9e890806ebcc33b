"""Where the time goes: the spans of a request, stacked, for the wire client and for zeep."""

from collections.abc import Iterator, Mapping

from reports.latency.distributions import Series
from reports.latency.figures.canvas import INK, SPAN_COLOUR, SPAN_HATCH, Panel, milliseconds, picture
from reports.latency.figures.spectrum import Key

SPANS = ("build", "wire", "server", "parse")


@picture(
    "spans",
    "What a request spends its time on, on average. Build: making the request. Wire: the client's sending, "
    "the network and the robot's reading. Server: the robot's own work, as it states it in Server-Timing "
    "(without that, it is part of wire). Parse: reading the answer.",
)
def spans(series: Mapping[Key, Series]) -> Iterator[Panel]:
    """One panel for each client: mean spans of each operation and interface, laid end to end."""
    for client in dict.fromkeys(key[1] for key in series):
        bars = {s.name: means(s) for key, s in series.items() if key[1] == client and s.data["count"]}
        bars = {name: parts for name, parts in bars.items() if parts}
        if bars:
            yield _panel(client, bars)


def means(series: Series) -> dict[str, float]:
    """Mean milliseconds of each span that was observed; means, unlike quantiles, add up."""
    observed = {name: series.data["spans_ms"][name] for name in SPANS}
    return {name: part["mean"] for name, part in observed.items() if part is not None and part["mean"] is not None}


def _panel(client: str, bars: Mapping[str, Mapping[str, float]]) -> Panel:
    told = "; ".join(
        f"{name}: " + ", ".join(f"{span} {time:.3g} ms" for span, time in parts.items()) for name, parts in bars.items()
    )
    panel = Panel(
        f"{client} client", f"Mean time spent with the {client} client. {told}", height=1.5 + 0.42 * len(bars)
    )
    longest = max(sum(parts.values()) for parts in bars.values())
    for span in SPANS:
        left = [sum(parts.get(s, 0.0) for s in SPANS[: SPANS.index(span)]) for parts in bars.values()]
        width = [parts.get(span, 0.0) for parts in bars.values()]
        if any(width):
            panel.axes.barh(
                list(bars),
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
