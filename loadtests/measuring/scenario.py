"""Users of a scenario: an ordinary Locust file whose users' requests are recorded as any others.

The model is closed: a user waits for each response, and then as long as its `wait_time` says. So a robot that is slow
gets fewer requests. A request belongs to the block in which it starts.
"""

import logging
import sys
import traceback
from bisect import bisect_right
from hashlib import sha256
from pathlib import Path
from types import ModuleType
from typing import Any

import gevent
import locust
from gevent.event import Event
from gevent.pool import Group
from locust.exception import RescheduleTask
from locust.user.task import LOCUST_STATE_RUNNING, LOCUST_STATE_STOPPING

from loadtests.clients.robot import Robot
from loadtests.clients.scenario import Client, Routes, ScenarioError
from loadtests.clients.wire import now_ns
from loadtests.measuring.errors import GeneratorError
from loadtests.measuring.recording import AFTER_ERROR_S, NS, Recording
from loadtests.schedule.plan import Plan, rotation
from loadtests.settings.settings import Scenario

_PERCENT = 100
_LONGEST = 300  # characters of an exception that are shown


class RobotUser(locust.User):
    """A user of the robot. Derive your own from it, with tasks as in any Locust file.

    Attributes:
        client: sends the user's requests, over one connection.
    """

    abstract = True
    client: Client


def read(scenario: Scenario) -> list[type[RobotUser]]:
    """Return the classes of users that a scenario's file defines.

    Raises:
        GeneratorError: the file cannot be read or run, differs from the master's, or has no such class.
    """
    path, named = Path(scenario.file), f"--scenario {scenario.file!r}"
    module = ModuleType("scenario")
    sys.path.insert(0, str(path.resolve().parent))  # for modules beside it, as Locust does
    try:
        text = path.read_bytes()
        exec(compile(text, path, "exec"), vars(module))  # noqa: S102 -- the user's own file
    except (Exception, SystemExit) as error:  # noqa: BLE001 -- whatever it raises, its author has to hear of it
        raise GeneratorError(f"{named} cannot be used: {_error_text(error, path)}") from None
    if sha256(text).hexdigest() != scenario.sha256:
        raise GeneratorError(f"{named} differs from the master's: give each worker the same file")
    found = [type_ for type_ in vars(module).values() if isinstance(type_, type) and issubclass(type_, locust.User)]
    own = [one for one in found if one.__module__ == module.__name__ and not one.abstract]
    if wrong := next(filter(None, map(_wrong, own)), ""):
        raise GeneratorError(f"{named}: {wrong}")
    if not own:
        raise GeneratorError(f"{named} has no class of users: derive one from loadtests.scenario.RobotUser")
    return [one for one in own if issubclass(one, RobotUser)]


def _wrong(user: type[locust.User]) -> str:
    """Return why a class of users cannot be used; empty if it can."""
    if not issubclass(user, RobotUser):
        return f"{user.__name__} is not measured: derive it from loadtests.scenario.RobotUser"
    if not user.tasks:
        return f"{user.__name__} has no task: mark a method with @task"
    if user.fixed_count or user.weight <= 0:
        return f"{user.__name__}: fixed_count is not supported, and weight must be above 0"
    return ""


def _error_text(error: BaseException, path: Path) -> str:
    """Return an exception with the line of the scenario that it came from."""
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if Path(frame.filename) == path]
    line = f" ({path.name}, line {frames[-1].lineno})" if frames else ""
    kind = "" if isinstance(error, ScenarioError) else f"{type(error).__name__}: "
    return f"{kind}{str(error)[:_LONGEST]}{line}"


