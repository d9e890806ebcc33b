"""Results of a run, collected during it, from which latency.json is made. Loads Locust; `files` does not."""

from dataclasses import dataclass, field
from typing import Any

from conformance.commandline.endings import Started
from loadtests.clients.robot import Robot
from loadtests.measuring.distributed_executor import Executor
from loadtests.measuring.machine import Moment
from loadtests.measuring.preflight import Findings
from loadtests.measuring.robot_process import RobotProcess
from loadtests.measuring.streams import Heard
from loadtests.schedule.plan import Plan
from loadtests.settings.settings import Settings


class RunAborted(Exception):  # noqa: N818 -- an outcome, with its exit code
    """Raised when a run ends before it measures; holds the exit code and the reason."""

    def __init__(self, code: int, message: str) -> None:
        super().__init__(message)
        self.code = code


@dataclass
class Carried:
    """A plan, and for how many seconds it was carried out."""

    plan: Plan
    elapsed_s: float = 0.0


@dataclass
class Outcome:
    """The outcome of a run so far.

    Attributes:
        robots: the one under load, and the one that it is compared with, if any.
        findings: findings of the calls to the robot under load before the run.
        notes: worth knowing; invalid: reasons why the figures are worthless.
        interrupted: by Ctrl-C; dead_at: when the robot fell silent, in seconds from the plan's start.
        carried: each repeat's plan, and how many seconds of it were carried out.
        before: the machine when the run began.
        robot_process: the process at the robot's address before the comparison, where that is known.
        cpu_share: the busiest worker's share of a core in the comparison.
        knee_searches: results of the searches for the knee.
        heard: what came over each stream.
    """

    settings: Settings
    robots: tuple[Robot, ...]
    started: Started
    findings: Findings = field(default_factory=Findings)
    notes: list[str] = field(default_factory=list)
    invalid: list[str] = field(default_factory=list)
    interrupted: bool = False
    dead_at: float | None = None
    executor: Executor | None = None
    carried: list[Carried] = field(default_factory=list)
    before: Moment = field(default_factory=Moment.now)
    robot_process: RobotProcess | None = None
    cpu_share: float | None = None
    knee_searches: list[dict[str, Any]] = field(default_factory=list)
    heard: list[Heard] = field(default_factory=list)
