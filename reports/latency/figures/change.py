"""Draw the percentile spectrum of each series in two runs, old and new."""

from collections.abc import Iterator

from reports.latency.distributions import AllSeries
from reports.latency.figures.canvas import COLOUR, SOFT, Panel, log_time_axis, picture
from reports.latency.figures.spectrum import curve, quantile_axis


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
