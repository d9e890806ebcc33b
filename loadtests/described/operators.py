"""Several operators at one device: all read its state, and one drives it and stops it by the motion map.

They notice how late a stop takes effect while the others read. Rounds with one operator and with all of them alternate,
so that other load on the machine affects both alike.
"""

import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median
from typing import Any, Final, Self

import click
import msgspec

from conformance.api.rest.guard import Guard
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.stops import stop_device
from conformance.contract.pack import Contract
from conformance.measures.samples import FARTHEST
from conformance.scenarios.motion.binding import binding_of
from conformance.scenarios.motion.driving import with_room
from conformance.scenarios.motion.mapped import STAYS_S, MappedDevice
from conformance.scenarios.motion.trace import Command, Reading
from conformance.scenarios.scenario import NotPossibleError
from conformance.statement.motion_map import MotionMap
from conformance.statement.statement import empty_statement
from conformance.transport.client import Connection, HttpClient
from conformance.transport.exchange import NoAnswerError, NotPermittedError
from conformance.verdict.run import Run
from loadtests.clients.failures import CallError
from loadtests.clients.robot import Robot
from loadtests.described.device import Device
from loadtests.settings.settings import SettingsError
from loadtests.statistics.figures import plain_quantiles, rounded
from loadtests.statistics.histogram import Histogram

_ROUNDS: Final = 6  # of each number of operators
_SHARE: Final = 0.5  # of the greatest velocity
_DRIVES_S: Final = 0.3  # seconds beyond the time to reach the velocity
_READS_S: Final = 0.05  # seconds between two reads of each other operator, or longer with a limit on the rate
_RESTS_S: Final = 5.0  # a device that moves for longer after a stop is not waited for
_STILL: Final = 0.1  # tolerances from its last position beyond which a device still moves


@dataclass
class Stops:
    """The outcomes of the stops beside a number of operators.

    Attributes:
        answer_s, rest_s: from the request until its response, and until the device rested.
        error_s: how exactly that is known: half of the time between two readings.
        late: stops after which the device moved for longer than the map says.
        reads: response times of the others' readings; failed: their requests without a good response.
    """

    operators: int
    answer_s: list[float] = field(default_factory=list)
    rest_s: list[float] = field(default_factory=list)
    error_s: list[float] = field(default_factory=list)
    late: int = 0
    reads: Histogram = field(default_factory=Histogram)
    failed: int = 0

    def as_message(self) -> dict[str, Any]:
        """Return an entry of `operators.by_number` in latency.json."""
        return {
            "operators": self.operators,
            "stops": len(self.rest_s),
            "answer_ms": _of(self.answer_s),
            "rest_ms": _of(self.rest_s),
            "known_to_ms": rounded(max(self.error_s, default=0.0) * 1e3),
            "late": self.late,
            "reads": self.reads.total,
            "reads_failed": self.failed,
            "read_ms": plain_quantiles(self.reads),
        }


def _of(seconds: Sequence[float]) -> dict[str, float | None]:
    return {
        "p50": rounded(median(seconds) * 1e3) if seconds else None,
        "max": rounded(max(seconds) * 1e3) if seconds else None,
    }


def stops_beside(device: Device, motion: MotionMap, operators: int) -> dict[str, Any]:
    """Drive and stop a device by its map beside other operators; return the `operators` of latency.json.

    The device is left as it is after the last stop. What goes wrong is in `error`.
    """
    found = {number: Stops(number) for number in (1, operators)}
    error = None
    try:
        mapped = MappedDevice(device.api, motion, binding=binding_of(device.api))
        for turn in range(_ROUNDS):
            for number in (1, operators) if turn % 2 else (operators, 1):
                _round(mapped, motion, found[number])
    except NoAnswerError as none:
        error = f"there was no response: {none}"
    except (NotPossibleError, NotPermittedError) as reason:
        error = str(reason)
    return {
        "promised_ms": rounded(motion.stop.rests_within_s * 1e3) if motion.stop else None,
        "by_number": [each.as_message() for each in found.values()],
        "error": error,
    }


def _round(mapped: MappedDevice, motion: MotionMap, stops: Stops) -> None:
    """Drive, stop, and see when the device rests.

    Raises:
        NotPossibleError: there is no room, the device does not move, or a command is refused.
        NoAnswerError: there is no response.
    """
    drives = mapped.drives
    name = next(name for name, speed in drives.axes.items() if speed.limits[1] > 0)
    lasts_s = drives.settle_s + _DRIVES_S
    rests_s = motion.stop.rests_within_s if motion.stop else drives.settle_s
    (speeds,) = with_room(mapped, [{name: _SHARE * drives.axes[name].limits[1]}], lasts_s + rests_s)
    with _others(mapped, stops):
        command, before = mapped.drive(speeds), list[Reading]()
        until = command.answered + lasts_s
        while command.is_ok and mapped.clock.now() < until and not mapped.room.is_over([speeds], before, rests_s):
            before.append(mapped.read())
            command = mapped.drive(speeds) if drives.hold_s else command
        if not command.is_ok:
            raise NotPossibleError(f"a velocity was answered {command.exchange.came}")
        stop = mapped.stop()
        if stop is None or not stop.is_ok:
            raise NotPossibleError(f"the stop got {stop.exchange.came if stop else 'no id to name'}")
        after = mapped.watch(stop.sent + _RESTS_S, lambda seen: _still(mapped, seen))
    if not _moving(mapped, [*before, *after]):
        raise NotPossibleError(f"{motion.state.read} does not show that {name} moves")
    _note(mapped, stops, stop, after, rests_s)


