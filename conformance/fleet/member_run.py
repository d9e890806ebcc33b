"""The certification of one robot of a fleet, in a process of its own."""

from __future__ import annotations

import asyncio
import contextlib
import hashlib
import json
import os
import re
import signal
import sys
import time
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Any

from msgspec.structs import asdict

from conformance.commandline.endings import as_parent
from conformance.commandline.exit_codes import ExitCode
from conformance.commandline.out_folder import own_folder, write_atomically
from conformance.contract.toml_file import basic_string

if TYPE_CHECKING:
    from pathlib import Path

    from conformance.fleet.fleet_file import Member

LOG_NAME = "certify.log"
RESULT_NAME = "result.json"
# The files that a certification writes: those of an earlier run must not remain.
_WRITTEN = (
    RESULT_NAME,
    LOG_NAME,
    "certificate*",
    "junit.xml",
    "badge.json",
    "*.sarif",
    "ctrf*.json",
    "gl-*.json",
    "annotations.txt",
)
# A run that has to end stops the robot, for up to 20 s, and writes its result: this is its time, s.
_GRACE_S = 45.0
_PROGRESS = re.compile(rb"(\d+/\d+) checks[^\n]*\n[^\n]*\Z")
_SHOWN = 400


class Outcome(StrEnum):
    """The outcome of one robot's certification."""

    CONFORMANT = "conformant"
    NOT_CONFORMANT = "not-conformant"
    INCONCLUSIVE = "inconclusive"
    UNREACHABLE = "unreachable"
    GIVEN_UP = "given-up"
    NOT_JUDGED = "not-judged"
    INTERRUPTED = "interrupted"
    NOT_STARTED = "not-started"


#: The exit code of each outcome; a failure that a baseline accepts counts as none.
EXIT_CODES = {
    Outcome.CONFORMANT: ExitCode.PASSED,
    Outcome.NOT_CONFORMANT: ExitCode.FAILED,
    Outcome.INCONCLUSIVE: ExitCode.INCONCLUSIVE,
    Outcome.UNREACHABLE: ExitCode.UNREACHABLE,
    Outcome.GIVEN_UP: ExitCode.INCONCLUSIVE,
    Outcome.NOT_JUDGED: ExitCode.USAGE,
    Outcome.INTERRUPTED: ExitCode.INTERRUPTED,
    Outcome.NOT_STARTED: ExitCode.INTERRUPTED,
}
_OF_VERDICT = {str(one): one for one in (Outcome.CONFORMANT, Outcome.NOT_CONFORMANT, Outcome.INCONCLUSIVE)}


@dataclass(frozen=True)
class MemberResult:
    """The result of one robot's certification.

    Attributes:
        outcome: in a word.
        exit_code: the exit code of its process, negative for a signal; None if it was not started.
        reason: why there is no verdict, or empty.
        seconds: duration, s.
        document: content of its result.json, or None.
        digest: SHA-256 of that file, as `sha256:…`, or None.
    """

    member: Member
    outcome: Outcome
    exit_code: int | None = None
    reason: str = ""
    seconds: float = 0.0
    document: dict[str, Any] | None = None
    digest: str | None = None

    @property
    def trusted_classes(self) -> list[str]:
        """The classes that the robot passed in a complete run, without failures accepted by a baseline."""
        if self.document is None or self.document["interrupted"]:
            return []
        accepted = {item["class"] for item in self.document["requirements"] if "expected_failure" in item}
        classes: dict[str, str] = self.document["classes"]
        return [name for name, verdict in classes.items() if verdict == "pass" and name not in accepted]


class Stop:
    """The interrupt signals so far: the first ends each run gracefully, the second kills it."""

    def __init__(self) -> None:
        self.asked, self.insisted = asyncio.Event(), asyncio.Event()

    def ask(self) -> None:
        """Count a signal."""
        (self.insisted if self.asked.is_set() else self.asked).set()


