"""The outcomes of the requests: one count, which the terminal, the page and all judgements share."""

from collections import Counter
from collections.abc import Iterable

import msgspec

from loadtests.schedule.arrivals import arrivals_due
from loadtests.schedule.plan import SERIES, Plan
from loadtests.statistics.figures import rounded
from loadtests.statistics.measured import Measured
from loadtests.statistics.recorder import Cell

MEASURED_PHASES = ("duel", "aa", "against")


class Counts(msgspec.Struct, kw_only=True):
    """The `counts` of latency.json: all requests of the measured part, without the warm-up.

    `asked` is `sent`, `not_sent` and `lost`; `sent` is `answered` and all of `failed`; `sent` and `not_sent` are
    `in_series`, `control_only` and `other_robot`.

    Attributes:
        asked: requests that were due; in the closed model, those that were sent.
        sent: requests that started.
        answered: good responses, also those that came later.
        failed: other responses, and requests without one, by kind.
        not_sent: no connection was free for them until their deadline.
        lost: due, but neither sent nor given up: a worker was lost, or the run was ended.
        waiting_at_end: answered only after the measured part was over.
        in_series: counted in the figures of a series.
        in_control: requests of the A/A control; control_only: those of them that are in no series.
        other_robot: requests to the robot of --against.
        seconds: how long the measured part took.
        asked_rate, achieved_rate: requests due, and good responses received, in a second of the measured part.
    """

    asked: int
    sent: int
    answered: int
    failed: dict[str, int]
    not_sent: int
    lost: int
    waiting_at_end: int
    in_series: int
    in_control: int
    control_only: int
    other_robot: int
    seconds: float
    asked_rate: float | None
    achieved_rate: float | None


def counts(measured: Measured, carried: Iterable[tuple[Plan, float]]) -> Counts:
    """Return the numbers of requests by their outcome.

    Args:
        measured: the records.
        carried: each plan, and how many seconds of it were carried out.
    """
    recorder, plan = measured.recorder, measured.plan
    phases = {phase: Cell() for phase in MEASURED_PHASES}
    for name in plan.series_names():
        for phase, cell in phases.items():
            for block in measured.blocks(name, phase, alike=False):
                cell.merge(block.cell)
    whole = Cell()
    for cell in phases.values():
        whole.merge(cell)
    failed: Counter[str] = Counter()
    for (number, _, kind), failure in recorder.failures.items():
        if SERIES[number][0] in MEASURED_PHASES:
            failed[kind] += failure.count
    sent = whole.service.total + whole.errors
    asked, seconds, in_time, afterwards = sent, 0.0, 0, 0
    for number, (each, elapsed_s) in enumerate(carried):
        due = sum(arrivals_due(each, elapsed_s, phase=phase) for phase in MEASURED_PHASES)
        asked = due + asked * (number > 0) if plan.open_model else asked
        begin_s, end_s = each.measured_s
        seconds += max(0.0, min(elapsed_s, end_s) - begin_s)
        in_time += recorder.in_time[each.first_segment]
        afterwards += recorder.afterwards[each.first_segment]
    of = {phase: cell.service.total + cell.errors + cell.dropped for phase, cell in phases.items()}
    control_only = 0 if plan.alone else of["aa"]
    return Counts(
        asked=asked,
        sent=sent,
        answered=whole.service.total,
        failed=dict(failed.most_common()),
        not_sent=whole.dropped,
        lost=max(0, asked - sent - whole.dropped),
        waiting_at_end=afterwards,
        in_series=of["duel"] + of["aa"] - control_only,
        in_control=of["aa"],
        control_only=control_only,
        other_robot=of["against"],
        seconds=round(seconds, 6),
        asked_rate=rounded(asked / seconds) if plan.open_model and seconds > 0 else None,
        achieved_rate=rounded(in_time / seconds) if seconds > 0 else None,
    )
