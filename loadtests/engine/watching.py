"""Watch a plan: print progress on standard error, and end the run early if needed."""

import math
import os
import sys
import time
from collections.abc import Callable

import gevent

from conformance.commandline.endings import PARENT_VARIABLE
from conformance.commandline.help_pages import columns, wrap
from loadtests.measuring.distributed_executor import Executor
from loadtests.measuring.errors import GeneratorError
from loadtests.result.outcome import Carried, Outcome
from loadtests.schedule.arrivals import Schedule
from loadtests.schedule.plan import Plan, rotation
from loadtests.statistics.histogram import SHARES
from loadtests.statistics.intervals import samples_for_point
from loadtests.statistics.overload import Liveness
from loadtests.statistics.recorder import Recorder

_LOOKS_S = 0.2


def tell_plan(plan: Plan, pacing: str, tell: Callable[[str], None]) -> None:
    """Print what will be measured, and how."""
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
            enough = f"stages of {longer_s} s in all are" if plan.load.stages else f"--duration {longer_s} is"
            tell(f"p99 needs {needed:,} requests, and {name} gets {number:,}: {enough} long enough")


def _fewest(plan: Plan) -> tuple[int, str] | None:
    """Return how many requests the series with the fewest gets, and its operation; None without a series."""
    schedule, found = Schedule(plan, 0, 1), []
    for interface, client in dict.fromkeys(name[1:] for name in plan.series_names()):
        offered = plan.choices(interface, client)
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
        gevent.sleep(_LOOKS_S)
    interrupt()


_OFTEN_S, _SELDOM_S = 1.0, 10.0  # from one line to the next: on a terminal, and elsewhere
_QUANTILES = (("p50", 0.5), ("p90", 0.9), ("p95", 0.95), ("p99", 0.99))


class Progress:
    """Prints the progress of a run.

    Args:
        mode: `auto` renews one line on a terminal and writes few lines elsewhere; `lines` writes one a second; `none`
            writes nothing.
    """

    def __init__(self, mode: str) -> None:
        self._silent, self._every_s = mode == "none", _SELDOM_S if mode == "auto" else _OFTEN_S
        self._renews = mode == "auto" and sys.stderr.isatty() and os.environ.get("TERM") != "dumb"
        self._open = False
        self._due = time.monotonic() + _OFTEN_S
        self._before = (0.0, 0)  # when the last line was written, and how many requests were answered by then

    def say(self, message: str) -> None:
        """Write a line."""
        if not self._silent:
            self.end()
            sys.stderr.write(wrap(message, sys.stderr) + "\n")
            sys.stderr.flush()

    def look(self, recorder: Recorder, elapsed_s: float, length_s: float) -> None:
        """Print how far the run is, and its figures so far, if the next line is due."""
        now = time.monotonic()
        if self._silent or now < self._due:
            return
        line = self._figures(recorder, elapsed_s, length_s)
        answered = recorder.live.total
        self._due = now + (_OFTEN_S if self._renews or not answered else self._every_s)
        self._before = elapsed_s, answered
        if self._renews:
            sys.stderr.write(f"\r{line[: (columns(sys.stderr) or 80) - 1]}\x1b[K")
            self._open = True
        else:
            sys.stderr.write(line + "\n")
        sys.stderr.flush()

    def _figures(self, recorder: Recorder, elapsed_s: float, length_s: float) -> str:
        live, (before_s, before) = recorder.live, self._before
        failed = sum(failure.count for failure in recorder.failures.values())
        rate = (live.total - before) / (elapsed_s - before_s) if elapsed_s > before_s else 0.0
        line = f"{elapsed_s:5.1f} of {length_s:.0f} s: {live.total} requests answered, {rate:.0f}/s, {failed} failed"
        if not live.total:
            return line
        times = ", ".join(f"{name} {live.quantile_ms(share) or 0.0:.3g}" for name, share in _QUANTILES)
        return f"{line}; {times}, max {live.highest_ns / 1e6:.3g} ms"

    def end(self) -> None:
        """Go on below a line that was renewed."""
        if self._open:
            sys.stderr.write("\n")
            self._open = False


class Watch:
    """Watches a run.

    Args:
        outcome: the outcome of the run.
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