def _note(mapped: MappedDevice, stops: Stops, stop: Command, after: Sequence[Reading], rests_s: float) -> None:
    """Note when the device rested: between the last reading in which it still moved and the next one."""
    places = _moving(mapped, after)
    last = after[places[-1]] if places else None
    begin = stop.sent if last is None else (last.sent + last.received) / 2
    following = after[min(places[-1] + 1 if places else 0, len(after) - 1)]
    end = max(begin, (following.sent + following.received) / 2)
    stops.answer_s.append(stop.answered - stop.sent)
    stops.rest_s.append((begin + end) / 2 - stop.sent)
    stops.error_s.append((end - begin) / 2)
    # The measuring client may be late too, so a reading counts if it was requested after the time was over.
    stops.late += last is not None and last.sent - stop.answered > rests_s


def _moving(mapped: MappedDevice, readings: Sequence[Reading]) -> list[int]:
    """Return the places of the readings in which the device is not yet where it is in the last, or has a velocity."""
    axes, ends = mapped.motion.state.axes, [one.values for one in readings if one.values][-1:]
    found = []
    for place, reading in enumerate(readings):
        away = any(
            abs(axes[name].apart(value, ends[0][name]))
            > _STILL * mapped.motion.tolerance(name) + FARTHEST * mapped.resting.axes[name].sigma
            for name, value in reading.values.items()
        )
        quick = any(abs(speed) > mapped.motion.speed_tolerance(name) for name, speed in reading.speeds.items())
        if away or quick:
            found.append(place)
    return found


def _still(mapped: MappedDevice, readings: Sequence[Reading]) -> bool:
    """Return whether the device has rested for long enough that it is known to rest."""
    places = _moving(mapped, readings)
    first = places[-1] + 1 if places else 0
    return first < len(readings) and readings[-1].received - readings[first].sent > STAYS_S


@contextmanager
def _others(mapped: MappedDevice, stops: Stops) -> Iterator[None]:
    """Let the other operators read the state while the context lasts."""
    over, took = threading.Event(), list[float]()
    client, state = mapped.api.client, mapped.motion.state.read
    limit = client.connection.request_rate
    pace_s = max(_READS_S, 2 * stops.operators / limit if limit else 0.0)

    def read() -> None:
        while not over.is_set():
            began = time.monotonic()
            try:
                made = mapped.binding.make(state, None)
                good = client.send(made.method, made.target, headers=made.headers, body=made.body).response.ok
            except NoAnswerError:
                good = False
            lasted = time.monotonic() - began
            took.append(lasted if good else -1.0)
            over.wait(max(0.0, pace_s - lasted))

    threads = [threading.Thread(target=read, daemon=True) for _ in range(stops.operators - 1)]
    for thread in threads:
        thread.start()
    try:
        yield
    finally:
        over.set()
        for thread in threads:
            thread.join()
        stops.reads.merge(Histogram.of(int(lasted * 1e9) for lasted in took if lasted >= 0))
        stops.failed += sum(lasted < 0 for lasted in took)


class Stopping:
    """Stops a device that the run may move; a guard process does if this process is killed.

    Args:
        api: the device.
    """

    def __init__(self, api: RestInterface) -> None:
        self._api, self._guard = api, Guard(api)
        if api.run.allow_motion or api.call_rules.allow:
            api.client.connection.before_sending = self._guard.before_sending

    @classmethod
    def of(cls, device: Device) -> Self:
        """Read where a device is, before anything moves it: a device that nobody sees is not moved.

        Raises:
            SettingsError: its motion map does not show where it is.
            CallError: it does not respond.
        """
        motion = device.statement.motion_map
        try:
            if motion is not None and device.api.run.allow_motion:
                MappedDevice(device.api, motion, binding=binding_of(device.api))
        except NotPossibleError as error:
            raise SettingsError(f"[motion]: {error}") from None
        except NoAnswerError as none:
            raise CallError("closed", str(none)) from None
        return cls(device.api)

    @classmethod
    def of_papers_robot(cls, robot: Robot) -> Self:
        """Return the stop of a robot with the paper's interface: its goal is cancelled, and velocity 0 sent."""
        contract = Contract.load()
        statement = empty_statement(contract)
        endpoints = msgspec.structs.replace(statement.endpoints, rest=robot.rest)
        run = Run(msgspec.structs.replace(statement, endpoints=endpoints), contract, allow_motion=True)
        connection = Connection(ca_file=Path(robot.ca_file) if robot.ca_file else None, token=robot.token)
        return cls(RestInterface(run, HttpClient(robot.rest or "", connection)))

    def start_guard(self) -> int | None:
        """Start the guard; return the descriptor that the processes which send the load inherit, if there is a guard.

        The guard stops the device when all of them have ended.
        """
        return self._guard.start() if self._api.run.allow_motion or self._api.call_rules.allow else None

    def stop(self) -> str:
        """Stop the device, as a certification does; return why it may still move, or an empty text."""
        problem = stop_device(self._api, lambda line: click.echo(f"roaas load: {line}", err=True))
        self._guard.release(stopped=not problem)
        return problem
