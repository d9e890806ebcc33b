"""Users of a scenario: an ordinary Locust file whose users' requests are recorded as any others.

The model is closed: a user waits for each response, and then as long as its `wait_time` says. So a robot that is slow
gets fewer requests. A request belongs to the block in which it starts.
"""

import gc
import logging
import sys
import time
import traceback
from bisect import bisect_right
from collections.abc import Callable, Mapping
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

from loadtests.clients.failures import CallError
from loadtests.clients.robot import Robot
from loadtests.clients.scenario import Client, Routes, ScenarioError
from loadtests.clients.wire import now_ns
from loadtests.measuring.errors import GeneratorError
from loadtests.schedule.plan import SERIES, Plan, Segment, rotation
from loadtests.settings.settings import Scenario
from loadtests.statistics.histogram import Histogram, edges_us
from loadtests.statistics.recorder import Recorder

NS = 1_000_000_000
_FLUSH_S = 1.0
AFTER_ERROR_S = 0.02  # closed model: users of a dead robot would spin on refused connections


class LocustFeed:
    """Copies our requests into a Locust environment's statistics, for its web UI.

    Locust itself rounds to milliseconds, and its request event costs some 8 us. Here whole buffers of successful
    requests go in at once, with the histogram's microseconds as keys. Failures, which are rare, go through the event,
    where other listeners expect them.

    Args:
        environment: Locust's.
        methods: the HTTP method over REST of each operation, in the plan's order.
    """

    def __init__(self, environment: Any, methods: Mapping[str, str]) -> None:
        self._environment = environment
        self._methods = methods
        self._operations = tuple(methods)

    def _entry(self, series: int, operation: int) -> tuple[str, str]:
        """Return the method and the name under which Locust shows a series."""
        _, interface, client = SERIES[series]
        name = self._operations[operation]
        method = self._methods[name] if interface == "rest" else interface.upper()
        return method, f"{name} {interface} {client}"

    def succeeded(self, series: int, operation: int, response: Histogram) -> None:
        """Add successful requests' response times."""
        if series < 0 or SERIES[series][0] == "warmup":
            return
        method, name = self._entry(series, operation)
        stats = self._environment.stats
        bins, counts = response.arrays()
        lower, _ = edges_us(bins)
        times = dict(zip((lower / 1e3).tolist(), counts.tolist(), strict=True))
        now = time.time()
        for entry in (stats.get(name, method), stats.total):
            if entry.use_response_times_cache and int(now) > int(entry.last_request_timestamp or now):
                entry._cache_response_times(int(now) - 1)  # noqa: SLF001 -- what StatsEntry.log does each second
            entry.num_requests += response.total
            entry.total_response_time += response.sum_ns / 1e6
            entry.min_response_time = min(response.lowest_ns / 1e6, entry.min_response_time or float("inf"))
            entry.max_response_time = max(response.highest_ns / 1e6, entry.max_response_time)
            entry.last_request_timestamp = now
            entry.num_reqs_per_sec[int(now)] += response.total
            for time_ms, count in times.items():
                entry.response_times[time_ms] += count

    def failed(self, series: int, operation: int, error: CallError) -> None:
        """Report a failed request."""
        if series >= 0:
            method, name = self._entry(series, operation)
            self._environment.events.request.fire(
                request_type=method, name=name, response_time=0, response_length=0, exception=error, context={}
            )


class Recording:
    """The records of one process over its plans.

    Args:
        environment: Locust's.
        methods: the HTTP method of each operation, in the plan's order.
        timeout_s: deadline of a request.

    Attributes:
        busy: how many requests are under way.
        cpu_share: share of a core that this process used in the measured part of the plan.
        after_segment: called in the gap after each segment.
    """

    def __init__(self, environment: Any, methods: Mapping[str, str], timeout_s: float) -> None:
        self.series_of: dict[int, int] = {}
        self.segments: dict[int, Segment] = {}
        self.feed = LocustFeed(environment, methods)
        self.recorder = Recorder(self.series_of, self.feed.succeeded)
        self.origin_ns = self.offset_ns = self.first = self.busy = 0
        self.cpu_share: float | None = None
        self.after_segment: Callable[[], None] | None = None
        self.timeout_s = timeout_s
        self._flushed = 0.0
        self._cpu: list[tuple[float, float]] = []
        self._block: tuple[int, float, float] | None = None

    def begin(self, plan: Plan, origin_ns: int) -> None:
        """Begin a plan, whose times count from `origin_ns` (monotonic)."""
        self.first = plan.first_segment
        self.series_of.update(plan.series_of())
        self.segments.update({plan.first_segment + index: segment for index, segment in enumerate(plan.segments)})
        self.origin_ns, self.offset_ns = origin_ns, int(plan.offset_s * NS)
        since_s, until_s = plan.measured_s
        measured = plan.first_segment + sum(segment.phase == "warmup" for segment in plan.segments)
        window = plan.first_segment, origin_ns + int(since_s * NS), origin_ns + int(until_s * NS), measured
        self.recorder.window = window
        self._cpu, self._block = [], None
        gc.collect()
        gc.freeze()  # what exists now lives on: a collection in mid-run would look like a stall of the robot

    def failed(
        self, segment: int, operation: int, error: CallError, due_ns: int, start_ns: int, until_ns: int | None = None
    ) -> None:
        """Record a failed request that was given up at `until_ns` (default: now), by the run's clock."""
        until = now_ns() if until_ns is None else until_ns
        self.recorder.fail(
            segment,
            operation,
            error.kind,
            str(error),
            due_ns - self.origin_ns + self.offset_ns,
            (until - start_ns, until - due_ns),
        )
        self.feed.failed(self.series_of.get(segment, -1), operation, error)

    def between(self, index: int) -> None:
        """In the gap before a segment, sort the recorded times into bins and read the processor time."""
        number = index + self.first
        now = self.look_at_processor(number)
        segment = self.segments[number]
        if segment.gap or now[0] - self._flushed > _FLUSH_S:  # without a gap it delays what is due
            self.recorder.flush()
            self._flushed = now[0]
        if self._cpu and segment.phase != "warmup":
            spent = now[1] - self._cpu[0][1]
            elapsed = now[0] - self._cpu[0][0]
            if elapsed > 0:
                self.cpu_share = min(1.0, spent / elapsed)
        elif segment.phase != "warmup":
            self._cpu = [now]
        if self.after_segment is not None:
            self.after_segment()

    def look_at_processor(self, following: int | None) -> tuple[float, float]:
        """Record the share of a core that the last segment used, in the gap before segment `following`, if any."""
        now = (time.monotonic(), time.process_time())
        if self._block is not None and now[0] > self._block[1]:
            segment, began, spent = self._block
            self.recorder.was_busy(segment, min(1.0, (now[1] - spent) / (now[0] - began)))
        self._block = None if following is None else (following, *now)
        return now

    def wait_for_answers(self) -> None:
        """Wait until no request is under way; each has its own deadline."""
        with gevent.Timeout(self.timeout_s + 1, exception=False):
            while self.busy:
                gevent.sleep(0.01)


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
        operations: operations that may be called, in the order in which the plan numbers them.
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
