"""A worker process: `python -m loadtests.measuring.worker HOST PORT`, with a JSON object on its standard input.

The object contains the robots' credentials, which are not sent over the network, and the folder for the worker's
records when its master dies: `{"secrets": […], "folder": "…"}`.

When its master is gone, a worker leaves the figures of its own share in a file for people to read. The file contains no
verdict, because the other workers' shares are missing. But the figures of a long run are not lost.
"""

import logging
import os
import platform
import signal
import sys
import time
from collections.abc import Sequence
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import gevent
import locust.runners
import msgspec
from gevent.event import Event

from conformance.commandline.exit_codes import ExitCode
from conformance.commandline.guard import make_streams_lenient
from conformance.commandline.out_folder import write_json
from loadtests.clients.robot import Robot, Secrets, with_secrets
from loadtests.clients.wire import now_ns
from loadtests.measuring.clocks import answer_clock, clock_id
from loadtests.measuring.errors import GeneratorError
from loadtests.measuring.executor import REPORT_S, new_environment
from loadtests.measuring.user_session import Session, new_session
from loadtests.schedule.plan import Plan
from loadtests.settings.settings import Scenario
from loadtests.statistics.recorder import Recorder

if TYPE_CHECKING:
    from loadtests.measuring.scenario import ScenarioSession

FORMAT = "roaas-worker/1"
#: The master answers a heartbeat each second. If it is silent for this long, it is dead, or the network to it is.
MASTER_SILENT_S = 20.0
_LOOK_S = 0.5


class LeftBehind:
    """A worker's reports, kept to be written to a file if the master dies."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.recorder = Recorder()
        self.plans: list[Plan] = []
        self._place = (0, 0)

    def begin(self, plan: Plan, worker: int) -> None:
        """Set the plan to which the next reports belong; reports of load steps are not kept."""
        self._place = (worker, plan.workers)
        if plan.step_rate is None:
            self.plans.append(plan)

    def add(self, report: dict[str, Any]) -> None:
        """Keep a report in the format of `Recorder.take`."""
        self.recorder.merge(Recorder.unpack(report))

    @property
    def requests(self) -> int:
        """Return how many requests are kept."""
        return sum(cell.service.total + cell.errors for cell in self.recorder.cells.values())

    def write(self, why: str) -> Path | None:
        """Write the reports to a file and return its path; return None if there are no reports.

        Raises:
            OSError: the folder cannot be written to.
        """
        if not self.plans or not self.requests:
            return None
        # SciPy comes with these and takes a second to import, which no worker of a master that lives has to wait for.
        from loadtests.statistics import figures, over_time  # noqa: PLC0415
        from loadtests.statistics.measured import Measured  # noqa: PLC0415

        worker, workers = self._place
        document = {
            "format": FORMAT,
            "why": why,
            "worker": worker + 1,
            "workers": workers,
            "host": platform.node(),
            "pid": os.getpid(),
            "requests": self.requests,
            "plan": self.plans[0].as_message(),
            "series": msgspec.to_builtins(figures.series(Measured(self.plans, self.recorder), {})),
            "errors": over_time.errors(self.recorder, self.plans[0].operations),
        }
        self.folder.mkdir(parents=True, exist_ok=True)
        path = self.folder / f"worker-{platform.node()}-{os.getpid()}.json"
        return write_json(path, document, indent=1, allow_nan=False)


class _Told(msgspec.Struct, frozen=True):
    """The message of a master on this machine to its workers' standard input."""

    secrets: tuple[Secrets, ...] = ()
    folder: str = "."
    scenario: str | None = None


def _say(message: str) -> None:
    sys.stderr.write(f"roaas load: worker {os.getpid()}: {message}\n")
    sys.stderr.flush()


def _leave(code: int, message: str) -> NoReturn:
    """Exit the process at once: an ordinary exit would wait for messages to reach the master."""
    _say(message)
    os._exit(code)


