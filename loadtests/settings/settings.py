"""The settings of a run, in frozen groups, and the options of the command line that become settings.

Each group goes to the code that needs it.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass, field, fields
from typing import Any, Self

import click
import msgspec

from conformance.papers_robot.statement import RobotStatement
from conformance.statement.endpoints import Endpoints
from conformance.statement.load import ServiceLevel
from loadtests.clients.robot import Robot, Stream
from loadtests.schedule.plan import Load

STEP_S = 3.0
TOLERANCE = 0.05
KNEE_SEARCHES = 5
_UNITS = {"ms": 1e-3, "s": 1.0, "m": 60.0, "h": 3600.0}
_STAGE = re.compile(r"(\d+(?:\.\d+)?):(\d+(?:\.\d+)?)(ms|s|m|h)")


@dataclass(frozen=True)
class Selection:
    """Operations to measure; in the options, an empty field means all.

    `weights` say how often each operation is called beside the others; empty where all are called equally often.
    """

    operations: tuple[str, ...] = ()
    interfaces: tuple[str, ...] = ()
    clients: tuple[str, ...] = ()
    weights: tuple[int, ...] = ()


@dataclass(frozen=True)
class Steps:
    """The searches for the knee after the comparison.

    Attributes:
        step_s: seconds of each step.
        most_rate: the highest rate allowed for the operation that is stepped.
        knee_searches: how often to search; 0 for not at all.
    """

    step_s: float = STEP_S
    most_rate: float | None = None
    knee_searches: int = 0

    @property
    def has_searches(self) -> bool:
        """Return whether there is anything to do after the comparison."""
        return bool(self.knee_searches)


@dataclass(frozen=True)
class Repeats:
    """How often to run the comparison, and the command that restarts the robot before each repeat but the first."""

    number: int = 1
    restart_command: str | None = None


@dataclass(frozen=True)
class Limits:
    """Limits for operations that move the robot, from the statement or by default: requests per second, seconds."""

    max_rate: float | None
    max_duration_s: float | None


@dataclass(frozen=True)
class Generator:
    """The processes that generate the load, and where to watch them.

    Attributes:
        processes: workers on this machine.
        expect: workers on all machines; 0 when this process alone generates the load.
        master_host, master_port: where the master listens for workers; port 0 picks a free one.
        web_host: where Locust's web UI (`web_port`) listens.
    """

    processes: int = 1
    expect: int = 0
    master_host: str = "127.0.0.1"
    master_port: int = 0
    web_host: str = "127.0.0.1"
    web_port: int | None = None


@dataclass(frozen=True)
class Output:
    """Where results go.

    Attributes:
        folder: the folder of the result.
        command: the command line; about: the robot's name, vendor and version. The result repeats them.
        progress: `auto`, `lines` or `none`.
    """

    folder: str
    command: str
    about: dict[str, str]
    progress: str = "auto"


@dataclass(frozen=True)
class Streams:
    """The streams to listen to after the comparison, and JSON pointers (RFC 6901) into messages.

    Attributes:
        stamp: to the time of the data in a message.
        clock: to the time, in the response that is polled, at which the robot made that response.
    """

    listen: tuple[Stream, ...] = ()
    stamp: str | None = None
    clock: str | None = None


@dataclass(frozen=True)
class Scenario:
    """A Locust file with the tasks of the users, and the digest of its content, by which workers know it."""

    file: str
    sha256: str


@dataclass(frozen=True)
class Against:
    """The comparison with another robot.

    Attributes:
        robot: the other one.
        tolerance: the share by which the robot under load may be slower.
        looks: after how many durations the comparison is judged: it goes on from one to the next while it is undecided.
    """

    robot: Robot
    tolerance: float
    looks: tuple[int, ...] = (1,)


@dataclass(frozen=True)
class Target:
    """The target of a run.

    Attributes:
        robot: with the addresses of the selected interfaces only.
        selection: operations, interfaces and clients, complete.
        moves: whether an operation moves the robot or changes something.
        steps_move: the same of the operation whose rate the load steps raise.
        other: the robot to compare with, of a device with a description.
        description: where the description is from; None for the paper's robot.
        slo: the service levels of the operations, by their names.
        notes: what the result should say of the choice.
        streams: what to listen to.
        scenario: what the users do, if a scenario says that.
    """

    robot: Robot
    selection: Selection
    moves: bool
    steps_move: bool
    other: Robot | None = None
    description: str | None = None
    slo: dict[str, ServiceLevel] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    streams: Streams = field(default_factory=Streams)
    scenario: Scenario | None = None

    @property
    def rate_of_levels(self) -> float | None:
        """Return the lowest rate of all requests at which each operation has the rate that its service level is for.

        None where no level names a rate.
        """
        names = self.selection.operations
        shares = dict(zip(names, self.selection.weights or (1,) * len(names), strict=True))
        rates = [
            level.at_rate * sum(shares.values()) / shares[name]
            for name, level in self.slo.items()
            if level.at_rate is not None
        ]
        return max(rates, default=None)


@dataclass(frozen=True, kw_only=True)
class Settings(Target):
    """The complete settings of a run: its target and its method.

    Attributes:
        load: its rate is None in the closed model.
        against: None where no other robot takes part.
    """

    load: Load
    steps: Steps
    repeats: Repeats
    limits: Limits
    generator: Generator
    output: Output
    against: Against | None = None

    def to_json(self) -> str:
        """Return the settings for the process that measures."""
        return msgspec.json.encode(self).decode()

    @classmethod
    def from_json(cls, text: str) -> Self:
        """Return the settings that `to_json` wrote."""
        return msgspec.json.decode(text, type=cls)


class SettingsError(ValueError):
    """Settings that are impossible or not allowed; the message names the remedy."""


@dataclass(frozen=True)
class CliOptions:
    """The options as given; None or empty where an option was not given.

    Attributes:
        endpoints: override the statement's [endpoints].
        rosbridge: address of the rosbridge.
        against: the other robot.
        tolerance: by which share the robot may be slower than the other one.
    """

    endpoints: dict[str, Any] = field(default_factory=dict)
    selection: Selection = field(default_factory=Selection)
    generator: Generator = field(default_factory=Generator)
    rate: float | None = None
    users: int | None = None
    stages: tuple[tuple[float, float], ...] = ()
    duration_s: float | None = None
    warmup_s: float | None = None
    arrivals: str = "constant"
    seed: int = 0
    step_s: float = STEP_S
    knee: bool = False
    knee_searches: int = KNEE_SEARCHES
    repeats: Repeats = field(default_factory=Repeats)
    allow_motion: bool = False
    rosbridge: str | None = None
    against: RobotStatement | None = None
    tolerance: float = TOLERANCE
    out: str = ""
    progress: str = "auto"
    command: str = ""

    @classmethod
    def of(cls, **given: Any) -> Self:
        """Return options grouped as the settings are, from options by name."""
        endpoints = _take(given, Endpoints.__struct_fields__)
        endpoints = {name: value for name, value in endpoints.items() if value not in {None, "", ()}}
        selection = Selection(**_take(given, [item.name for item in fields(Selection)]))
        generator = Generator(**_take(given, [item.name for item in fields(Generator)]))
        repeats = Repeats(given.pop("repeat", 1), given.pop("restart_command", None))
        return cls(endpoints, selection, generator, repeats=repeats, **given)


def _take(given: dict[str, Any], names: list[str] | tuple[str, ...]) -> dict[str, Any]:
    return {name: given.pop(name) for name in names if name in given}


def _parser(read: Callable[[str], Any], expected: str) -> Callable[[click.Context, click.Parameter, str | None], Any]:
    """Return a callback that parses an option's text with `read`, or raises a usage error with `expected`."""

    def callback(_: click.Context, __: click.Parameter, value: str | None) -> Any:
        try:
            return read(value or "")
        except ValueError:
            raise click.BadParameter(f"{value!r} is not {expected}") from None

    return callback


def _stages(text: str) -> tuple[tuple[float, float], ...]:
    found = [_STAGE.fullmatch(part.strip()) for part in text.split(",")] if text else []
    if not all(found):
        raise ValueError(text)
    return tuple((float(each[1]), float(each[2]) * _UNITS[each[3]]) for each in found if each)


STAGES = _parser(_stages, "a list of stages such as 10:30s,100:1m,10:30s")
SHARE = _parser(lambda text: float(text.removesuffix("%")) / 100, "a percentage such as 5%")
