"""Carries a run out, from looking at the robot to the written result."""

# Locust patches the standard library on import, which has to come before anything that uses it.
import locust  # noqa: F401, I001

import logging
import os
import signal
import sys
import traceback
from contextlib import ExitStack
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import gevent

from conformance.contract.exit_codes import ExitCode
from loadtests.measuring.step_load import step_load
from loadtests.measuring.executor import Executor, LocalExecutor, busiest
from loadtests.result.document import RunAborted, Outcome, compose
from loadtests.clients.failures import CallError
from loadtests.measuring.errors import GeneratorError
from loadtests.measuring.distributed_executor import DistributedExecutor
from loadtests.measuring.metrics import Collector, serve
from loadtests.schedule.plan import Plan
from loadtests.measuring.preflight import preflight
from loadtests.statistics.recorder import Recorder
from loadtests.result.files import write
from loadtests.clients.robot import Robot
from loadtests.settings import Settings
from loadtests.result.terminal import summary
from loadtests.clients.wsdl import WsdlError, address_in, fetch

_DEAD_S = 3.0
_DEAD_REQUESTS = 10
_LOOK_S = 0.5
_LEAST_USERS, _MOST_USERS = 32, 512
_STALL_S = 3.0  # the stall that the users of an open model outlast before arrivals queue for one


def tell(message: str) -> None:
    """A line for the person who waits."""
    sys.stderr.write(message + "\n")
    sys.stderr.flush()