class MemberRun:
    """The certification of one robot, in a process and folder of its own.

    Args:
        member: the robot.
        folder: for its results.
        options: options of `roaas certify`, the same for all robots.
        time_limit_s: time after which the run is aborted, s.
    """

    def __init__(self, member: Member, folder: Path, options: list[str], time_limit_s: float) -> None:
        self.member, self._folder, self._options, self._limit_s = member, folder, options, time_limit_s

    async def judge(self, stop: Stop) -> MemberResult:
        """Certify the robot. Any failure becomes its result and does not affect the other robots."""
        started = time.monotonic()
        try:
            self._prepare()
            with (self._folder / LOG_NAME).open("wb") as log:
                # A session of its own: Ctrl-C reaches the fleet's process alone, which ends the runs one by one. A run
                # whose fleet is killed ends by itself.
                process = await asyncio.create_subprocess_exec(
                    *self._command(),
                    stdin=asyncio.subprocess.DEVNULL,
                    stdout=log,
                    stderr=log,
                    start_new_session=True,
                    env=as_parent(os.environ),
                )
            try:
                ended = await self._wait(process, stop)
            finally:
                _kill(process)  # no run may outlive the wait
        except OSError as error:
            return MemberResult(self.member, Outcome.NOT_JUDGED, reason=f"it could not be started: {error}")
        return self._result(process.returncode, ended, time.monotonic() - started)

    def progress(self) -> str:
        """The progress, as `57/146 checks`; empty if unknown."""
        with contextlib.suppress(OSError), (self._folder / LOG_NAME).open("rb") as log:
            log.seek(max(0, log.seek(0, os.SEEK_END) - 1000))
            found = _PROGRESS.search(log.read())
            return f"{found[1].decode()} checks" if found else ""
        return ""

    def _prepare(self) -> None:
        own_folder(self._folder.parent)
        own_folder(self._folder)
        for pattern in _WRITTEN:
            for path in self._folder.glob(pattern):
                path.unlink()
        if self.member.statement is None:
            write_atomically(self._folder / "statement.toml", _statement(self.member))

    def _command(self) -> list[str]:
        statement = self.member.statement or self._folder / "statement.toml"
        command = [sys.executable, "-P", "-m", "roaas", "certify", str(statement), *self._options]
        baseline = ["--baseline", str(self.member.baseline)] if self.member.baseline else []
        return [*command, "--out", str(self._folder), *baseline]

    async def _wait(self, process: asyncio.subprocess.Process, stop: Stop) -> Outcome | None:
        """Wait for the process, at most until the time limit; return why it was ended, or None if it ended itself."""
        if await _first(process, stop.asked, self._limit_s):
            return None
        ended = Outcome.INTERRUPTED if stop.asked.is_set() else Outcome.GIVEN_UP
        with contextlib.suppress(ProcessLookupError):
            process.terminate()
        if not await _first(process, stop.insisted, _GRACE_S):
            _kill(process)
            await process.wait()
        return ended

    def _result(self, code: int | None, ended: Outcome | None, seconds: float) -> MemberResult:
        path = self._folder / RESULT_NAME
        document, digest = None, None
        with contextlib.suppress(OSError, ValueError):
            octets = path.read_bytes()
            document, digest = json.loads(octets), f"sha256:{hashlib.sha256(octets).hexdigest()}"
        outcome, reason = self._outcome(code, ended, document)
        return MemberResult(self.member, outcome, code, reason, seconds, document, digest)

    def _outcome(self, code: int | None, ended: Outcome | None, document: dict[str, Any] | None) -> tuple[Outcome, str]:
        """Return the outcome, and why there is no verdict."""
        if ended is not None:
            reason = f"given up after {self._limit_s:g} s, its time limit" if ended is Outcome.GIVEN_UP else ""
            return ended, reason
        if code == ExitCode.UNREACHABLE:
            return Outcome.UNREACHABLE, self._last_words()
        if code == ExitCode.INTERRUPTED:
            return Outcome.INTERRUPTED, "its process was interrupted"
        if document is not None and code in {ExitCode.PASSED, ExitCode.FAILED, ExitCode.INCONCLUSIVE}:
            return _OF_VERDICT[document["verdict"]], ""
        return Outcome.NOT_JUDGED, f"its process ended with {code}: {self._last_words()}"

    def _last_words(self) -> str:
        """Return the last output line that is neither progress nor a file name."""
        with contextlib.suppress(OSError):
            lines = (self._folder / LOG_NAME).read_text(encoding="utf-8", errors="replace").splitlines()
            said = [line for line in lines if line.strip() and not line.startswith(("[", "report: ", "result: "))]
            return said[-1].strip().removeprefix("error: ")[:_SHOWN] if said else "it said nothing"
        return "it left no log"


def _kill(process: asyncio.subprocess.Process) -> None:
    """Kill a running process and its children, by its process group."""
    if process.returncode is None:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)


async def _first(process: asyncio.subprocess.Process, event: asyncio.Event, most_s: float) -> bool:
    """Wait for the end of a process, an event or a timeout; return whether the process has ended."""
    ended, happened = asyncio.create_task(process.wait()), asyncio.create_task(event.wait())
    await asyncio.wait({ended, happened}, timeout=most_s, return_when=asyncio.FIRST_COMPLETED)
    happened.cancel()
    if not ended.done():
        ended.cancel()
        return False
    return True


def _statement(member: Member) -> str:
    """Return a statement (TOML) with the addresses from the fleet file."""
    endpoints = [
        f"{key} = {_toml(value)}" for key, value in asdict(member.endpoints).items() if value not in {None, ()}
    ]
    return "\n".join(["[robot]", f"name = {basic_string(member.name)}", "", "[endpoints]", *endpoints, ""])


def _toml(value: str | float | tuple[str, ...]) -> str:
    if isinstance(value, tuple):
        return f"[{', '.join(map(basic_string, value))}]"
    return basic_string(value) if isinstance(value, str) else str(value)
