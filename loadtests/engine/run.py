"""Carry out one run and write its result, also where the run fails or the process is killed."""

import logging
import sys
import traceback
from collections.abc import Callable
from contextlib import ExitStack, suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import gevent
import locust  # patches the standard library, which has to come before our modules that use it

from conformance.commandline.endings import Started, ending_signals
from conformance.commandline.exit_codes import ExitCode
from conformance.commandline.result_command import CommandResult
from conformance.documents.wsdl import WsdlError
from loadtests.clients.failures import CallError
from loadtests.clients.wsdl import with_addresses
from loadtests.engine.planning import duel_plan, until_decided
from loadtests.engine.watching import Progress, Watch, follow_parent, show_web_ui, tell_plan
from loadtests.measuring.distributed_executor import DistributedExecutor, Executor
from loadtests.measuring.errors import GeneratorError
from loadtests.measuring.executor import REPORT_S, LocalExecutor, busiest
from loadtests.measuring.preflight import preflight, reach
from loadtests.measuring.rising_load import RisingLoad
from loadtests.measuring.robot_process import RobotProcess, start_anew
from loadtests.measuring.streams import hear
from loadtests.result.document import compose
from loadtests.result.files import write
from loadtests.result.outcome import Carried, Outcome, RunAborted
from loadtests.result.terminal import summary
from loadtests.schedule.plan import QUICK_ANSWER_S, SHORT_BLOCK_S, Plan
from loadtests.settings.settings import Settings
from loadtests.statistics.rounds import between_runs

if TYPE_CHECKING:
    from loadtests.clients.robot import Robot


