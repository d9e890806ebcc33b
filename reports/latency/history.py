"""Write the history of a robot's latency: all results stored by `roaas load --save NAME`, as HTML and CSV.

The CSV is for a change-point detector such as Apache Otava. It has a row for each run, in order of time, and a column
for each quantile that every run has.
"""

import csv
import io
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from reports.errors import ResultMissingError
from reports.given_files import showing
from reports.latency.figures.canvas import COLOUR, MARK, Panel, log_time_axis, picture
from reports.latency.numbers import interval, ms, rate
from reports.pages.page import html_page, write_pages
from reports.reading import read_latency

Key = tuple[str, str, str]
_QUANTILES = ("p50", "p99")


@dataclass(frozen=True, slots=True)
class Run:
    """One stored latency result: time, robot's version, load in words, and series.

    Attributes:
        series: by operation, client and interface.
    """

    started: str
    version: str
    load: str
    series: Mapping[Key, Mapping[str, Any]]


def write_history(folder: Path) -> list[Path]:
    """Write history.html and history.csv beside the stored results in a folder, and return their paths.

    Raises:
        ReportError: the folder has no result, or a result cannot be read.
    """
    files = sorted(folder.glob("20*.json"))
    if not files:
        raise ResultMissingError(f"{folder}: no result is stored in it")
    with showing(folder):
        runs = [_run(read_latency(path)) for path in files]
        pages = {"history.html": history_html(folder.name, runs), "history.csv": history_csv(runs)}
    return write_pages(folder, pages)


def _run(result: Mapping[str, Any]) -> Run:
    plan = result["plan"]
    load = f"{rate(plan['rate'])} requests/s" if plan.get("rate") else f"{plan.get('users')} users"
    return Run(
        result.get("started", ""),
        (result["environment"].get("robot") or {}).get("version") or "",
        f"{load} for {plan['duration_s']:g} s",
        {(one["operation"], one["client"], one["interface"]): one for one in result["series"]},
    )


def history_csv(runs: Sequence[Run]) -> str:
    """Return CSV with a row for each run: time, robot's version, and the quantiles (ms) that every run has."""
    columns = {
        f"{operation}_{interface}_{client}_{quantile}_ms": ((operation, client, interface), quantile)
        for operation, client, interface in runs[-1].series
        for quantile in _QUANTILES
        if all(_figure(run, (operation, client, interface), quantile) is not None for run in runs)
    }
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["time", "version", *columns])
    for run in runs:
        writer.writerow([run.started, run.version, *(_figure(run, *place) for place in columns.values())])
    return text.getvalue()


def history_html(name: str, runs: Sequence[Run]) -> str:
    """Return an HTML page with the medians of all runs and their intervals, as a figure and as a table."""
    keys = list(dict.fromkeys(key for run in runs for key in run.series))
    rows = [
        (
            run,
            [
                (ms(_figure(run, key, "p50")), interval((run.series.get(key) or {}).get("ci95_ms", {}).get("p50")))
                for key in keys
            ],
        )
        for run in reversed(runs)
    ]
    return html_page("history.html.j2", name=name, keys=keys, rows=rows, picture_of_runs=_medians(runs, keys))


def _figure(run: Run, key: Key, quantile: str) -> float | None:
    one = run.series.get(key)
    value: float | None = one["service_ms"].get(quantile) if one else None
    return value


@picture(
    "history",
    "The median of each stored run, with its 95 % interval. Runs at different times also differ because the machine "
    "changed. To compare two versions of a robot, measure them alternately in one run (--against).",
)
def _medians(runs: Sequence[Run], keys: Sequence[Key]) -> Iterator[Panel]:
    for operation, client in dict.fromkeys(key[:2] for key in keys):
        panel = Panel(f"{operation}, {client} client", f"Medians of {operation}, {client} client, run by run.")
        for interface in (key[2] for key in keys if key[:2] == (operation, client)):
            places = [
                (number, one["service_ms"]["p50"], one["ci95_ms"]["p50"])
                for number, run in enumerate(runs, 1)
                if (one := run.series.get((operation, client, interface))) and one["service_ms"]["p50"] is not None
            ]
            # With a skewed bootstrap the estimate may lie outside its own interval; an arm must not be negative.
            arms = [(max(m - b[0], 0.0), max(b[1] - m, 0.0)) if b else (0.0, 0.0) for _, m, b in places]
            panel.axes.errorbar(
                [number for number, *_ in places],
                [median for _, median, _ in places],
                [[low for low, _ in arms], [high for _, high in arms]],
                fmt=f"-{MARK[interface]}",
                color=COLOUR[interface],
                markersize=4,
                linewidth=1.2,
                capsize=3,
                label=interface.upper(),
            )
        log_time_axis(panel.axes, "median service time, ms")
        panel.axes.set_xlabel("run")
        panel.axes.set_xticks(sorted({1, len(runs), (len(runs) + 1) // 2}))
        panel.legend()
        yield panel
