"""What happens while a plan is carried out: progress on standard error, and what ends the run before its time."""

import os
import sys

import gevent

from loadtests.engine.liveness import Liveness
from loadtests.measuring.distributed_executor import Executor
from loadtests.measuring.errors import GeneratorError
from loadtests.result.outcome import Carried, Outcome
from loadtests.schedule.plan import Plan
from loadtests.statistics.recorder import Recorder


def tell(message: str) -> None:
    """Write a line of progress to standard error."""
    sys.stderr.write(message + "\n")
    sys.stderr.flush()


def tell_plan(plan: Plan, pacing: str) -> None:
    """Say what will be measured, and how."""
    load = f"{plan.load.rate:g} requests/s" if plan.open_model else f"{plan.load.users} users"
    tell(
        f"measuring {'a scenario' if plan.scenario else ', '.join(plan.operations)} over "
        f"{' and '.join(plan.interfaces)} at {load} for {plan.load.duration_s:g} s after {plan.load.warmup_s:g} s of "
        f"warm-up, {plan.blocks} blocks, paced by {pacing}"
    )


def show_web_ui(executor: Executor, host: str, port: int) -> None:
    """Show Locust's web UI, which only watches the run.

    Raises:
        GeneratorError: the port is in use.
    """
    web = executor.environment.create_web_ui(host, port)
    gevent.sleep(0.2)
    if web.greenlet.ready():
        raise GeneratorError(f"the web UI's port {port} is in use: choose another with --web-port")
    tell(f"Locust's web UI: http://{host}:{port}")


class Watch:
    """Watches a run.

    Args:
        outcome: of the run.
        report_s: how late the counts may be, in seconds.
    """

    def __init__(self, outcome: Outcome, report_s: float) -> None:
        self._outcome = outcome
        self._liveness = Liveness(report_s)
        self._told = 0.0
        self._parent = os.getppid()

    def look(self, carried: Carried, recorder: Recorder, elapsed: float) -> bool:
        """Report progress; returns whether to end now."""
        plan, outcome = carried.plan, self._outcome
        carried.elapsed_s = max(0.0, min(elapsed, plan.length_s))
        elapsed += plan.offset_s
        if os.getppid() != self._parent:  # the parent process has ended
            outcome.interrupted = True
        if outcome.dead_at is None and self._liveness.is_due(elapsed):
            succeeded = sum(cell.service.total for cell in recorder.cells.values())
            failed = sum(failure.count for failure in recorder.failures.values())
            outcome.dead_at = self._liveness.dead_since(elapsed, succeeded, failed)
            if outcome.dead_at is not None:
                tell(f"no request has succeeded since {outcome.dead_at:.1f} s: ending the run")
        if elapsed - self._told >= 1.0:
            self._told = elapsed
            done = sum(cell.service.total for cell in recorder.cells.values())
            tell(f"{elapsed:6.1f} s of {plan.offset_s + plan.length_s:.0f} s: {done} requests answered")
        return outcome.interrupted or outcome.dead_at is not None or bool(recorder.faults)