class Worker:
    """A Locust worker that carries out the plans of its master."""

    def __init__(
        self, environment: Any, host: str, port: int, secrets: Sequence[Secrets], folder: Path, scenario: str | None
    ) -> None:
        locust.runners.WORKER_REPORT_INTERVAL = REPORT_S
        self.environment = environment
        self.secrets = secrets
        self.scenario = scenario
        self.session: Session | ScenarioSession | None = None
        self.master = f"{host}:{port}"
        self.left = LeftBehind(folder)
        self._idle = Event()
        self._idle.set()
        self._heard = time.monotonic()
        self._report: dict[str, Any] | None = None
        self._reported = 0.0
        environment.events.report_to_master.add_listener(self._on_report)
        self.runner = environment.create_worker_runner(host, port)
        self.runner.register_message("roaas_prepare", self._on_prepare, concurrent=True)
        self.runner.register_message("roaas_begin", self._on_begin, concurrent=True)
        self.runner.register_message("roaas_stop", self._on_stop)
        self.runner.register_message("roaas_late", self._on_late)
        answer_clock(self.runner)
        self._heard = time.monotonic()
        environment.events.heartbeat_received.add_listener(self._on_heartbeat)
        self._about = {"pid": os.getpid(), "host": platform.node(), "clock": clock_id()}
        # Locust has announced us long before this worker could listen to messages.
        self.runner.send_message("roaas_listening", self._about)

    def _on_prepare(self, environment: Any, msg: Any) -> None:
        job = msg.data
        error = ""
        try:
            robots = [
                with_secrets(msgspec.convert(robot, Robot), secrets)
                for robot, secrets in zip_longest(job["robots"], self.secrets[: len(job["robots"])])
            ]
            self.session = new_session(
                environment,
                robots,
                tuple(job["operations"]),
                job["seed"],
                library=job["library"],
                scenario=self._scenario(job, robots[0]),
            )
            self.session.after_segment = self._pack
            environment.roaas_session = self.session
        except Exception as trouble:  # noqa: BLE001 -- whatever it is, the master has to hear of it
            error = str(trouble) if isinstance(trouble, GeneratorError) else f"{type(trouble).__name__}: {trouble}"
        pacing = self.session.pacing if self.session else ""
        self.runner.send_message("roaas_ready", self._about | {"error": error, "pacing": pacing})

    def _scenario(self, job: dict[str, Any], robot: Robot) -> Scenario | None:
        """Return this machine's copy of the master's scenario; code is never taken from the network."""
        if job["scenario"] is None:
            return None
        if [credential.variable for credential in robot.credentials] != job["credentials"]:
            raise GeneratorError("the scenario needs credentials that this worker lacks: give it the master's options")
        if self.scenario is None:
            raise GeneratorError("the master runs a scenario: start this worker with --scenario FILE as well")
        return Scenario(self.scenario, job["scenario"])

    def _on_begin(self, environment: Any, msg: Any) -> None:
        del environment
        job, session = msg.data, self.session
        if session is None:
            return
        plan, origin = Plan.from_message(job["plan"]), job["origin_ns"]
        self._idle.clear()
        self.left.begin(plan, job["worker"])
        try:
            session.run(plan, job["worker"], now_ns() + job["lead_ns"] if origin is None else origin, job["ceiling"])
            report = self._take_parts()
        finally:
            self._idle.set()
        self.runner.send_message("roaas_done", {"roaas": report})

    def _on_stop(self, environment: Any, msg: Any) -> None:
        del environment, msg
        if self.session is not None:
            self.session.stop()

    def _on_late(self, environment: Any, msg: Any) -> None:
        del environment, msg
        _say(f"the master at {self.master} had already distributed the run: this worker takes no part in it")

    def _on_heartbeat(self, **_: Any) -> None:
        self._heard = time.monotonic()

    def follow(self, parent: int | None) -> None:
        """End this process when the master sends nothing for too long, or is no longer the parent process."""
        while True:
            gevent.sleep(_LOOK_S)
            if parent is not None and os.getppid() != parent:
                self._end(f"the master (process {parent}) has ended")
            if time.monotonic() - self._heard > MASTER_SILENT_S:
                self._end(f"the master at {self.master} has been silent for {MASTER_SILENT_S:g} s")

    def _end(self, why: str) -> None:
        """Stop sending, write the records to a file, and end the process."""
        if self.session is not None:
            self.session.stop()
        self._idle.wait()  # requests under way have deadlines
        try:
            path = self.left.write(why)
            kept = f"what this worker recorded is in {path}" if path else "it had recorded nothing"
        except OSError as error:
            kept = f"what it had recorded is lost: {error}"
        _leave(ExitCode.INCONCLUSIVE, f"{why}: this worker ends; {kept}")

    def _take_parts(self) -> dict[str, Any]:
        """Return everything recorded since the last report, in parts."""
        session = self.session
        waiting, self._report = self._report, None
        parts = [session.recorder.take()] if session else []
        for part in parts:
            self.left.add(part)
        return {
            "recorded": (waiting["recorded"] if waiting else []) + parts,
            "cpu_share": session.cpu_share if session else None,
        }

    def _pack(self) -> None:
        """Prepare the next report in a gap between blocks, where that delays no request."""
        if self._report is None and time.monotonic() - self._reported >= REPORT_S * 0.5:
            self._report = self._take_parts()

    def _on_report(self, client_id: str, data: dict[str, Any]) -> None:
        del client_id
        if self._report is not None:
            data["roaas"], self._report = self._report, None
            self._reported = time.monotonic()


def serve(
    host: str,
    port: int,
    secrets: Sequence[Secrets],
    folder: Path,
    parent: int | None = None,
    scenario: str | None = None,
) -> None:
    """Run a worker until the master quits or is gone.

    Args:
        host: where the master listens.
        port: its port.
        secrets: secrets of each robot.
        folder: for what was recorded if the master dies.
        parent: the master's process id, if it started this process.
        scenario: the file of the scenario, if the master runs one.
    """
    logging.getLogger("locust").setLevel(logging.ERROR)
    try:
        worker = Worker(new_environment(), host, port, secrets, folder, scenario)
    except ConnectionError:
        _leave(
            ExitCode.UNREACHABLE,
            f"no master responds at {host}:{port}: give its address with --master-host and --master-port",
        )
    gevent.spawn(worker.follow, parent)
    worker.runner.greenlet.join()


def main() -> None:
    """Run a worker of a master on this machine."""
    make_streams_lenient()
    parent = os.getppid()
    told = msgspec.json.decode(sys.stdin.readline() or "{}", type=_Told)
    gevent.signal_handler(signal.SIGINT, lambda: None)  # the master says when to stop
    serve(sys.argv[1], int(sys.argv[2]), told.secrets, Path(told.folder), parent, told.scenario)


if __name__ == "__main__":
    main()
