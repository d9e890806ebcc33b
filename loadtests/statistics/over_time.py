"""The run as it went: second by second, block by block, and what failed when."""

from collections import defaultdict
from collections.abc import Iterator
from typing import Any

from loadtests.schedule.plan import SERIES, Plan, Segment
from loadtests.statistics.figures import named, rounded
from loadtests.statistics.measured import Measured, counted
from loadtests.statistics.recorder import Cell, Recorder

_NS = 1_000_000_000
WIDTH_S = 1.0


def time_series(measured: Measured) -> dict[str, Any]:
    """Each series second by second (or block by block, where blocks are longer), by intended start."""
    width = max(WIDTH_S, measured.plan.block_s)
    found = []
    for operation, interface, client in measured.plan.series_names():
        number = measured.plan.operations.index(operation)
        seconds: dict[int, Cell] = defaultdict(Cell)
        for plan, index, segment in _segments(measured):
            if (segment.interface, segment.client) != (interface, client):
                continue
            cell = measured.recorder.cells.get((plan.first_segment + index, number))
            if cell is not None:
                seconds[int((plan.offset_s + segment.start_ns / _NS) / width + 1e-9)].merge(cell)
        points = [_point(round(second * width, 3), cell) for second, cell in sorted(seconds.items())]
        found.append(named((operation, interface, client)) | {"points": points})
    return {"width_s": width, "series": found}


def _segments(measured: Measured) -> Iterator[tuple[Plan, int, Segment]]:
    """All segments of the measurement with their numbers in their plans."""
    for plan in measured.plans:
        for index, segment in enumerate(plan.segments):
            if segment.phase in {"duel", "aa"}:
                yield plan, index, segment


def _point(at_s: float, cell: Cell) -> dict[str, Any]:
    """One second of one series."""
    response = counted(cell, "response", cell.response.highest_ns)
    return {
        "t_s": at_s,
        "count": cell.service.total,
        "errors": cell.errors,
        "p50_ms": rounded(response.quantile_ms(0.5)),
        "p99_ms": rounded(response.quantile_ms(0.99)),
        "max_ms": rounded(response.highest_ns / 1e6) if response.total else None,
    }


def blocks(measured: Measured) -> list[dict[str, Any]]:
    """The `blocks` of latency.json: each in which anything came to pass, with the generator's share of a core."""
    found = []
    for plan, index, segment in _segments(measured):
        number = plan.first_segment + index
        cells = {
            name: measured.recorder.cells[number, operation]
            for operation, name in enumerate(plan.operations)
            if (number, operation) in measured.recorder.cells
        }
        if cells:
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
                    "cpu_share": rounded(measured.recorder.busy.get(number)),
                }
            )
    return found


def errors(recorder: Recorder, operations: tuple[str, ...]) -> list[dict[str, Any]]:
    """Failures, grouped, most frequent first."""
    found = []
    for (number, operation, kind), failure in recorder.failures.items():
        phase, interface, client = SERIES[number]
        found.append(
            named((operations[operation], interface, client))
            | {
                "phase": phase,
                "kind": kind,
                "message": failure.message,
                "count": failure.count,
                "first_s": round(max(0.0, failure.first_ns / _NS), 3),
                "last_s": round(max(0.0, failure.last_ns / _NS), 3),
            }
        )
    return sorted(found, key=lambda entry: -int(str(entry["count"])))
