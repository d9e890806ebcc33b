"""One certification: connect to the robot, run the checks, derive the verdicts, write the result."""

import datetime as dt
import gc
import sys
import tempfile
from collections.abc import Container, Iterable
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TextIO

import pytest

from conformance.commandline.endings import Started
from conformance.commandline.exit_codes import OF_VERDICT, ExitCode
from conformance.commandline.help_pages import say
from conformance.commandline.secrecy import SECRETS
from conformance.contract.classes import Prerequisite
from conformance.contract.described import MOTION, ROS, SOAP
from conformance.engine.checks_plugin import ChecksPlugin
from conformance.engine.motion_answers import answers
from conformance.engine.planning import conftests, pytest_options
from conformance.engine.progress import Progress, note_signals
from conformance.engine.resending import look_again, mask
from conformance.engine.result import RESULT_NAME, left_out, result_document, rfc3339, write_result
from conformance.engine.robot_under_test import RobotUnderTest
from conformance.engine.suite import suite_version
from conformance.history.writing import HistoryWriter
from conformance.scenarios.scenario import Recordings
from conformance.scenarios.stored import write_traces
from conformance.transport.client import Connection
from conformance.verdict.baseline import Accepted, Expectation, accepted_until, apply_baseline, stale_entries
from conformance.verdict.causes import Cause, by_cause
from conformance.verdict.evidence import Evidence
from conformance.verdict.run import UNSELECTED, WITHHELD, Run, Selection
from conformance.verdict.verdicts import (
    ClassValue,
    Overall,
    Value,
    Verdict,
    class_verdicts,
    is_unjudged,
    overall,
    score,
    verdict_of,
    withheld,
)


@dataclass(frozen=True)
class Certification:
    """The result of a run.

    Attributes:
        exit_code: exit code of the command (docs/cli.md).
        document: content of result.json.
        path: where result.json was written.
        unwritten: why it could not be written to the folder for results, or empty; it may be in a temporary one.
    """

    exit_code: int
    document: dict[str, Any]
    path: Path
    unwritten: str = ""


def certify(
    robot: RobotUnderTest,
    out: Path,
    *,
    command: str = "",
    baseline: tuple[Expectation, ...] = (),
    progress: TextIO | None = sys.stderr,
    bar: bool = False,
    notes: tuple[str, ...] = (),
    announced: tuple[str, ...] = (),
) -> Certification:
    """Certify a robot.

    Args:
        robot: with claims and permissions, not yet connected.
        out: folder for result.json.
        command: the command that repeats the run, for the result.
        baseline: expected failures.
        progress: stream for progress lines, or None.
        bar: whether the progress of the checks is a bar instead of lines, if the stream is a terminal.
        notes: remarks for the result, which are printed as well.
        announced: what is printed and not among the remarks, because the result tells it elsewhere.

    Raises:
        OSError: the CA file cannot be read.
    """
    run, started = robot.run, Started()
    remarks, recordings, reached = list(notes), Recordings(), True
    with note_signals(run) as interruption:
        try:
            with suppress(OSError):  # reported at the end
                write_result(_draft_result(robot, started, command, notes), out)
            robot.keep_history(HistoryWriter(out, suite_version(), rfc3339(started.at)))
            run.limit.begin()
            robot.connect(progress)
            reached = robot.was_reached
            if reached:
                # If the robot was never reached, its findings only hide that.
                if progress is not None:
                    say("\n".join(filter(None, (*notes, *announced, robot.estimate()))), progress)
                _run_and_repeat(robot, Progress(robot, progress, bar=bar), remarks, recordings)
            else:
                run.aborted = "the robot could not be reached: " + "; ".join(
                    f"{name}: {why}" for name, why in run.unreachable.items()
                )
        except KeyboardInterrupt:
            reached, run.interrupted = True, True
        finally:
            interruption.only_record()
            robot.leave_at_rest()
            remarks += robot.end_history()
        return _conclude(robot, out, remarks, recordings, baseline, started, command, reached=reached)


def _draft_result(robot: RobotUnderTest, started: Started, command: str, notes: Iterable[str]) -> dict[str, Any]:
    """Return the content of result.json for a run that has not ended, which remains if the process is killed."""
    run = replace(robot.run, interrupted=True, aborted="the run has not ended")
    told = [
        *notes,
        "The run has not ended: it is under way, or it was killed; then roaas judge tells what it had found.",
    ]
    verdicts, causes = draw_verdicts(run)
    classes = _deciding(verdicts, run.claims, run.beside)
    same = RobotUnderTest(run, Connection())
    return result_document(
        same,
        verdicts,
        causes,
        classes,
        started=started.at,
        finished=started.at,
        command=command,
        notes=told,
        interrupted=True,
    )


