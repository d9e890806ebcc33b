"""The figures of each stage of a load whose rate changes: the `stages` of latency.json."""

from collections import defaultdict
from typing import Any

from loadtests.statistics.figures import named, plain_quantiles, rounded
from loadtests.statistics.histogram import Histogram
from loadtests.statistics.measured import Measured, counted
from loadtests.statistics.recorder import Cell


def stage_figures(measured: Measured) -> list[dict[str, Any]]:
    """Return an entry for each stage and series: rates at its ends, requests, and their response times.

    A request belongs to the stage in which it was due. Empty where the rate is the same throughout.
    """
    load, found = measured.plan.load, []
    for name in measured.plan.series_names():
        cells: defaultdict[int, list[Cell]] = defaultdict(list)
        for block in measured.blocks(name, "duel", "aa"):
            begin_s, _ = block.plan.measured_s
            middle_s = (block.segment.start_ns + block.segment.end_ns) / 2e9 - begin_s
            cells[load.stage_at(middle_s)].append(block.cell)
        before = 0.0
        for number, (rate, seconds) in enumerate(load.stages):
            response = Histogram.sum_of(counted(cell, "response") for cell in cells[number])
            found.append(
                named(name)
                | {
                    "stage": number + 1,
                    "from_rate": rounded(before),
                    "to_rate": rounded(rate),
                    "seconds": rounded(seconds),
                    "answered": sum(cell.service.total for cell in cells[number]),
                    "failed": sum(cell.errors + cell.dropped for cell in cells[number]),
                    "response_ms": plain_quantiles(response),
                }
            )
            before = rate
    return found
