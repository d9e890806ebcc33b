"""One process's part in a run: its users, its pacer and its recorder, in the master's process or in a worker."""

import gc
import os
import time
from collections.abc import Callable, Sequence
from typing import Any

import gevent

from loadtests.clients.callers import Caller, Workload
from loadtests.clients.failures import CallError
from loadtests.clients.library import LIBRARY, Sent, read_document
from loadtests.clients.payloads import VARIANTS
from loadtests.clients.robot import Robot
from loadtests.clients.wire import now_ns
from loadtests.measuring.locust_feed import LocustFeed
from loadtests.measuring.priority import first_in_line, leaves_the_robot_room
from loadtests.schedule.arrivals import Schedule
from loadtests.schedule.pacer import Arrival, Pacer
from loadtests.schedule.plan import BOTH, Plan, Segment
from loadtests.statistics.recorder import Recorder

_NS = 1_000_000_000
_SIDES = ("rest", "soap")
_AFTER_ERROR_S = 0.02  # closed model: users of a dead robot would spin on refused connections


class _Sink:
    """Where callers record: the recorder, with the run's clock for failures, and Locust's statistics."""

    def __init__(self, session: "Session") -> None:
        self._session = session
        self.record = session.recorder.record
        self.count = session.recorder.count

    def failed(self, segment: int, operation: int, error: CallError, due_ns: int, start_ns: int) -> None:
        session = self._session
        now = now_ns()
        session.recorder.fail(
            segment,
            operation,
            error.kind,
            str(error),
            due_ns - session.origin_ns + session.offset_ns,
            (now - start_ns, now - due_ns),
        )
        session.feed.failed(session.series_of.get(segment, -1), operation, error)


class Session:
    """One process's users, pacer and recorder.

    `robots` are numbered as in segments: the one under load, and the one that it is compared with.
    """

    def __init__(
        self, environment: Any, robots: Sequence[Robot], operations: tuple[str, ...], seed: int, *, library: bool
    ) -> None:
        self._timeout_s = max(robot.timeout_s for robot in robots)
        self.series_of: dict[int, int] = {}
        self.segments: dict[int, Segment] = {}
        self.feed = LocustFeed(environment, {name: robots[0].method(name) for name in operations})
        self.recorder = Recorder(self.series_of, self.feed.succeeded)
        self.origin_ns = self.offset_ns = 0
        self.cpu_share: float | None = None
        self._first = 0
        self._busy = 0
        self._cpu: list[tuple[float, float]] = []
        self._block: tuple[int, float, float] | None = None
        self._callers: list[Caller] = []
        self._sent = Sent()
        self._workloads = [
            Workload(robot, operations, seed, _documents(robot, operations) if library else {}, self._sent)
            for robot in robots
        ]
        self.pacer = Pacer(int(self._timeout_s * _NS), self._between, self._dropped)
        self.after_segment: Callable[[], None] | None = None

    def work(self) -> None:
        """Take a request, send it, and take the next, until killed: the loop of one user."""
        callers = [Caller(workload, _Sink(self)) for workload in self._workloads]
        self._callers += callers
        performs, take, segments = [caller.perform for caller in callers], self.pacer.take, self.segments
        try:
            while True:
                arrival = take()
                number = arrival.segment + self._first
                segment = segments[number]
                self._busy += 1
                try:
                    succeeded = performs[segment.robot](
                        number,
                        segment.interface if segment.interface != BOTH else _SIDES[arrival.payload % 2],
                        segment.client,
                        arrival.operation,
                        arrival.payload % VARIANTS,
                        arrival.due_ns,
                        queued=arrival.queued,
                    )
                finally:
                    self._busy -= 1
                if not succeeded and not self.pacer.open_model:
                    gevent.sleep(_AFTER_ERROR_S)
        finally:
            for caller in callers:
                caller.close()
                self._callers.remove(caller)

    def run(self, plan: Plan, worker: int, origin_ns: int, ceiling: float | None = None) -> None:
        """Carry out a worker's share of a plan, whose times count from `origin_ns` (monotonic).

        Returns when the last response has come, or `stop` was called. In the closed model `ceiling` limits the requests
        per second of this process.
        """
        self._first = plan.first_segment
        self.series_of.update(plan.series_of())
        self.segments.update({plan.first_segment + index: segment for index, segment in enumerate(plan.segments)})
        self.origin_ns, self.offset_ns = origin_ns, int(plan.offset_s * _NS)
        if plan.repeat and plan.step_rate is None:
            for caller in self._callers:
                caller.close()
        self._cpu, self._block = [], None
        self._sent.requests = self._sent.calls = 0
        gc.collect()
        gc.freeze()  # what exists now lives on: a collection in mid-run would look like a stall of the robot
        schedule = Schedule(plan, worker, plan.workers)
        with first_in_line(wanted=leaves_the_robot_room(plan, os.cpu_count() or 1)) as real_time:
            self.recorder.count("real time", int(real_time))
            self.pacer.start(
                schedule, origin_ns, open_model=plan.open_model, interval_ns=int(_NS / ceiling) if ceiling else 0
            )
            self.pacer.done.wait()
        self._look_at_processor(None)
        self._wait_for_answers()
        self.pacer.give_up()  # arrivals that are late by a whole deadline are not started any more
        self._wait_for_answers()
        self.recorder.flush()
        self.recorder.count("resends", self._sent.resends)

    def _wait_for_answers(self) -> None:
        """Wait until no request is under way; each has its own deadline."""
        with gevent.Timeout(self._timeout_s + 1, exception=False):
            while self._busy:
                gevent.sleep(0.01)

    def stop(self) -> None:
        """End the plan now; requests under way may finish."""
        self.pacer.stop()

    def _dropped(self, arrival: Arrival) -> None:
        self.recorder.drop(arrival.segment + self._first, arrival.operation, now_ns() - arrival.due_ns)

    def _between(self, index: int) -> None:
        """In the gap before a segment, sort the recorded times into bins and read the processor time."""
        number = index + self._first
        now = self._look_at_processor(number)
        self.recorder.flush()
        segment = self.segments[number]
        if self._cpu and segment.phase != "warmup":
            spent = now[1] - self._cpu[0][1]
            elapsed = now[0] - self._cpu[0][0]
            if elapsed > 0:
                self.cpu_share = min(1.0, spent / elapsed)
        elif segment.phase != "warmup":
            self._cpu = [now]
        if self.after_segment is not None:
            self.after_segment()

    def _look_at_processor(self, following: int | None) -> tuple[float, float]:
        """Record the share of a core that the last segment used, in the gap before segment `following`, if any."""
        now = (time.monotonic(), time.process_time())
        if self._block is not None and now[0] > self._block[1]:
            segment, began, spent = self._block
            self.recorder.was_busy(segment, min(1.0, (now[1] - spent) / (now[0] - began)))
        self._block = None if following is None else (following, *now)
        return now


def _documents(robot: Robot, operations: tuple[str, ...]) -> dict[str, Any]:
    """Return the parsed WSDL of each operation that zeep can call; each WSDL is read once."""
    parsed: dict[str, Any] = {}
    documents: dict[str, Any] = {}
    for name in operations:
        wsdl = robot.wsdl(name)
        if wsdl is not None and robot.offers("soap", LIBRARY, name):
            parsed[wsdl] = parsed.get(wsdl) or read_document(wsdl, robot)
            documents[name] = parsed[wsdl]
    return documents