def _conclude(
    robot: RobotUnderTest,
    out: Path,
    remarks: list[str],
    recordings: Recordings,
    baseline: tuple[Expectation, ...],
    started: Started,
    command: str,
    *,
    reached: bool,
) -> Certification:
    """Draw the verdicts of a run that has ended, and write its result."""
    run = robot.run
    if run.interrupted:
        by = f" by {run.ended_by}" if run.ended_by else ""
        run.aborted = f"the run was interrupted{by}"
        remarks.append(f"The run was interrupted{by}; what follows is what was judged until then.")
    run.refused = robot.refusals.text
    if run.refused:
        remarks.insert(0, run.refused)
        robot.refusals.withdraw()
    remarks[:0] = filter(None, [robot.connection.overload.reason, run.stop_undelivered])
    robot.note_uncalled()
    run.unshown = robot.nothing_shown
    remarks += run.remarks
    seen, causes = draw_verdicts(run)
    remarks += [item["text"] for item in left_out(robot).values()]
    remarks += SECRETS.notes
    mask((cause.finding for cause in causes), robot.connection.credentials)
    if run.requirement_set is not None and run.scored_ids is not None:
        seen = score(seen, run.scored_ids, f"requirement set {run.requirement_set.name}")
    verdicts = apply_baseline(seen, baseline, dt.datetime.now(dt.UTC).date())
    stale = stale_entries(seen, baseline)
    remarks += [f"The baseline expects {id_} to fail, and it passes: delete the entry." for id_ in stale]
    narrowed = WITHHELD if run.selection.ids is not None else ""
    if narrowed:
        remarks.append(f"{narrowed[:1].upper()}{narrowed[1:]}: the verdict is at most inconclusive.")
    # A baseline changes the exit code only: the classes of accepted failures still fail.
    classes, accepted = (
        withheld(_deciding(one, run.claims, run.beside), run.refused or run.unshown or narrowed)
        for one in (seen, verdicts)
    )
    failed = overall(classes) is Overall.NOT_CONFORMANT
    until = accepted_until(verdicts) if failed and overall(accepted) is not Overall.NOT_CONFORMANT else ""
    if not run.enough and run.less:
        remarks.append(f"Nothing can be said of a robot {run.less}: the verdict is inconclusive unless it failed.")
    document = result_document(
        robot,
        verdicts,
        causes,
        classes if failed else accepted,
        accepted=Accepted(until, stale),
        started=started.at,
        finished=started.now,
        command=command,
        notes=remarks,
        interrupted=run.interrupted,
    )
    if found := answers(run.statement.motion_map, verdicts, recordings):
        document["motion"] = found
    document = SECRETS.masked_json(document)
    path, unwritten = _write(document, recordings, out)
    if run.interrupted or unwritten:
        code = ExitCode.INTERRUPTED if run.interrupted else ExitCode.INCONCLUSIVE
        return Certification(code, document, path, unwritten)
    code = OF_VERDICT[overall(accepted, enough=run.is_decided)] if reached else ExitCode.UNREACHABLE
    if stale and code in {ExitCode.PASSED, ExitCode.INCONCLUSIVE}:
        code = ExitCode.FAILED
    if narrowed and code == ExitCode.INCONCLUSIVE and run.is_decided and _all_hold(verdicts, run.selection):
        code = ExitCode.PASSED
    return Certification(code, document, path)


def _all_hold(verdicts: Iterable[Verdict], selection: Selection) -> bool:
    """Return whether a selected requirement passed, and none failed or would keep its class from passing."""
    own = [verdict for verdict in verdicts if selection.has(verdict.requirement.id)]
    values = {verdict.value for verdict in own}
    return Value.PASS in values and not values & {Value.FAIL, Value.ERROR} and not any(map(is_unjudged, own))


def _deciding(
    verdicts: Iterable[Verdict], claims: Iterable[str], beside: Container[str]
) -> dict[str, tuple[ClassValue, str]]:
    """Return verdict and reason of each class that decides the verdict."""
    return {name: value for name, value in class_verdicts(verdicts, claims).items() if name not in beside}