class Run:
    """One run, from settings to result."""

    def __init__(self, settings: Settings) -> None:
        self.settings = settings
        other = () if settings.against is None else (settings.against.robot,)
        self.robots: tuple[Robot, ...] = (settings.robot, *other)
        self.outcome = Outcome(settings, self.robots, Started())
        self.plan, _ = duel_plan(settings, *self.robots)  # preliminary: the WSDLs have not been read
        self.progress = Progress(settings.output.progress)
        self._watch = Watch(self.outcome, REPORT_S if settings.generator.expect else 0.0, self.progress)

    @property
    def _promise(self) -> str:
        """Return the sentence on how the robot responds."""
        return "the contract" if self.settings.description is None else "its description"

    def interrupt(self) -> None:
        """End the run on a signal, or when its parent process ends, and keep the measurements."""
        self.outcome.interrupted = True

    # Before the measurement.

    def resolve(self) -> None:
        """Read the addresses that only a WSDL contains, and make the plan.

        Raises:
            RunAborted: a WSDL is wrong, or the robot does not respond.
        """
        try:
            self.robots, remarks = self.outcome.robots, _ = with_addresses(*self.robots)
        except WsdlError as error:
            raise RunAborted(ExitCode.USAGE, str(error)) from None
        except CallError as error:
            raise RunAborted(ExitCode.UNREACHABLE, f"the robot cannot be reached: {error}") from None
        self.plan, notes = duel_plan(self.settings, *self.robots)
        self.outcome.notes += [*remarks, *notes]

    def check(self) -> None:
        """Call everything once.

        Raises:
            RunAborted: a response is wrong or missing; the others are kept for the result.
        """
        names = self.plan.series_names()
        if not names:
            raise RunAborted(ExitCode.USAGE, "no operation can be measured with these endpoints")
        if self.settings.scenario is not None:
            self._reach()
            return
        slowest_s = 0.0
        for robot, whose in zip(self.robots, ("the robot", "the robot of --against"), strict=False):
            findings = preflight(robot, names, self.settings.load.seed)
            if whose == "the robot":
                self.outcome.findings = findings
            self.outcome.notes += [note for note in findings.notes if note not in self.outcome.notes]
            told = "; ".join(findings.messages())
            if self.outcome.interrupted:
                raise RunAborted(ExitCode.INTERRUPTED, "interrupted before the measurement began")
            if findings.unreachable:
                raise RunAborted(ExitCode.UNREACHABLE, f"{whose} cannot be reached: {told}")
            if refused := findings.refusal_text(whose):
                raise RunAborted(ExitCode.INCONCLUSIVE, f"{refused} {told}")
            if findings.failures:
                raise RunAborted(ExitCode.INCONCLUSIVE, f"{whose} does not respond as {self._promise} says: {told}")
            self.outcome.invalid += [
                f"the interfaces' payloads are not equivalent: {reason}" for reason in findings.unequal
            ]
            slowest_s = max(slowest_s, findings.slowest_s)
        if self.plan.open_model and self.plan.workers == 1 and slowest_s <= QUICK_ANSWER_S:
            self.plan = replace(self.plan, least_block_s=SHORT_BLOCK_S)

    def _reach(self) -> None:
        """Open a connection to the robot; only the scenario knows which requests to send.

        Raises:
            RunAborted: nothing listens there.
        """
        try:
            reach(self.robots[0])
        except CallError as error:
            raise RunAborted(ExitCode.UNREACHABLE, f"the robot cannot be reached: {error}") from None

    def name_called(self) -> None:
        """Limit the plans to the operations that a scenario has called: which, only the run shows."""
        executor = self.outcome.executor
        if self.settings.scenario is None or executor is None:
            return
        executor.recorder.flush()
        called = sorted({operation for _, operation in executor.recorder.cells}) or [0]
        for carried in self.outcome.carried:
            carried.plan = replace(carried.plan, offers={"rest/wire": called})
        self.plan = replace(self.plan, offers={"rest/wire": called})
        unjudged = set(self.settings.slo) - {self.plan.operations[number] for number in called}
        if unjudged:
            self.outcome.notes.append(f"not called, so not judged: [slo] {', '.join(sorted(unjudged))}")

    # The measurement.

    def measure(self) -> None:
        """Start the users, warm up, compare the two sides, and carry out the other measurements of the settings.

        Raises:
            RunAborted: the load generator cannot work.
        """
        plan, settings, generator = self.plan, self.settings, self.settings.generator
        with ExitStack() as stack:
            try:
                executor = self.outcome.executor = self._executor()
                stack.callback(executor.close)
                if generator.web_port is not None:
                    show_web_ui(executor, generator.web_host, generator.web_port, self.progress.say)
                executor.prepare(self.robots, plan, settings.scenario)
            except GeneratorError as error:
                raise RunAborted(
                    ExitCode.INTERRUPTED if self.outcome.interrupted else ExitCode.USAGE, str(error)
                ) from None
            tell_plan(plan, executor.pacing, self.progress.say)
            self.outcome.robot_process = RobotProcess.find(self.robots[0])
            plan = self._repeat(plan, executor)
            if self._over:
                return
            self.outcome.heard = hear(self.robots[0], settings, lambda: self._over, self.progress.say)
            if settings.steps.has_searches and not self._over:
                self._load_more(plan, executor)

    def _load_more(self, plan: Plan, executor: Executor) -> None:
        """Search the knee."""
        outcome = self.outcome
        load = RisingLoad(plan, executor, self.settings, lambda: outcome.interrupted, self.progress.say)
        outcome.knee_searches += load.knees()

    @property
    def _over(self) -> bool:
        """Return whether the measurement has to end."""
        executor = self.outcome.executor
        faults = executor is not None and bool(executor.recorder.faults)
        return self.outcome.interrupted or self.outcome.dead_at is not None or faults

    def _repeat(self, plan: Plan, executor: Executor) -> Plan:
        """Carry out the comparison for each repeat; return the last plan."""
        repeats = self.settings.repeats
        for number in range(repeats.number):
            if number:
                plan = plan.again()
                self.progress.say(f"repeat {number + 1} of {repeats.number}, over new connections")
                self._start_anew(repeats.restart_command, plan)
            if self._over:
                break
            self._carry_out(plan, executor)
        other = self.settings.against
        if other is None:
            return plan
        part = partial(self._carry_out, executor=executor)
        deviation = between_runs(self.outcome.before.load)
        return until_decided(plan, other, executor.recorder, deviation, part, lambda: self._over, self.progress.say)

    def _start_anew(self, command: str | None, plan: Plan) -> None:
        """Restart the robot with a command, if there is one, and wait until the robot responds."""
        if command is None:
            return
        names, seed = plan.series_names(), self.settings.load.seed
        try:
            start_anew(command, lambda: preflight(self.robots[0], names, seed), lambda: self.outcome.interrupted)
        except GeneratorError as error:
            raise RunAborted(ExitCode.UNREACHABLE, str(error)) from None

    def _executor(self) -> Executor:
        generator = self.settings.generator
        if generator.expect:
            folder = self.settings.output.folder
            return DistributedExecutor(generator, folder, self.progress.say, lambda: self.outcome.interrupted)
        return LocalExecutor()

    def _carry_out(self, plan: Plan, executor: Executor) -> None:
        """Carry out a plan until its end, Ctrl-C or the robot's death."""
        carried = Carried(plan)
        self.outcome.carried.append(carried)
        ceiling = self.settings.limits.max_rate if not plan.open_model else None
        executor.run(plan, ceiling, lambda elapsed: self._watch.look(carried, executor.recorder, elapsed))
        self.outcome.cpu_share = max(busiest(executor.members) or 0.0, self.outcome.cpu_share or 0.0)