class Run:
    """One run, from settings to result.

    Args:
        settings: what to do.
    """

    def __init__(self, settings: Settings) -> None:
        self.settings = settings
        self.robot = Robot(
            settings.rest if "rest" in settings.interfaces else None,
            settings.publishers if "soap" in settings.interfaces else None,
            settings.subscribers if "soap" in settings.interfaces else None,
            settings.publishers_wsdl if "soap" in settings.interfaces else None,
            settings.subscribers_wsdl if "soap" in settings.interfaces else None,
            settings.ca_file,
            settings.token,
            settings.timeout_s,
        )
        self.outcome = Outcome(settings, self.robot, datetime.now(UTC))
        self.collector: Collector | None = None
        self._alive_at = (0.0, 0)
        self._told = self._looked = 0.0
        self._parent = os.getppid()

    def interrupt(self) -> None:
        """Ctrl-C: end, keeping what there is."""
        if self.outcome.interrupted:
            os._exit(ExitCode.INTERRUPTED)  # asked for twice: not even for the result
        self.outcome.interrupted = True

    # Before the measurement.

    def resolve(self) -> None:
        """Read the addresses that only a WSDL knows.

        Raises:
            RunAborted: a WSDL is wrong, or nobody answers.
        """
        services = {
            "publishers": ("ExecuteDeliveryRequest", "publishers_wsdl"),
            "subscribers": ("GetPose", "subscribers_wsdl"),
        }
        found: dict[str, Any] = {}
        for service, (element, description) in services.items():
            location = getattr(self.robot, description)
            if getattr(self.robot, service) is not None or location is None:
                continue
            try:
                found[service] = address_in(fetch(location, self.robot), location, element)
            except WsdlError as error:
                raise RunAborted(ExitCode.USAGE, str(error)) from None
            except CallError as error:
                raise RunAborted(ExitCode.UNREACHABLE, f"the robot cannot be reached: {error}") from None
        self.robot = self.outcome.robot = replace(self.robot, **found)

    def check(self) -> None:
        """Call everything once.

        Raises:
            RunAborted: the robot does not answer as it should; what it did answer is kept for the result.
        """
        plan = self.first_plan()
        names = [
            (plan.operations[number], interface, client)
            for client in plan.clients
            for interface in plan.interfaces
            for number in plan.offered(interface, client)
        ]
        if not names:
            raise RunAborted(ExitCode.USAGE, "no operation can be measured with these endpoints")
        findings = self.outcome.findings = preflight(self.robot, names, self.settings.seed)
        self.outcome.notes += findings.notes
        if self.outcome.interrupted:
            raise RunAborted(ExitCode.INTERRUPTED, "interrupted before the measurement began")
        if findings.unreachable:
            raise RunAborted(ExitCode.UNREACHABLE, "the robot cannot be reached: " + "; ".join(findings.messages()))
        if findings.failures:
            raise RunAborted(
                ExitCode.INCONCLUSIVE, "the robot does not answer as it should: " + "; ".join(findings.messages())
            )
        self.outcome.invalid += [
            f"the interfaces' payloads are not equivalent: {reason}" for reason in findings.unequal
        ]

    def first_plan(self) -> Plan:
        """The duel's plan."""
        settings, robot = self.settings, self.robot
        interfaces, offers, missing = [], {}, set()
        for interface in settings.interfaces:
            for client in settings.clients:
                numbers = [
                    number for number, name in enumerate(settings.operations) if robot.offers(interface, client, name)
                ]
                missing |= {
                    f"{name} is not measured over {interface} ({client}): no endpoint or WSDL for it"
                    for number, name in enumerate(settings.operations)
                    if number not in numbers
                }
                offers[f"{interface}/{client}"] = numbers
            if any(offers[f"{interface}/{client}"] for client in settings.clients):
                interfaces.append(interface)
        clients = tuple(
            client for client in settings.clients if all(offers[f"{interface}/{client}"] for interface in interfaces)
        )
        self.outcome.notes += [note for note in sorted(missing) if note not in self.outcome.notes]
        workers = max(1, settings.expect)
        return Plan(
            operations=settings.operations,
            interfaces=tuple(interfaces),
            clients=clients,
            rate=settings.rate,
            users=settings.users,
            duration_s=settings.duration_s,
            warmup_s=settings.warmup_s,
            arrivals=settings.arrivals,
            seed=settings.seed,
            timeout_s=settings.timeout_s,
            workers=workers,
            connections=self.users(workers),
            offers=offers,
        )

    def users(self, workers: int) -> int:
        """How many users come up in all."""
        settings = self.settings
        if settings.users is not None and not settings.step_rates:
            return settings.users
        rate = max(settings.rate or 0.0, *settings.step_rates, 0.0)
        each = min(_MOST_USERS, max(_LEAST_USERS, int(rate / workers * _STALL_S)))
        return each * workers

    # The measurement.

    def measure(self) -> None:
        """Come up, warm up, duel, step.

        Raises:
            RunAborted: the generator cannot work.
        """
        plan, settings = self.first_plan(), self.settings
        with ExitStack() as stack:
            try:
                executor = self.outcome.executor = self._executor()
                stack.callback(executor.close)
                if settings.metrics_port is not None:
                    self.collector = Collector(lambda: executor.recorder, settings.operations)
                    stack.callback(serve(self.collector, settings.web_host, settings.metrics_port).stop)
                if settings.web_port is not None:
                    self._web(executor, settings.web_host, settings.web_port)
                executor.prepare(
                    self.robot, settings.operations, settings.seed, zeep="zeep" in plan.clients, users=plan.connections
                )
            except GeneratorError as error:
                raise RunAborted(
                    ExitCode.INTERRUPTED if self.outcome.interrupted else ExitCode.USAGE, str(error)
                ) from None
            self._tell_plan(plan, executor)
            self._carry_out(plan, executor)
            self.outcome.cpu_share = busiest(executor)
            self.outcome.plan = plan
            if settings.step_rates and not self.outcome.interrupted and self.outcome.dead_at is None:
                self.outcome.steps += step_load(
                    plan, executor, settings, lambda: self.outcome.interrupted, self._number, tell
                )

    def _executor(self) -> Executor:
        settings = self.settings
        if settings.expect:
            return DistributedExecutor(
                settings.master_host,
                settings.master_port,
                settings.processes,
                settings.expect,
                tell,
                lambda: self.outcome.interrupted,
            )
        return LocalExecutor()

    @staticmethod
    def _web(executor: Executor, host: str, port: int) -> None:
        """Locust's web UI, watching; it starts and stops nothing here."""
        web = executor.environment.create_web_ui(host, port)
        gevent.sleep(0.2)
        if web.greenlet.ready():
            raise GeneratorError(f"the web UI's port {port} is in use: choose another with --web-port")
        tell(f"Locust's web UI: http://{host}:{port}")

    def _carry_out(self, plan: Plan, executor: Executor) -> None:
        """Run a plan, watching for its end, Ctrl-C and the robot's death."""
        self._number(plan)
        self.outcome.plan = plan
        self._alive_at = (0.0, 0)
        ceiling = self.settings.max_rate if not plan.open_model else None
        executor.run(plan, ceiling, lambda elapsed: self._watch(plan, executor.recorder, elapsed))

    def _watch(self, plan: Plan, recorder: Recorder, elapsed: float) -> bool:
        """Whether to end now."""
        self.outcome.elapsed_s = max(0.0, min(elapsed, plan.length_s))
        if os.getppid() != self._parent:  # whoever started us is aborted
            self.outcome.interrupted = True
        if elapsed - self._looked >= _LOOK_S and self.outcome.dead_at is None:
            self._looked = elapsed
            succeeded = sum(cell.service.total for cell in recorder.cells.values())
            failed = sum(failure.count for failure in recorder.failures.values())
            since, before = self._alive_at
            if succeeded > before or failed < _DEAD_REQUESTS:
                self._alive_at = (elapsed, succeeded)
            elif elapsed - since > _DEAD_S + (1.0 if self.settings.expect else 0.0):
                self.outcome.dead_at = since
                tell(f"no request has succeeded since {since:.1f} s: ending the run")
        if elapsed - self._told >= 1.0:
            self._told = elapsed
            done = sum(cell.service.total for cell in recorder.cells.values())
            tell(f"{elapsed:6.1f} s of {plan.length_s:.0f} s: {done} requests answered")
        return self.outcome.interrupted or self.outcome.dead_at is not None

    def _number(self, plan: Plan) -> None:
        """Have the metrics know a plan's segments."""
        if self.collector is not None:
            self.collector.series_of.update(plan.series_of())

    @staticmethod
    def _tell_plan(plan: Plan, executor: Executor) -> None:
        load = f"{plan.rate:g} requests/s" if plan.open_model else f"{plan.users} users"
        tell(
            f"measuring {', '.join(plan.operations)} over {' and '.join(plan.interfaces)} at {load} "
            f"for {plan.duration_s:g} s after {plan.warmup_s:g} s of warm-up, {plan.blocks} blocks, "
            f"paced by {executor.pacing}"
        )


def carry_out(settings: Settings) -> int:
    """Do a run and write its result; returns the exit code."""
    logging.getLogger("locust").setLevel(logging.ERROR)  # it warns of spawning fast, which is what we want
    run = Run(settings)
    for number in (signal.SIGINT, signal.SIGTERM):
        gevent.signal_handler(number, run.interrupt)
    aborted: RunAborted | None = None
    try:
        run.resolve()
        run.check()
        run.measure()
    except RunAborted as reason:
        aborted = reason
        tell(f"roaas load: {aborted}")
    except Exception as trouble:  # noqa: BLE001 -- our own fault: what was measured is kept, and called invalid
        traceback.print_exc()
        aborted = RunAborted(ExitCode.INCONCLUSIVE, f"the load generator failed: {type(trouble).__name__}: {trouble}")
    code, document = compose(run.outcome, run.outcome.plan or run.first_plan(), aborted)
    if aborted is None or aborted.code != ExitCode.USAGE:
        path = write(Path(settings.out), document)
        tell(f"written: {path}")
    if aborted is None:
        sys.stdout.write(summary(document))
        sys.stdout.flush()
    return code
