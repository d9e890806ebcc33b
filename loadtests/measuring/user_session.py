"""One process's part in a run: its users, its pacer and its recorder, in the master's process or in a worker."""

import os
from collections.abc import Sequence
from typing import Any

import gevent

from loadtests.clients.callers import Caller, Workload
from loadtests.clients.library import Sent, read_document
from loadtests.clients.payloads import LIBRARY, VARIANTS
from loadtests.clients.robot import Robot
from loadtests.clients.wire import now_ns
from loadtests.measuring.machine import first_in_line, leaves_the_robot_room
from loadtests.measuring.scenario import AFTER_ERROR_S, NS, Recording, ScenarioSession
from loadtests.schedule.arrivals import Schedule
from loadtests.schedule.pacer import Arrival, Pacer
from loadtests.schedule.plan import BOTH, Plan
from loadtests.settings.settings import Scenario

_SIDES = ("rest", "soap")


class _Sink:
    """Where callers record: the recorder, with the run's clock for failures, and Locust's statistics."""

    def __init__(self, session: "Session") -> None:
        self.record = session.recorder.record
        self.count = session.recorder.count
        self.failed = session.failed


class Session(Recording):
    """One process's users, pacer and recorder.

    `robots` are numbered as in segments: the one under load, and the one that it is compared with.
    """

    def __init__(
        self, environment: Any, robots: Sequence[Robot], operations: tuple[str, ...], seed: int, *, library: bool
    ) -> None:
        timeout_s = max(robot.timeout_s for robot in robots)
        super().__init__(environment, {name: robots[0].method(name) for name in operations}, timeout_s)
        self._callers: list[Caller] = []
        self._sent = Sent()
        self._workloads = [
            Workload(robot, operations, seed, _documents(robot, operations) if library else {}, self._sent)
            for robot in robots
        ]
        self.pacer = Pacer(int(timeout_s * NS), self.between, self._drop)
        self.pacing = self.pacer.pacing

    @property
    def waiting(self) -> int:
        """Return how many users are ready."""
        return self.pacer.waiting

    def work(self) -> None:
        """Take a request, send it, and take the next, until killed: the loop of one user."""
        callers = [Caller(workload, _Sink(self)) for workload in self._workloads]
        self._callers += callers
        performs, take, segments = [caller.perform for caller in callers], self.pacer.take, self.segments
        try:
            while True:
                arrival = take()
                number = arrival.segment + self.first
                segment = segments[number]
                self.busy += 1
                try:
                    succeeded = performs[segment.robot](
                        number,
                        segment.interface if segment.interface != BOTH else _SIDES[arrival.payload % 2],
                        segment.client,
                        arrival.operation,
                        arrival.payload % VARIANTS,
                        arrival.due_ns,
                        noticed=arrival.noticed_ns,
                    )
                finally:
                    self.busy -= 1
                if not succeeded and not self.pacer.open_model:
                    gevent.sleep(AFTER_ERROR_S)
        finally:
            for caller in callers:
                caller.close()
                self._callers.remove(caller)

    def run(self, plan: Plan, worker: int, origin_ns: int, ceiling: float | None = None) -> None:
        """Carry out a worker's share of a plan, whose times count from `origin_ns` (monotonic).

        Returns when the last response has come, or `stop` was called. In the closed model `ceiling` limits the requests
        per second of this process.
        """
        self.begin(plan, origin_ns)
        if plan.repeat and plan.step_rate is None:
            for caller in self._callers:
                caller.close()
        self._sent.requests = self._sent.calls = 0
        schedule = Schedule(plan, worker, plan.workers)
        with first_in_line(wanted=leaves_the_robot_room(plan, os.cpu_count() or 1)) as real_time:
            self.recorder.count("real time", int(real_time))
            self.pacer.start(
                schedule, origin_ns, open_model=plan.open_model, interval_ns=int(NS / ceiling) if ceiling else 0
            )
            self.pacer.done.wait()
        self.look_at_processor(None)
        self.wait_for_answers()
        self.pacer.give_up()  # arrivals that are late by a whole deadline are not started any more
        self.wait_for_answers()
        self.recorder.flush()
        self.recorder.count("resends", self._sent.resends)

    def stop(self) -> None:
        """End the plan now; requests under way may finish."""
        self.pacer.stop()

    def _drop(self, arrival: Arrival) -> None:
        self.recorder.drop(arrival.segment + self.first, arrival.operation, now_ns() - arrival.due_ns)

    def close(self) -> None:
        """Stop for good."""
        self.pacer.close()


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


def new_session(
    environment: Any,
    robots: Sequence[Robot],
    operations: tuple[str, ...],
    seed: int,
    *,
    library: bool,
    scenario: Scenario | None,
) -> Session | ScenarioSession:
    """Return a process's users; the arguments are those of `Session` and `ScenarioSession`.

    Raises:
        GeneratorError: the scenario cannot be used.
    """
    if scenario is None:
        return Session(environment, robots, operations, seed, library=library)
    return ScenarioSession(environment, robots[0], operations, scenario)
