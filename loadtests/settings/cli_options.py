"""The options of the command line."""

import re
from collections.abc import Callable
from dataclasses import dataclass, field, fields
from typing import Any, Self

import click

from conformance.papers_robot.statement import RobotStatement
from conformance.statement.endpoints import Endpoints
from loadtests.settings.settings import STEP_S, Generator, Repeats, Selection

TOLERANCE = 0.05
KNEE_SEARCHES = 5


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


def _parsed(read: Callable[[str], Any], expected: str) -> Callable[[click.Context, click.Parameter, str | None], Any]:
    """Return a callback that parses an option's text with `read`, or raises a usage error with `expected`."""

    def callback(_: click.Context, __: click.Parameter, value: str | None) -> Any:
        try:
            return read(value or "")
        except ValueError:
            raise click.BadParameter(f"{value!r} is not {expected}") from None

    return callback


_UNITS = {"ms": 1e-3, "s": 1.0, "m": 60.0, "h": 3600.0}
_STAGE = re.compile(r"(\d+(?:\.\d+)?):(\d+(?:\.\d+)?)(ms|s|m|h)")


def _stages(text: str) -> tuple[tuple[float, float], ...]:
    found = [_STAGE.fullmatch(part.strip()) for part in text.split(",")] if text else []
    if not all(found):
        raise ValueError(text)
    return tuple((float(each[1]), float(each[2]) * _UNITS[each[3]]) for each in found if each)


STAGES = _parsed(_stages, "a list of stages such as 10:30s,100:1m,10:30s")
SHARE = _parsed(lambda text: float(text.removesuffix("%")) / 100, "a percentage such as 5%")
