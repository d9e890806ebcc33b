"""Generate the load: in this process, or with workers that a Locust master leads.

Both carry out plans one after the other and end up with one recorder. Workers rebuild the plan from a message, take
their share of its schedule, and report their records once a second. When a worker is lost, its unreported records are
lost too, and the result says so.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import gevent
from locust import User, task
from locust.env import Environment
from locust.event import Events

from loadtests.clients.payloads import LIBRARY
from loadtests.clients.robot import Robot
from loadtests.clients.wire import now_ns
from loadtests.measuring.clocks import WorkerClock
from loadtests.measuring.errors import GeneratorError
from loadtests.measuring.scenario import ScenarioSession
from loadtests.measuring.user_session import Session, new_session
from loadtests.schedule.plan import Plan
from loadtests.settings.settings import Scenario
from loadtests.statistics.recorder import Recorder

_NS = 1_000_000_000
LEAD_S = 0.3  # from the message to the plan's beginning
REPORT_S = 1.0  # how often workers report


class RobotUser(User):
    """A user that takes requests from its process's pacer and sends them."""

    @task
    def work(self) -> None:
        """Send the requests that the pacer hands out, until Locust kills this user."""
        self.environment.roaas_session.work()


@dataclass(slots=True)
class Member:
    """A process that generates load, as the result describes it.

    Attributes:
        state: `finished`, `lost`, or `late`: joined after the schedule was distributed.
        accounted: arrivals of the current plan in its reports.
        share: its arrivals in the plan in which it was lost; None if it was not lost, or the model is closed.
        clock: None in the master's own process.
    """

    id: str
    host: str = ""
    pid: int = 0
    state: str = "finished"
    requests: int = 0
    cpu_share: float | None = None
    lost_at_s: float | None = None
    last_report_s: float | None = None
    joined_at_s: float | None = None
    accounted: int = 0
    share: int | None = None
    clock: WorkerClock | None = None
    done: bool = True


def new_environment() -> Any:
    """Return Locust's environment with our user."""
    return Environment(user_classes=[RobotUser], events=Events(), stop_timeout=0)


def busiest(members: list[Member]) -> float | None:
    """Return the busiest process's share of a core in the last plan."""
    return max((member.cpu_share for member in members if member.cpu_share is not None), default=None)


class LocalExecutor:
    """Generates the load in this process alone."""

    def __init__(self) -> None:
        self.environment = new_environment()
        self.runner = self.environment.create_local_runner()
        self.recorder = Recorder()
        self.members = [Member("1", host="localhost")]
        self.pacing = ""
        self._session: Session | ScenarioSession | None = None

    def prepare(self, robots: Sequence[Robot], plan: Plan, scenario: Scenario | None = None) -> None:
        """Build the clients and start the users.

        Raises:
            GeneratorError: the scenario cannot be used, or the users do not start.
        """
        library = LIBRARY in plan.clients
        session = new_session(
            self.environment, robots, plan.operations, plan.load.seed, library=library, scenario=scenario
        )
        self._session = self.environment.roaas_session = session
        self.recorder, self.pacing = session.recorder, session.pacing
        users = plan.connections
        self.runner.start(users, spawn_rate=users)
        with gevent.Timeout(30, GeneratorError(f"only {session.waiting} of {users} users started within 30 s")):
            while session.waiting < users:
                gevent.sleep(0.01)

    def run(self, plan: Plan, ceiling: float | None, watch: Callable[[float], bool]) -> None:
        """Carry out a plan; `watch` receives the seconds since its start, and ends the plan by returning True."""
        session = self._session
        if session is None:
            raise GeneratorError("run before prepare")
        origin = now_ns() + int(LEAD_S * _NS)
        work = gevent.spawn(session.run, plan, 0, origin, ceiling)
        try:
            while not work.ready():
                work.join(0.1)
                if watch((now_ns() - origin) / _NS):
                    session.stop()
            work.get()
        finally:
            session.stop()
            work.join()
            member = self.members[0]
            member.cpu_share = session.cpu_share
            member.last_report_s = (now_ns() - origin) / _NS
            cells = self.recorder.cells.values()
            member.requests = sum(cell.service.total + cell.errors for cell in cells)

    def close(self) -> None:
        """Stop the users."""
        if self._session is not None:
            self._session.close()
        self.runner.quit()
