"""Draw the percentile spectrum: latency over the share of requests that were faster, on HdrHistogram's axis.

The axis is 1 / (1 - quantile), logarithmic: 90 %, 99 % and 99.9 % are equally far apart, so that the tail is readable.
"""

from collections.abc import Iterator

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from reports.latency.distributions import AllSeries, Distribution, Floats
from reports.latency.figures.canvas import COLOUR, MARK, SOFT, Panel, log_time_axis, picture

_POINTS = 220
_NINES = (0.0, 0.5, 0.9, 0.99, 0.999, 0.9999, 0.99999, 0.999999)


@picture(
    "spectrum",
    "Time at each percentile. At 99 %, one request in a hundred took longer than the curve shows. Solid: service "
    "time, counted from when a request was sent. Dashed: response time, counted from when it was due, so that "
    "waiting for a stalled robot is included; where both are equal, one line is seen. Thin lines: too few requests for "
    "a reliable value.",
)
def spectrum(series: AllSeries) -> Iterator[Panel]:
    """Yield a panel for each client and operation: service time as a solid line, response time dashed."""
    for client, operation in dict.fromkeys((key[1], key[0]) for key in series):
        drawn = [s for key, s in series.items() if key[:2] == (operation, client) and s.service is not None]
        if not drawn:
            continue
        names = " and ".join(s.data["interface"].upper() for s in drawn)
        panel = Panel(
            f"{operation}, {client} client",
            f"Percentile spectrum of {names} for {operation} with the {client} client; "
            "the table of quantiles holds its figures.",
        )
        for one in drawn:
            interface = one.data["interface"]
            if one.service is not None:
                curve(panel.axes, one.service, (COLOUR[interface], MARK[interface]), f"{interface.upper()} service")
            if one.response is not None and _differ(one.service, one.response):
                curve(
                    panel.axes,
                    one.response,
                    (COLOUR[interface], MARK[interface]),
                    f"{interface.upper()} response",
                    "--",
                )
        quantile_axis(panel.axes, max(s.service.total for s in drawn if s.service is not None))
        log_time_axis(panel.axes, "milliseconds")
        panel.legend()
        yield panel


def curve(axes: Axes, values: Distribution, look: tuple[str, str], label: str, dash: str = "-") -> None:
    """Draw one latency distribution; the line is thin where too few values exist for a confidence interval.

    `look` is the colour and the marker.
    """
    colour, mark = look
    reach = float(np.log10(max(values.total, 10)))
    at = 1 - 10.0 ** -np.linspace(0.0, reach, _POINTS)
    times = values.quantiles(at)
    sure = at <= values.highest_supported
    axes.plot(
        _nines(at[sure]), times[sure], dash, color=colour, marker=mark, markersize=4.5, markevery=0.16, label=label
    )
    joint = max(int(sure.sum()) - 1, 0)
    axes.plot(_nines(at[joint:]), times[joint:], dash, color=colour, linewidth=0.7)


def quantile_axis(axes: Axes, total: int) -> None:
    """Set the x axis to HdrHistogram's percentile scale, up to the highest percentile that `total` values reach."""
    end = float(max(total, 10))
    axes.set_xscale("log")
    axes.set_xlim(1.0, end)
    shown = [q for q in _NINES if 1 / (1 - q) <= end]
    axes.xaxis.set_major_locator(FixedLocator([1 / (1 - q) for q in shown]))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{100 * (1 - 1 / value):.6g}"))
    axes.set_xlabel("percentile")


def _nines(at: Floats) -> Floats:
    result: Floats = 1 / (1 - at)
    return result


def _differ(service: Distribution | None, response: Distribution) -> bool:
    """Return whether service and response times differ; they are equal in the closed model."""
    return service is None or not (
        np.array_equal(service.low_ms, response.low_ms) and np.array_equal(service.counts, response.counts)
    )


@picture(
    "change",
    "Service time at each percentile, old and new. Where the new curve is higher, requests got slower. "
    "Thin lines: too few requests for a reliable value.",
)
def change(old: AllSeries, new: AllSeries) -> Iterator[Panel]:
    """Yield a panel for each series that both results hold: service times, old in grey and dashed, new in colour."""
    for key, after in new.items():
        before = old.get(key)
        if before is None or before.service is None or after.service is None:
            continue
        operation, client, interface = key
        name = f"{operation}, {interface.upper()}, {client} client"
        panel = Panel(name, f"Percentile spectrum of {name}, old and new; the table holds its figures.")
        curve(panel.axes, before.service, (SOFT, "s"), "old", "--")
        curve(panel.axes, after.service, (COLOUR[interface], "o"), "new")
        quantile_axis(panel.axes, max(before.service.total, after.service.total))
        log_time_axis(panel.axes, "service time, ms")
        panel.legend()
        yield panel
