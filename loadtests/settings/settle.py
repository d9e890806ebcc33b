"""Settings from options and statement: options win over the statement, which wins over the defaults."""

import math
import shlex
from dataclasses import dataclass, replace
from typing import Any, Self

from conformance.papers_robot.statement import RobotStatement
from loadtests.schedule.plan import Load
from loadtests.settings.papers_robot import papers_robot
from loadtests.settings.settings import Against, CliOptions, Limits, Output, Settings, SettingsError, Steps, Target

_MOST_RATE = 1_000_000.0
_MOST_USERS = 10_000
_MOST_DURATION_S = 24 * 3600.0
DEFAULT_RATE = 200.0
DEFAULT_DURATION_S = 20.0
# Two robots share the time. It goes on, up to four times as long, while the comparison is undecided.
DEFAULT_AGAINST_S = 40.0
AGAINST_LOOKS = (1, 2, 4)
DEFAULT_WARMUP_S = 2.0
#: Limits on operations that move the robot, unless its statement's [load] says otherwise.
MOTION_RATE = 500.0
MOTION_DURATION_S = 120.0
_MOST_TOLERANCE = 10.0
_DEFAULT_LIMIT = "the default limit for operations that move the robot; the statement's [load] {} lifts it"


def contradiction(options: CliOptions) -> str | None:
    """Return the contradiction in the options and its remedy; None if they are valid."""
    if options.rate is not None and options.users is not None:
        return "--rate (open model) and --users (closed model) exclude each other"
    if options.users is not None and options.knee:
        return "--knee sets rates, which is an open model: use --rate instead of --users"
    if options.generator.processes + options.generator.expect < 1:
        return "--processes 0 leaves the work to other machines: say how many workers with --expect-workers"
    ranges: list[tuple[str, Any, float, float]] = [
        ("--rate", options.rate, 0.0, _MOST_RATE),
        ("--users", options.users, 0, _MOST_USERS),
        ("--duration", options.duration_s, 0.0, _MOST_DURATION_S),
        ("--timeout", options.endpoints.get("timeout_s"), 0.0, 3600.0),
        ("--step-duration", options.step_s, 0.0, 600.0),
    ]
    for name, value, low, high in ranges:
        if value is not None and not low < value <= high:
            return f"{name} {value:g} is out of range: above {low:g}, at most {high:g}"
    if options.warmup_s is not None and not 0 <= options.warmup_s <= _MOST_DURATION_S:
        return f"--warmup {options.warmup_s:g} is out of range: 0 or more"
    return _in_stages(options) or _restarting(options)


def _in_stages(options: CliOptions) -> str | None:
    """Return the fault of the stages."""
    if not options.stages:
        return None
    given = {"rate": options.rate, "users": options.users, "duration": options.duration_s}
    if other := next((name for name, value in given.items() if value is not None), None):
        return f"--stages says rates and durations: leave out --{other}"
    if max(rate for rate, _ in options.stages) <= 0 or sum(seconds for _, seconds in options.stages) <= 0:
        return "--stages needs a rate and a duration above 0"
    return None


def _restarting(options: CliOptions) -> str | None:
    """Return the fault of the command that restarts the robot."""
    command = options.repeats.restart_command
    if command is None:
        return None
    if options.repeats.number < 2:  # noqa: PLR2004 -- there is nothing between the repeats of one
        return "--restart-command restarts the robot between repeats: say how many with --repeat"
    try:
        words = shlex.split(command)
    except ValueError as error:
        return f"--restart-command {command!r}: {error}"
    if not words:
        return f"--restart-command {command!r} names no program"
    return None


