"""Run the certifications of a fleet concurrently. Ctrl-C ends all of them and keeps their results."""

import asyncio
import contextlib
import time
from collections.abc import Callable, Iterator, Sequence
from typing import TextIO

from conformance.commandline.endings import ending_signals
from conformance.commandline.help_pages import inert
from conformance.fleet.member_run import MemberResult, MemberRun, Outcome, Stop

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