def _write(document: dict[str, Any], recordings: Recordings, out: Path) -> tuple[Path, str]:
    """Write the result and its traces, into a temporary folder if ``out`` does not take them.

    Returns:
        The path of result.json, and why it could not be written to ``out``, or an empty text.
    """
    problem = ""
    for folder in (out, None):
        try:
            path = write_result(document, folder or Path(tempfile.mkdtemp(prefix="roaas-result-")))
            write_traces(recordings, path.parent)
        except OSError as error:
            problem = problem or str(error)
        else:
            return path, problem
    return out / RESULT_NAME, problem


def draw_verdicts(run: Run) -> tuple[list[Verdict], list[Cause]]:
    """Return the verdict of each requirement in the ledger's order, before a baseline is applied, and the causes."""
    judge = run.judge
    for requirement in run.contract.ledger.values():
        evidence = judge.evidence[requirement.id]
        if not run.selection.has(requirement.id):
            # A check judges several requirements: discard what it recorded on unselected ones.
            judge.evidence[requirement.id] = Evidence(skips=[UNSELECTED])
        elif run.aborted and not (evidence.cases or evidence.skips or evidence.errors):
            judge.note_stopped(requirement.id, run.aborted)
    seen, causes = by_cause(judge.evidence, run.contract.ledger, run.claims, run.scored_ids, run.beside)
    if not run.contract.is_claimed:
        # Declaring a map claims its class, and a WSDL claims that its operations answer.
        _leave_out(
            seen[id_]
            for id_, item in run.contract.ledger.items()
            if item.class_ not in {MOTION, ROS} and (not id_.startswith(f"{SOAP}/") or Prerequisite.SEEN in item.needs)
        )
    verdicts = [
        verdict_of(requirement, seen[requirement.id], run.claims, run.statement.why_not_tested)
        for requirement in run.contract.ledger.values()
    ]
    return verdicts, causes


def _leave_out(seen: Iterable[Evidence]) -> None:
    """Leave out requirements that no permitted request can test: a device without a contract did not claim them."""
    for evidence in seen:
        evidence.parts = {part: cases for part, cases in evidence.parts.items() if cases}
        if not (evidence.cases or evidence.errors or evidence.because or evidence.unclaimed or evidence.unseen):
            evidence.unclaimed = (evidence.skips or ["nothing that may be called shows it"])[0]


class _LoadedForGood:
    """A pytest plugin that exempts modules and checks from garbage collection, because they stay until the end.

    Hypothesis looks through all that the collector knows when its first test begins: a tenth of a second.
    """

    def pytest_collection_finish(self) -> None:
        """Move every object that exists to the collector's permanent generation."""
        gc.freeze()


def _run_and_repeat(robot: RobotUnderTest, teller: Progress, remarks: list[str], recordings: Recordings) -> None:
    """Run the checks, and repeat the requests of findings. Whatever breaks, verdicts up to then are kept."""
    run = robot.run
    try:
        run.interrupted |= _run_checks(robot, teller, remarks, recordings)
        run.limit.end()
        if not (run.interrupted or run.aborted):
            robot.is_at_rest = False
            robot.begin_span("repetitions")
            look_again(run, robot.connection, robot.rest)
            robot.begin_span("tidying up")
            robot.tidy_up()
            robot.is_at_rest = True
            robot.finish()
    except (Exception, SystemExit) as error:  # noqa: BLE001 - as above
        remarks.append(f"The suite itself failed, please report this: {type(error).__name__}: {error}")
        run.aborted = run.aborted or "the suite itself failed"


def _run_checks(robot: RobotUnderTest, teller: Progress, remarks: list[str], recordings: Recordings) -> bool:
    """Run the checks with pytest, without configuration from the current folder; return True when interrupted."""
    plugin = ChecksPlugin(lambda: robot, lambda: robot.run.contract, recordings)
    try:
        with pytest.MonkeyPatch.context() as environment:
            environment.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")
            environment.delenv("PYTEST_ADDOPTS", raising=False)
            plugins = [*conftests(robot.run.contract), plugin, teller, _LoadedForGood()]
            code = pytest.main([*map(str, robot.run.contract.rules), *pytest_options()], plugins=plugins)
    finally:
        teller.end()
    if code in {pytest.ExitCode.INTERNAL_ERROR, pytest.ExitCode.USAGE_ERROR}:
        remarks.append("The suite itself failed: please report this with the command and the robot's answers.")
        robot.run.aborted = robot.run.aborted or "the suite itself failed"
    return code == pytest.ExitCode.INTERRUPTED
