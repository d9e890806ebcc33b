"""How service times are distributed, and by how much SOAP's quantiles lie above REST's."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from reports.latency.distributions import Distribution, Floats, Series
from reports.latency.figures.canvas import COLOUR, INK, SOFT, Panel, Picture, drawing, gather, log_time_axis
from reports.latency.figures.spectrum import Key, quantile_axis

_FEWEST_BINS, _MOST_BINS = 16, 70
_BAND_POINTS = 160
_QUANTILE = {"p50": 0.5, "p90": 0.9, "p99": 0.99}


def density(series: Mapping[Key, Series]) -> Picture | None:
    """One panel for each client and operation: share of requests over service time."""
    panels = []
    with drawing():
        for operation, client in dict.fromkeys(key[:2] for key in series):
            both = _pair(series, operation, client)
            if not both:
                continue
            panel = Panel(
                f"{operation}, {client} client",
                f"Distribution of service times for {operation} with the {client} client: "
                + ", ".join(f"median of {name.upper()} {_median(d):.3g} ms" for name, d in both.items()),
            )
            edges = _edges(list(both.values()))
            for interface, values in both.items():
                shares = _shares(values, edges) * 100
                panel.axes.stairs(
                    shares,
                    edges,
                    fill=False,
                    edgecolor=COLOUR[interface],
                    linewidth=1.5,
                    hatch="////" if interface == "soap" else None,
                    label=interface.upper(),
                )
                panel.axes.stairs(shares, edges, color=COLOUR[interface], fill=True, alpha=0.15)
                panel.axes.axvline(_median(values), color=COLOUR[interface], linestyle=(0, (2, 2)), linewidth=1.1)
            log_time_axis(panel.axes, "x", "service time, milliseconds")
            panel.axes.set_ylabel("% of requests")
            panel.axes.set_ylim(bottom=0)
            panel.legend()
            panels.append(panel)
        return gather(
            "density",
            "Where service times lie. The dotted lines are the medians; the axis is logarithmic, and its bins are "
            "equally wide on it. The highest 0.5 % are left out here: the spectrum shows them.",
            panels,
        )


def difference(series: Mapping[Key, Series], comparisons: Sequence[Mapping[str, Any]]) -> Picture | None:
    """One panel for each client and operation: SOAP minus REST at each quantile, with its band."""
    panels = []
    with drawing():
        for operation, client in dict.fromkeys(key[:2] for key in series):
            both = _pair(series, operation, client)
            if set(both) != {"rest", "soap"}:
                continue
            panel = Panel(
                f"{operation}, {client} client",
                f"SOAP's service time minus REST's by quantile, for {operation} with the {client} client.",
            )
            _draw_difference(panel, both)
            own = [c for c in comparisons if (c["operation"], c["client"]) == (operation, client)]
            _draw_intervals(panel, own)
            panel.axes.axhline(0.0, color=INK, linewidth=0.9)
            quantile_axis(panel.axes, _reach(both))
            panel.axes.set_ylabel("SOAP minus REST, ms")
            panel.legend()
            panels.append(panel)
        return gather(
            "difference",
            "How much longer SOAP takes than REST at each percentile. The band is its 95 % interval if requests are "
            "taken for independent; the bars are the stricter intervals from resampled blocks, where the run "
            "supports them. Above the line SOAP is slower.",
            panels,
        )


def _draw_difference(panel: Panel, both: Mapping[str, Distribution]) -> None:
    at: Floats = 1 - 10.0 ** -np.linspace(0.0, np.log10(_reach(both)), _BAND_POINTS)
    rest, soap = both["rest"], both["soap"]
    gap = soap.quantiles(at) - rest.quantiles(at)
    rest_low, rest_high = rest.quantile_band(at)
    soap_low, soap_high = soap.quantile_band(at)
    # Bounds of a difference from the bounds of its parts (MOVER; Zou and Donner 2008).
    low = gap - np.hypot(soap.quantiles(at) - soap_low, rest_high - rest.quantiles(at))
    high = gap + np.hypot(soap_high - soap.quantiles(at), rest.quantiles(at) - rest_low)
    nines = 1 / (1 - at)
    panel.axes.fill_between(nines, low, high, color=SOFT, alpha=0.22, linewidth=0, label="95 % band")
    panel.axes.plot(nines, gap, color=INK, label="SOAP minus REST")


def _draw_intervals(panel: Panel, comparisons: Sequence[Mapping[str, Any]]) -> None:
    label: str | None = "95 % by blocks"
    for comparison in comparisons:
        quantile = _QUANTILE.get(comparison["quantile"])
        interval = comparison.get("ci95_difference_ms")
        gap = comparison["soap_minus_rest_ms"]
        if quantile is None or interval is None or gap is None:
            continue
        # A skewed bootstrap's bounds may leave its point estimate on one side: a bar's arm is never negative.
        arms = [[max(gap - interval[0], 0.0)], [max(interval[1] - gap, 0.0)]]
        panel.axes.errorbar(
            [1 / (1 - quantile)], [gap], arms, fmt="o", color=COLOUR["soap"], capsize=4, markersize=4, label=label
        )
        label = None


def _reach(both: Mapping[str, Distribution]) -> int:
    """As far as both distributions support a quantile, in nines (1 / (1 - q))."""
    return max(10, int(1 / (1 - min(values.highest_supported for values in both.values()))))


def _pair(series: Mapping[Key, Series], operation: str, client: str) -> dict[str, Distribution]:
    found = {}
    for interface in ("rest", "soap"):
        one = series.get((operation, client, interface))
        if one is not None and one.service is not None:
            found[interface] = one.service
    return found


def _median(values: Distribution) -> float:
    return float(values.quantiles(np.asarray([0.5]))[0])


def _edges(distributions: Sequence[Distribution]) -> Floats:
    low = min(float(d.low_ms[0]) for d in distributions)
    high = max(float(d.quantiles(np.asarray([0.995]))[0]) for d in distributions)
    low = max(low, 0.0005)
    fewest = min(d.total for d in distributions)
    bins = int(min(max(3 * fewest ** (1 / 3), _FEWEST_BINS), _MOST_BINS))
    return np.geomspace(low, max(high, low * 1.5), bins + 1)


def _shares(values: Distribution, edges: Floats) -> Floats:
    """Share of values in each bin; a bucket that spans bins is spread over them evenly."""
    reached = np.concatenate([[0.0], np.cumsum(values.counts) / values.total])
    # Between buckets nothing is recorded: the step from one bucket's end to the next one's start is flat.
    points = np.column_stack([values.low_ms, values.high_ms]).ravel()
    steps = np.column_stack([reached[:-1], reached[1:]]).ravel()
    result: Floats = np.diff(np.interp(edges, points, steps))
    return result
