"""The run over time: figures by second, by block and by stage, slow growth, and errors with their times."""

from collections import defaultdict
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy import special

from loadtests.schedule.plan import SERIES
from loadtests.statistics.figures import Series, name_fields, plain_quantiles, rounded
from loadtests.statistics.histogram import Floats, Histogram
from loadtests.statistics.measured import Measured, counted_times
from loadtests.statistics.recorder import Cell, Recorder
from loadtests.statistics.rounds import lag_correlation, widening

_NS = 1_000_000_000
_PHASES = ("duel", "aa")
WIDTH_S = 1.0
#: A run is cut into this many parts, and a slope is fitted to their medians. Shorter parts would correlate.
_PARTS = 20
_WORTH = 0.2  # a smaller change of the median over the run is not reported
# Each of this many parts of the run must be slower than the part before (or each quicker), because a busy machine
# causes changes that do not last.
_STEADY = 5


def time_series(measured: Measured) -> dict[str, Any]:
    """Return each series second by second (or block by block, where blocks are longer), by intended start."""
    width = max(WIDTH_S, measured.plan.block_s)
    found = []
    for name in measured.plan.series_names():
        seconds: dict[int, Cell] = defaultdict(Cell)
        for block in measured.blocks(name, *_PHASES):
            seconds[int(block.start_s / width + 1e-9)].merge(block.cell)
        points = [_point(round(second * width, 3), cell) for second, cell in sorted(seconds.items())]
        found.append(name_fields(name) | {"points": points})
    return {"width_s": width, "series": found}


def _point(at_s: float, cell: Cell) -> dict[str, Any]:
    """Return the figures of one second of a series, for latency.json."""
    response = counted_times(cell, "response")
    return {"t_s": at_s, "count": cell.service.total, "errors": cell.errors} | {
        f"{name}_ms": rounded(response.figure_ms(name)) for name in ("p50", "p99", "max")
    }


def blocks(measured: Measured) -> list[dict[str, Any]]:
    """Return the `blocks` of latency.json: each in which anything happened, with the generator's share of a core."""
    found = []
    recorder = measured.recorder
    for plan in measured.plans:
        for number, segment in enumerate(plan.segments, plan.first_segment):
            cells = {
                name: recorder.cells[number, operation]
                for operation, name in enumerate(plan.operations)
                if (number, operation) in recorder.cells
            }
            if segment.phase not in _PHASES or not cells:
                continue
            found.append(
                {
                    "t_s": rounded(plan.offset_s + segment.opens_ns / _NS),
                    "length_s": rounded(segment.active_s),
                    "repeat": plan.repeat,
                    "phase": segment.phase,
                    "interface": segment.interface,
                    "client": segment.client,
                    "count": sum(cell.service.total for cell in cells.values()),
                    "failed": sum(cell.errors + cell.dropped for cell in cells.values()),
                    "p50_ms": {name: rounded(cell.service.quantile_ms(0.5)) for name, cell in cells.items()},
                    "cpu_share": rounded(recorder.busy.get(number)),
                }
            )
    return found


def theil_sen(times: Floats, values: Floats) -> tuple[float, float, float]:
    """Return the Theil-Sen slope of 20 values, and Sen's (1968) interval for it at 99 %.

    As in `scipy.stats`, which takes half a second to import.
    """
    first, second = np.triu_indices(_PARTS, 1)
    slopes = np.sort((values[second] - values[first]) / (times[second] - times[first]))
    equal = np.append(_PARTS, -np.unique(values, return_counts=True)[1])  # values that are equal count less
    reach = special.ndtri(0.995) * np.sqrt((equal * (abs(equal) - 1) * (2 * abs(equal) + 5)).sum() / 18)
    low, high = round((len(slopes) - reach) / 2) - 1, round((len(slopes) + reach) / 2)
    return float(np.median(slopes)), float(slopes[low]), float(slopes[high])


def growth(parts: Sequence[tuple[float, Histogram]]) -> dict[str, Any] | None:
    """Return how the median of the response time changes over a run, in ms per hour, with its 99 % interval.

    The slope is the Theil-Sen estimator through the medians of 20 parts of the run. The interval is Sen's (1968),
    widened by the correlation of neighbours. None with fewer than 20 blocks. `steady`: it never turned.

    Args:
        parts: when each block began, in seconds, and its response times.
    """
    if len(parts) < _PARTS:
        return None
    groups = [parts[ndarray[0] : ndarray[-1] + 1] for ndarray in np.array_split(np.arange(len(parts)), _PARTS)]
    times = np.array([np.mean([at_s for at_s, _ in group]) for group in groups])
    medians = np.array([Histogram.sum_of(each for _, each in group).quantile_ms(0.5) for group in groups], float)
    slope, *ends = theil_sen(times, medians)
    correlation = lag_correlation(medians - slope * times, np.zeros(_PARTS, int))
    wider = [slope + (end - slope) * widening(correlation) for end in ends]
    hour, low, high = (rounded(float(each) * 3600) for each in (slope, *wider))
    steps = np.sign(np.diff(np.median(medians.reshape(_STEADY, -1), axis=1)))
    return {
        "ms_per_hour": hour,
        "ci99_ms_per_hour": [low, high],
        "over_run_ms": rounded(float(slope * np.ptp(times))),
        "steady": bool(abs(steps.sum()) == len(steps)),
    }


def add_growth(measured: Measured, entries: Sequence[Series]) -> list[str]:
    """Add to each series how its median changes over a run with a constant load; return remarks."""
    said = []
    for entry in entries if not measured.plan.load.stages else ():
        found = growth(
            [(block.start_s, counted_times(block.cell, "response")) for block in measured.blocks(entry.name, "duel")]
        )
        entry.growth, usual = found, entry.response_ms["p50"]
        if found is None or usual is None or not found["steady"] or abs(found["over_run_ms"]) < _WORTH * usual:
            continue
        low, high = found["ci99_ms_per_hour"]
        if low > 0 or high < 0:
            said.append(
                f"{entry.operation} over {entry.interface.upper()}: its median {'grew' if low > 0 else 'fell'} by "
                f"{abs(found['over_run_ms']):,.1f} ms over the run ({found['ms_per_hour']:,.0f} ms per hour, 99 % "
                f"interval {low:,.0f} to {high:,.0f}); a longer run shows whether it goes on"
            )
    return said


def errors(recorder: Recorder, operations: tuple[str, ...]) -> list[dict[str, Any]]:
    """Return the failures, grouped, the most frequent first."""
    found = []
    for (number, operation, kind), failure in sorted(recorder.failures.items(), key=lambda item: -item[1].count):
        phase, interface, client = SERIES[number]
        found.append(
            name_fields((operations[operation], interface, client))
            | {
                "phase": phase,
                "kind": kind,
                "message": failure.message,
                "count": failure.count,
                "first_s": round(max(0.0, failure.first_ns / _NS), 3),
                "last_s": round(max(0.0, failure.last_ns / _NS), 3),
            }
        )
    return found


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
            response = Histogram.sum_of(counted_times(cell, "response") for cell in cells[number])
            found.append(
                name_fields(name)
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
