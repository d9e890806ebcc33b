"""What happens while a plan is carried out: progress on standard error, and what ends the run before its time."""

import math
import os
from collections.abc import Callable

import gevent

from conformance.commandline.endings import PARENT_VARIABLE
from loadtests.engine.liveness import Liveness
from loadtests.engine.progress import Progress
from loadtests.measuring.distributed_executor import Executor
from loadtests.measuring.errors import GeneratorError
from loadtests.result.outcome import Carried, Outcome
from loadtests.schedule.arrivals import Schedule
from loadtests.schedule.plan import Plan
from loadtests.schedule.rotation import rotation
from loadtests.statistics.histogram import SHARES
from loadtests.statistics.intervals import samples_for_point
from loadtests.statistics.recorder import Recorder

_OFTEN_S = 0.2


def tell_plan(plan: Plan, pacing: str, tell: Callable[[str], None]) -> None:
    """Say what will be measured, and how."""
    load = f"{plan.load.rate:g} requests/s" if plan.open_model else f"{plan.load.users} users"
    if plan.load.stages:
        load = f"{len(plan.load.stages)} stages of up to {load}"
    tell(
        f"measuring {'a scenario' if plan.scenario else ', '.join(plan.operations)} over "
        f"{' and '.join(plan.interfaces)} at {load} for {plan.load.duration_s:g} s after {plan.load.warmup_s:g} s of "
        f"warm-up, {plan.blocks} blocks, paced by {pacing}"
    )
    if plan.open_model and (fewest := _fewest(plan)):
        number, name = fewest
        needed = samples_for_point(SHARES["p99"])
        if number < needed:
            longer_s = math.ceil(plan.load.duration_s * needed / number)
            tell(f"p99 needs {needed:,} requests, and {name} gets {number:,}: --duration {longer_s} is long enough")


def _fewest(plan: Plan) -> tuple[int, str] | None:
    """Return how many requests the series with the fewest gets, and its operation; None without a series."""
    schedule, found = Schedule(plan, 0, 1), []
    for interface, client in dict.fromkeys(name[1:] for name in plan.series_names()):
        offered = plan.offered(interface, client)
        total = sum(
            schedule.total(index)
            for index, segment in enumerate(plan.segments)
            if (segment.interface, segment.client) == (interface, client)
            and (segment.phase == "duel" or (segment.phase == "aa" and plan.alone))
        )
        turns = rotation(offered, plan.weights)
        found += [(total * turns.count(number) // len(turns), plan.operations[number]) for number in offered]
    return min((each for each in found if each[0]), default=None)


def show_web_ui(executor: Executor, host: str, port: int, tell: Callable[[str], None]) -> None:
    """Show Locust's web UI, which only watches the run.

    Raises:
        GeneratorError: the port is in use.
    """
    web = executor.environment.create_web_ui(host, port)
    gevent.sleep(0.2)
    if web.greenlet.ready():
        raise GeneratorError(f"the web UI's port {port} is in use: choose another with --web-port")
    tell(f"Locust's web UI: http://{host}:{port}")


def follow_parent(interrupt: Callable[[], None]) -> None:
    """Interrupt the run when the process that started it ends.

    A greenlet calls this: gevent cannot patch a process that has a thread, as end_with_parent() starts one.
    """
    parent = int(os.environ.pop(PARENT_VARIABLE, os.getppid()))
    while os.getppid() == parent:
        gevent.sleep(_OFTEN_S)
    interrupt()


class Watch:
    """Watches a run.

    Args:
        outcome: of the run.
        report_s: how late the counts may be, in seconds.
        progress: where it is said how far the run is.
    """

    def __init__(self, outcome: Outcome, report_s: float, progress: Progress) -> None:
        self._outcome = outcome
        self._liveness = Liveness(report_s)
        self._progress = progress

    def look(self, carried: Carried, recorder: Recorder, elapsed: float) -> bool:
        """Report progress; returns whether to end now."""
        plan, outcome = carried.plan, self._outcome
        carried.elapsed_s = max(0.0, min(elapsed, plan.length_s))
        elapsed += plan.offset_s
        if outcome.dead_at is None and self._liveness.is_due(elapsed):
            recorder.flush()
            succeeded = sum(cell.service.total for cell in recorder.cells.values())
            failed = sum(failure.count for failure in recorder.failures.values())
            outcome.dead_at = self._liveness.dead_since(elapsed, succeeded, failed)
            if outcome.dead_at is not None:
                self._progress.say(f"no request has succeeded since {outcome.dead_at:.1f} s: ending the run")
        self._progress.look(recorder, max(0.0, elapsed), plan.offset_s + plan.length_s)
        return outcome.interrupted or outcome.dead_at is not None or bool(recorder.faults)