def _begin(run: Run) -> Path | None:
    """Write a result that remains if this process is killed; return its path, or None if it cannot be written."""
    unfinished = RunAborted(ExitCode.INCONCLUSIVE, "the run has not ended: it is under way, or it was killed")
    _, document = compose(run.outcome, run.plan, unfinished)
    with suppress(OSError):  # reported at the end
        return write(Path(run.settings.output.folder), document | {"interrupted": True})
    return None


def _complain(run: Run, message: str) -> None:
    """Print an error, even if progress is switched off."""
    run.progress.end()
    sys.stderr.write(f"roaas load: {message}\n")
    sys.stderr.flush()


def carry_out(settings: Settings, begun: Callable[[Path], object] = lambda _: None) -> CommandResult:
    """Carry out a run and write its result; `begun` gets the path of the result that is there before the run ends."""
    logging.getLogger(locust.__name__).setLevel(logging.ERROR)  # it warns of fast spawning, which we want
    run = Run(settings)
    for number in ending_signals():
        gevent.signal_handler(number, run.interrupt)
    gevent.spawn(follow_parent, run.interrupt)
    aborted: RunAborted | None = None
    early: Path | None = None
    try:
        run.resolve()
        if (early := _begin(run)) is not None:
            begun(early)
        run.check()
        run.measure()
    except RunAborted as reason:
        aborted = reason
        _complain(run, str(aborted))
    except Exception as trouble:  # noqa: BLE001 -- our own fault: what was measured is kept, and called invalid
        traceback.print_exc()
        aborted = RunAborted(ExitCode.INCONCLUSIVE, f"the load generator failed: {type(trouble).__name__}: {trouble}")
    run.progress.end()
    run.name_called()
    code, document = compose(run.outcome, run.plan, aborted)
    path, folder = None, Path(settings.output.folder)
    if aborted is not None and aborted.code == ExitCode.USAGE:
        if early is not None:
            early.unlink()
    else:
        try:
            run.progress.say(f"written: {(path := write(folder, document))}")
        except OSError as error:  # the measurement is printed below
            code = ExitCode.INCONCLUSIVE
            _complain(run, f"{folder}: cannot write there: {error.strerror or error}")
    if aborted is None:
        sys.stdout.write(summary(document))
        sys.stdout.flush()
    return CommandResult(code, path)
