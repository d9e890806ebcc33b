"""Run the certifications of a fleet concurrently; the content of fleet.json (roaas-fleet/1), and the exit code."""

import asyncio
import contextlib
import datetime as dt
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, TextIO

from conformance.commandline.endings import ending_signals
from conformance.commandline.exit_codes import ExitCode
from conformance.commandline.help_pages import inert
from conformance.commandline.out_folder import write_json
from conformance.engine.result import rfc3339
from conformance.engine.suite import suite_version
from conformance.fleet.member_run import EXIT_CODES, MemberResult, MemberRun, Outcome, Stop

# How often progress says which robots are being judged, s.
_OFTEN_S = 10.0


class FleetRun:
    """The certifications of a fleet.

    Args:
        runs: one for each robot.
        parallel: maximum number at once.
        out: stream for progress, or None.
        keep: called with all results so far, in the fleet's order, whenever a run ends.
    """

    def __init__(
        self, runs: Sequence[MemberRun], parallel: int, out: TextIO | None, keep: Callable[[list[MemberResult]], None]
    ) -> None:
        self._runs, self._out, self._keep = runs, out, keep
        self._free = asyncio.Semaphore(parallel)
        self._stop = Stop()
        self._started = time.monotonic()
        self._under_way: dict[str, MemberRun] = {}
        self._results = {run.member.name: MemberResult(run.member, Outcome.NOT_STARTED) for run in runs}
        self._done = 0

    @property
    def was_interrupted(self) -> bool:
        """Whether a signal interrupted the fleet."""
        return self._stop.asked.is_set()

    async def judge(self) -> list[MemberResult]:
        """Certify all robots; return their results in the fleet's order."""
        with self._signals():
            telling = asyncio.create_task(self._tell_often())
            try:
                await asyncio.gather(*(self._judge(run) for run in self._runs))
            finally:
                telling.cancel()
        return list(self._results.values())

    async def _judge(self, run: MemberRun) -> None:
        async with self._free:
            if self._stop.asked.is_set():
                return
            name = run.member.name
            self._under_way[name] = run
            self._tell(f"{name}: started")
            try:
                result = await run.judge(self._stop)
            except Exception as error:  # noqa: BLE001 - whatever breaks is this robot's end, and none of the others'
                result = MemberResult(run.member, Outcome.NOT_JUDGED, reason=f"{type(error).__name__}: {error}")
            del self._under_way[name]
            self._results[name] = result
            self._done += 1
            reason = f": {result.reason}" if result.reason else ""
            self._tell(f"{name}: {result.outcome}{reason} ({result.seconds:.1f} s)")
            self._keep(list(self._results.values()))

    @contextlib.contextmanager
    def _signals(self) -> Iterator[None]:
        """End the runs on a signal that would end the process; a second signal kills them."""
        loop = asyncio.get_running_loop()

        def stop() -> None:
            self._tell("ending; a second Ctrl-C kills" if not self._stop.asked.is_set() else "killing what still runs")
            self._stop.ask()

        numbers = ending_signals()
        for number in numbers:
            loop.add_signal_handler(number, stop)
        try:
            yield
        finally:
            for number in numbers:
                loop.remove_signal_handler(number)

    async def _tell_often(self) -> None:
        while True:
            await asyncio.sleep(_OFTEN_S)
            running = (f"{name} {run.progress()}".strip() for name, run in self._under_way.items())
            self._tell(f"under way: {', '.join(running)}")

    def _tell(self, text: str) -> None:
        if self._out is not None:
            spent = time.monotonic() - self._started
            # A robot's last line of progress is foreign text.
            self._out.write(f"[{spent:5.1f} s] {self._done}/{len(self._runs)} judged | {inert(text)}\n")
            self._out.flush()


FLEET_FORMAT = "roaas-fleet/1"
FLEET_NAME = "fleet.json"
ROBOTS_FOLDER = "robots"


def exit_code(results: Sequence[MemberResult], *, interrupted: bool) -> ExitCode:
    """Return 130 if the fleet was interrupted, otherwise the lowest exit code of its robots that is not 0.

    So a robot that does not conform (1) outranks one with a usage error (2), one that was not reached (3), and an
    inconclusive one (4).
    """
    if interrupted:
        return ExitCode.INTERRUPTED
    return min((code for result in results if (code := _code(result)) != ExitCode.PASSED), default=ExitCode.PASSED)


def _code(result: MemberResult) -> ExitCode:
    if result.exit_code == ExitCode.PASSED:  # also where a baseline accepts each failure
        return ExitCode.PASSED
    if result.outcome is Outcome.CONFORMANT and "stop_undelivered" in (result.document or {}):
        return ExitCode.INCONCLUSIVE
    return EXIT_CODES[result.outcome]


def fleet_document(
    results: Sequence[MemberResult], *, started: dt.datetime, finished: dt.datetime, parallel: int, interrupted: bool
) -> dict[str, Any]:
    """Return the content of fleet.json."""
    titles = {
        name: title
        for member_result in results
        for name, title in (member_result.document or {}).get("class_titles", {}).items()
    }
    return {
        "format": FLEET_FORMAT,
        "suite": {"version": suite_version()},
        "started": rfc3339(started),
        "finished": rfc3339(finished),
        "duration_s": round((finished - started).total_seconds(), 3),
        "parallel": parallel,
        "interrupted": interrupted,
        "exit_code": int(exit_code(results, interrupted=interrupted)),
        "outcomes": dict(Counter(str(result.outcome) for result in results)),
        "class_titles": titles,
        "robots": [_robot(result) for result in results],
    }


def write_fleet(document: dict[str, Any], directory: Path) -> Path:
    """Write fleet.json atomically; return its path.

    Raises:
        OSError: the file cannot be written.
    """
    directory.mkdir(parents=True, exist_ok=True)
    return write_json(directory / FLEET_NAME, document, indent=1, ensure_ascii=False)


def _robot(result: MemberResult) -> dict[str, Any]:
    document = result.document
    told: dict[str, Any] = {
        "name": result.member.name,
        "folder": f"{ROBOTS_FOLDER}/{result.member.name}",
        "outcome": str(result.outcome),
        "exit_code": result.exit_code,
        "reason": result.reason,
        "seconds": round(result.seconds, 3),
        "trusted": result.trusted_classes,
        "result": result.digest,
    }
    if document is not None:
        told |= {
            "robot": document["statement"]["robot"],
            "finished": document["finished"],
            "effort": document["effort"],
            "motion_allowed": document["statement"]["motion_allowed"],
            "requirement_set": document["requirement_set"],
            "classes": document["classes"],
            "accepted_until": document.get("accepted_until"),
            **({"stop_undelivered": document["stop_undelivered"]} if "stop_undelivered" in document else {}),
        }
    return told
