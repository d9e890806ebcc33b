"""One certification: look for the robot, run the checks, draw the verdicts, write the result."""

from __future__ import annotations

import datetime as dt
import os
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

import pytest

from conformance.contract.exit_codes import OF_VERDICT, ExitCode
from conformance.engine.plugin import PHASES
from conformance.engine.result import result_document, write_result
from conformance.verdict.baseline import Expectation, apply_baseline
from conformance.verdict.verdicts import class_verdicts, overall, verdict_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    from conformance.engine.session import Session
    from conformance.verdict.verdicts import Verdict

_CHECKS = Path(__file__).parents[1] / "checks"
# A line of progress at least this often, s.
_PROGRESS_S = 2.0


@dataclass
class SessionHolder:
    """Hands a ready session to the pytest plugin, and tells of progress."""

    session: Session
    progress: TextIO | None
    _started: float = field(default_factory=time.monotonic)
    _told: float = field(default_factory=time.monotonic)
    _phase: str = ""
    _done: int = 0
    _total: int = 0

    def pytest_collection_finish(self, session: pytest.Session) -> None:
        """Take the number of checks."""
        self._total = len(session.items)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        """Say where the run is, when a phase begins and when there was nothing to read for a while."""
        mark = item.get_closest_marker("phase")
        phase = mark.args[0] if mark else PHASES[0]
        now = time.monotonic()
        if phase != self._phase or now - self._told > _PROGRESS_S:
            self._phase, self._told = phase, now
            self.tell(f"{phase}: {item.name.removeprefix('test_').replace('_', ' ')}")
        result = yield
        self._done += 1
        return result

    def tell(self, text: str) -> None:
        """Write one line of progress."""
        if self.progress is not None:
            findings = len(self.session.judge.refuted())
            found = f", {findings} requirement{'s' if findings != 1 else ''} not met" if findings else ""
            self.progress.write(
                f"[{time.monotonic() - self._started:5.1f} s] {self._done:3d}/{self._total} checks, "
                f"{self.session.connection.sent} requests{found} | {text}\n"
            )
            self.progress.flush()


@dataclass(frozen=True)
class Certification:
    """What came of a run.

    Attributes:
        exit_code: as the command's (cli.md).
        document: result.json.
        path: where it was written.
    """

    exit_code: int
    document: dict[str, Any]
    path: Path


def certify(
    session: Session,
    out: Path,
    *,
    command: str = "",
    baseline: tuple[Expectation, ...] = (),
    progress: TextIO | None = sys.stderr,
    notes: tuple[str, ...] = (),
) -> Certification:
    """Judge a robot.

    Args:
        session: robot, claims and permissions; not connected yet.
        out: folder for result.json.
        command: repeats the run; goes into the result.
        baseline: failures that are expected.
        progress: where progress is told; None for nowhere.
        notes: remarks for the result.

    Raises:
        OSError: the result cannot be written, or the CA file not be read.
    """
    started = dt.datetime.now(dt.UTC)
    remarks = list(notes)
    interrupted = False
    try:
        session.connect()
        reached = session.reached
        if reached:
            interrupted = _run_checks(session, progress, remarks)
        else:
            session.aborted = "the robot could not be reached: " + "; ".join(
                f"{name}: {why}" for name, why in session.unreachable.items()
            )
    except KeyboardInterrupt:
        reached, interrupted = True, True
    if interrupted:
        session.aborted = "the run was interrupted"
        remarks.append("The run was interrupted; what follows is what was judged until then.")
    verdicts = draw_verdicts(session, baseline)
    classes = class_verdicts(verdicts, session.claims)
    document = result_document(
        session,
        verdicts,
        classes,
        overall(classes),
        started=started,
        finished=dt.datetime.now(dt.UTC),
        command=command,
        notes=remarks,
        interrupted=interrupted,
    )
    path = write_result(document, out)
    if interrupted:
        return Certification(ExitCode.INTERRUPTED, document, path)
    return Certification(OF_VERDICT[document["verdict"]] if reached else ExitCode.UNREACHABLE, document, path)


def draw_verdicts(session: Session, baseline: tuple[Expectation, ...]) -> list[Verdict]:
    """The verdict of each requirement, in the ledger's order, with the baseline applied."""
    judge = session.judge
    for requirement in session.contract.ledger.values():
        evidence = judge.evidence[requirement.id]
        if session.aborted and not evidence.cases and not evidence.skips and not evidence.errors:
            judge.error(requirement.id, session.aborted)
    verdicts = [
        verdict_of(requirement, judge.evidence[requirement.id], session.claims)
        for requirement in session.contract.ledger.values()
    ]
    return apply_baseline(verdicts, baseline, dt.datetime.now(dt.UTC).date())


def _run_checks(session: Session, progress: TextIO | None, remarks: list[str]) -> bool:
    """Run pytest over the checks, and nothing of the folder that the user happens to be in; True when interrupted."""
    before = os.environ.get("PYTEST_DISABLE_PLUGIN_AUTOLOAD")
    os.environ["PYTEST_DISABLE_PLUGIN_AUTOLOAD"] = "1"
    addopts = os.environ.pop("PYTEST_ADDOPTS", None)
    holder = SessionHolder(session, progress)
    try:
        code = pytest.main(
            [
                str(_CHECKS),
                f"--config-file={os.devnull}",
                f"--rootdir={_CHECKS}",
                "--import-mode=importlib",
                "--capture=no",
                "-Wignore",
                *(
                    word
                    for name in ("terminal", "cacheprovider", "logging", "junitxml")
                    for word in ("-p", f"no:{name}")
                ),
                "-p",
                "conformance.engine.plugin",
            ],
            plugins=[_Named(holder)],
        )
    except Exception as error:  # noqa: BLE001 - whatever breaks, what was judged until then is not lost
        remarks.append(f"The suite itself failed, please report this: {type(error).__name__}: {error}")
        session.aborted = session.aborted or "the suite itself failed"
        return False
    finally:
        if before is None:
            del os.environ["PYTEST_DISABLE_PLUGIN_AUTOLOAD"]
        else:
            os.environ["PYTEST_DISABLE_PLUGIN_AUTOLOAD"] = before
        if addopts is not None:
            os.environ["PYTEST_ADDOPTS"] = addopts
    holder.tell("done")
    if code in {pytest.ExitCode.INTERNAL_ERROR, pytest.ExitCode.USAGE_ERROR}:
        remarks.append("The suite itself failed: please report this with the command and the robot's answers.")
        session.aborted = session.aborted or "the suite itself failed"
    return code == pytest.ExitCode.INTERRUPTED


class _Named:
    """Registers the holder under the name by which the plugin looks for it."""

    def __init__(self, holder: SessionHolder) -> None:
        self._holder = holder

    def pytest_addoption(self, pluginmanager: pytest.PytestPluginManager) -> None:
        """Register before any plugin is configured."""
        pluginmanager.register(self._holder, "roaas-session")