class ScenarioSession(Recording):
    """One process's users of a scenario.

    Args:
        environment: Locust's.
        robot: the robot, with the operations of its description.
        operations: those that may be called, in the order in which the plan numbers them.
        scenario: the file.
    """

    pacing = "the scenario's users"

    def __init__(self, environment: Any, robot: Robot, operations: tuple[str, ...], scenario: Scenario) -> None:
        super().__init__(environment, {name: robot.method(name) for name in operations}, robot.timeout_s)
        classes = read(scenario)
        self._turns = [
            classes[place]
            for place in rotation(range(len(classes)), [max(1, round(one.weight * _PERCENT)) for one in classes])
        ]
        self._file = Path(scenario.file)
        self._environment, self._robot = environment, robot
        self._routes = Routes(robot, operations)
        self._starts: list[int] = []
        self._end_ns = 0
        self._over = Event()
        self._over.set()
        self._users: dict[RobotUser, Any] = {}
        self._interval_ns = self._free_at = 0
        self.waiting = 0
        self.count = self.recorder.count
        self.record = self.recorder.record
        environment.events.user_error.add_listener(self._on_error)
        logging.getLogger("locust.user").setLevel(logging.CRITICAL)  # the result has what it would log

    def work(self) -> None:
        """Stand for a user in Locust's statistics: the scenario's users live as long as a plan does."""
        self.waiting += 1
        Event().wait()

    def run(self, plan: Plan, worker: int, origin_ns: int, ceiling: float | None = None) -> None:
        """Carry out a worker's share of a plan: start its users over the warm-up, and end them with the plan."""
        self.begin(plan, origin_ns)
        self._starts, self._end_ns = [segment.start_ns for segment in plan.segments], plan.segments[-1].end_ns
        self._interval_ns, self._free_at = int(NS / ceiling) if ceiling else 0, 0
        self._over.clear()
        wanted, group = plan.load.users or 0, Group()
        for number in range(worker, wanted, plan.workers):
            start_s = (origin_ns - now_ns()) / NS + plan.load.warmup_s * number / wanted
            user = self._turns[number % len(self._turns)]
            group.start(gevent.Greenlet(self._live, user, max(0.0, start_s)))
        for index, start in enumerate(self._starts):
            if not self._over.wait(max(0.0, (origin_ns + start - now_ns()) / NS)):
                self.between(index)
        self._over.wait(max(0.0, (origin_ns + self._end_ns - now_ns()) / NS))
        self.stop()
        self.look_at_processor(None)
        self._end(group)
        self.recorder.flush()

    def _live(self, kind: type[RobotUser], start_s: float) -> None:
        """Run one user until the plan is over. A user whose `on_start` got no response begins again."""
        self._over.wait(start_s)
        while not self._over.is_set():
            user = kind(self._environment)
            user.host, user.client = self._robot.rest, Client(self._robot, self._routes, self)
            self._users[user] = gevent.getcurrent()
            try:
                user.run()  # type: ignore[no-untyped-call] # Locust is typed in part
            except RescheduleTask:
                gevent.sleep(AFTER_ERROR_S)
                continue
            except Exception as error:  # noqa: BLE001 -- Locust has reported it, unless it came from on_stop
                self._on_error(user, error, error.__traceback__)
            finally:
                user.client.close()
                del self._users[user]
            return

    def _end(self, group: Group) -> None:
        """End the users as Locust does: those that wait at once, others after their task, or after a deadline."""
        for user, greenlet in list(self._users.items()):
            if user._state == LOCUST_STATE_RUNNING:  # noqa: SLF001 -- what User.stop does, for users of our own group
                user._state = LOCUST_STATE_STOPPING  # noqa: SLF001 -- as above
            else:
                greenlet.kill(block=False)
        if not group.join(self.timeout_s + 1):
            group.kill(timeout=self.timeout_s + 1)

    def _on_error(self, user_instance: Any, exception: BaseException, tb: Any) -> None:
        """Record an exception of the scenario, and end the plan."""
        del user_instance, tb
        if isinstance(exception, RescheduleTask):
            return
        self.recorder.fault(_error_text(exception, self._file))
        self.stop()

    def segment_at(self, moment_ns: int) -> int | None:
        """Return the number of the segment at a moment; None outside the plan."""
        at = moment_ns - self.origin_ns
        if not 0 <= at < self._end_ns or self._over.is_set():
            return None
        return self.first + bisect_right(self._starts, at) - 1

    def turn(self) -> None:
        """Wait until the next request may start, if the rate is limited."""
        if not self._interval_ns:
            return
        now = now_ns()
        mine = self._free_at = max(self._free_at + self._interval_ns, now)
        if mine > now:
            gevent.sleep((mine - now) / NS)

    def stop(self) -> None:
        """End the plan now; requests under way may finish."""
        self._over.set()

    def close(self) -> None:
        """Stop for good."""
        self.stop()
