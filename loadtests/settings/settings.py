"""A run, ready to be carried out: frozen groups of values, each passed whole to whom it concerns."""

from dataclasses import dataclass
from typing import Self

import msgspec

from conformance.packs.table1.thresholds import Threshold
from loadtests.clients.robot import Robot
from loadtests.schedule.plan import Load

STEP_S = 3.0


@dataclass(frozen=True)
class Selection:
    """What is measured; each empty in the options where all that there is is meant."""

    operations: tuple[str, ...] = ()
    interfaces: tuple[str, ...] = ()
    clients: tuple[str, ...] = ()


@dataclass(frozen=True)
class Steps:
    """The loads after the duel.

    Attributes:
        rates: of the stepped load, arrivals per second; none where it is not asked for.
        step_s: seconds for each step.
        most_rate: the highest rate that is allowed for the operation that is stepped.
        knee_searches: how often the knee is searched by bisection; 0: not at all.
        connections: numbers of connections that are always busy.
    """

    rates: tuple[float, ...] = ()
    step_s: float = STEP_S
    most_rate: float | None = None
    knee_searches: int = 0
    connections: tuple[int, ...] = ()

    @property
    def asked(self) -> bool:
        """Whether there is anything to do after the duel."""
        return bool(self.rates or self.knee_searches or self.connections)


@dataclass(frozen=True)
class Repeats:
    """How often the duel is run, and the command that starts the robot anew before each time but the first."""

    number: int = 1
    restart_command: str | None = None


@dataclass(frozen=True)
class Limits:
    """What the statement allows, or the default for what moves a robot: requests per second, and seconds."""

    max_rate: float | None
    max_duration_s: float | None


@dataclass(frozen=True)
class Generator:
    """The processes that make the load, and where they are watched.

    Attributes:
        processes: workers on this machine.
        expect: workers in all, those of other machines included; 0 when only this process works.
        master_host, master_port: where the master listens for workers; port 0 picks a free one.
        web_host: where Locust's web UI (`web_port`) and Prometheus' metrics (`metrics_port`) are, if anywhere.
    """

    processes: int = 1
    expect: int = 0
    master_host: str = "127.0.0.1"
    master_port: int = 0
    web_host: str = "127.0.0.1"
    web_port: int | None = None
    metrics_port: int | None = None


@dataclass(frozen=True)
class Output:
    """The result's folder; and what the result repeats: the command line, and the robot's name, vendor and version."""

    folder: str
    command: str
    about: dict[str, str]


@dataclass(frozen=True)
class EndToEnd:
    """The measurement from the request to the application.

    Attributes:
        domain_id: the robot's ROS domain.
        rounds: how many deliveries over each way, where they take no longer than `longest_s`.
        most_rate: the highest rate allowed.
    """

    domain_id: int
    most_rate: float | None
    longest_s: float
    rounds: int = 100


@dataclass(frozen=True)
class Against:
    """The robot that the one under load is compared with.

    Attributes:
        robot: its addresses.
        tolerance: by which share the robot under load may be slower.
    """

    robot: Robot
    tolerance: float


@dataclass(frozen=True)
class Settings:
    """A run. Whatever was not asked for is filled in.

    Attributes:
        robot: addresses of the selected interfaces only; a SOAP address that only the WSDL knows is None.
        load: rate is None in the closed model.
        against: None where no other robot takes part.
        end_to_end: None where it was not asked for.
    """

    robot: Robot
    selection: Selection
    load: Load
    steps: Steps
    repeats: Repeats
    limits: Limits
    generator: Generator
    output: Output
    thresholds: tuple[Threshold, ...]
    against: Against | None = None
    end_to_end: EndToEnd | None = None

    def to_json(self) -> str:
        """For the process that measures."""
        return msgspec.json.encode(self).decode()

    @classmethod
    def from_json(cls, text: str) -> Self:
        """Read what `to_json` wrote."""
        return msgspec.json.decode(text, type=cls)