def settle(options: CliOptions, statement: RobotStatement, target: Target | None = None) -> Settings:
    """Return the settings of a run: options over statement over defaults.

    Args:
        options: of the command.
        statement: on the robot.
        target: what is called; by default, the paper's robot.

    Raises:
        SettingsError: options contradict one another, are out of range, exceed the statement's limits, or ask for
            motion without --allow-motion.
    """
    target = target or papers_robot(options, statement)
    wrong = contradiction(options)
    if wrong is not None:
        raise SettingsError(wrong)
    if options.stages:
        rates, lasting = zip(*options.stages, strict=True)
        options = replace(options, rate=max(rates), duration_s=sum(lasting), warmup_s=options.warmup_s or 0.0)
    allowed = _Allowed.of(statement, moves=target.moves)
    # Defaults are lowered to what is allowed; options that exceed it are refused.
    usual = target.rate_of_levels or DEFAULT_RATE
    rate = None if options.users is not None else (options.rate or min(usual, allowed.rate or usual))
    usual_s = DEFAULT_DURATION_S if options.against is None else DEFAULT_AGAINST_S
    duration_s = options.duration_s or min(usual_s, allowed.duration_s or usual_s)
    allowed.check(rate, duration_s, options.repeats.number)
    generator = options.generator
    settings = Settings(
        **vars(target),
        load=Load(
            rate=rate,
            users=options.users,
            duration_s=duration_s,
            warmup_s=DEFAULT_WARMUP_S if options.warmup_s is None else options.warmup_s,
            arrivals=options.arrivals,
            seed=options.seed,
            stages=options.stages,
        ),
        steps=_steps(options, statement, moves=target.steps_move),
        repeats=options.repeats,
        limits=Limits(allowed.rate, allowed.duration_s),
        generator=replace(
            generator, expect=max(generator.expect, generator.processes if generator.processes > 1 else 0)
        ),
        output=Output(options.out, options.command, statement.robot, options.progress),
    )
    return settings if options.against is None else _compare_settings(settings, options, options.against, target)


@dataclass(frozen=True)
class _Allowed:
    """The highest rate and longest duration that a statement allows (None: no limit), and the name of its field."""

    rate: float | None
    rate_by: str
    duration_s: float | None
    duration_by: str

    @classmethod
    def of(cls, statement: RobotStatement, *, moves: bool) -> Self:
        """Return the limits of a statement, or those by default for operations that move the robot."""
        rates, duration = [], (statement.load.max_duration_s, "the statement's [load] max_duration_s")
        if statement.endpoints.request_rate is not None:
            rates.append((statement.endpoints.request_rate, "the statement's [endpoints] request_rate"))
        if statement.load.max_rate is not None:
            rates.append((statement.load.max_rate, "the statement's [load] max_rate"))
        elif moves:
            rates.append((MOTION_RATE, _DEFAULT_LIMIT.format("max_rate")))
        if duration[0] is None and moves:
            duration = MOTION_DURATION_S, _DEFAULT_LIMIT.format("max_duration_s")
        rate, rate_by = min(rates) if rates else (None, "")
        return cls(rate, rate_by, *duration)

    def check(self, rate: float | None, duration_s: float, repeats: int, whose: str = "") -> None:
        """Raise an error for a load that exceeds the limits."""
        if rate is not None and self.rate is not None and rate > self.rate:
            raise SettingsError(f"--rate {rate:g} exceeds {self.rate:g} requests/s ({self.rate_by}{whose})")
        if self.duration_s is not None and duration_s * repeats > self.duration_s:
            times = f" {repeats} times" if repeats > 1 else ""
            raise SettingsError(
                f"--duration {duration_s:g}{times} exceeds {self.duration_s:g} s ({self.duration_by}{whose})"
            )


def _compare_settings(settings: Settings, options: CliOptions, other: RobotStatement, target: Target) -> Settings:
    """Return the settings of a run against another robot, whose own limits apply as well."""
    tolerance = options.tolerance
    if settings.steps.has_searches:
        raise SettingsError("--against compares two robots, and --knee loads one: run them one after the other")
    if not 0 < tolerance <= _MOST_TOLERANCE:
        raise SettingsError(f"--tolerance {tolerance:.3%} is out of range: above 0, at most {_MOST_TOLERANCE:.0%}")
    load = settings.load
    allowed = _Allowed.of(other, moves=target.moves)
    allowed.check(load.rate, load.duration_s, settings.repeats.number, "; of the robot of --against")
    ceilings = [rate for rate in (settings.limits.max_rate, allowed.rate) if rate is not None]
    return replace(
        settings,
        limits=replace(settings.limits, max_rate=min(ceilings, default=None)),
        against=Against(target.other or target.robot, tolerance, _looks(options, load, settings, allowed)),
    )


def _looks(options: CliOptions, load: Load, settings: Settings, other: _Allowed) -> tuple[int, ...]:
    """Return after how many durations a comparison is judged: once, if the user set the duration."""
    if options.duration_s is not None or options.repeats.number > 1:
        return (1,)
    longest_s = min(settings.limits.max_duration_s or math.inf, other.duration_s or math.inf)
    return tuple(look for look in AGAINST_LOOKS if look * load.duration_s <= longest_s) or (1,)


def _steps(options: CliOptions, statement: RobotStatement, *, moves: bool) -> Steps:
    """Return the searches for the knee; they use a read operation if there is one."""
    searches = options.knee_searches if options.knee else 0
    return Steps(options.step_s, _Allowed.of(statement, moves=moves).rate, searches)
