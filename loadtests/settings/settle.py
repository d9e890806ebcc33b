"""Settings of the paper's robot: options win over the statement, which wins over the defaults."""

import math
import shlex
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Self

import msgspec

from conformance.commandline.secret_file import read_secret
from conformance.papers_robot.statement import RobotStatement
from conformance.statement.endpoints import Endpoints
from conformance.transport.reach import trusted_host
from loadtests.clients.endpoint import Endpoint, EndpointError, tls_context
from loadtests.clients.payloads import CATALOGUE, CLIENTS, INTERFACES, MOVES
from loadtests.clients.robot import Robot
from loadtests.clients.rosbridge import bridge_endpoint
from loadtests.schedule.plan import Load
from loadtests.settings.settings import (
    Against,
    CliOptions,
    Limits,
    Output,
    Selection,
    Settings,
    SettingsError,
    Steps,
    Target,
)


def papers_robot(options: CliOptions, statement: RobotStatement) -> Target:
    """Return the paper's robot as a target, and the robot to compare with.

    Raises:
        SettingsError: an address cannot be used, or options ask for what the robot does not have or may not do.
    """
    endpoints = msgspec.structs.replace(statement.endpoints, **options.endpoints)
    _check_endpoints(endpoints)
    interfaces = _interfaces(options, endpoints)
    robot = _robot(endpoints, interfaces)
    if "rosbridge" in interfaces:
        robot = replace(robot, rosbridge=options.rosbridge, delivery_topic=statement.ros.delivery_topic)
    operations = _operations(options)
    clients = tuple(name for name in CLIENTS if name in (options.selection.clients or CLIENTS))
    other = None
    if options.against is not None:
        interfaces, clients = _shared_interfaces(options.against.endpoints, interfaces), clients[:1]
        _check_endpoints(options.against.endpoints)
        other = _robot(options.against.endpoints, interfaces)
    for key in ("operations", "pairs"):
        if getattr(statement.load, key):
            raise SettingsError(f"[load] {key} is for a device with a description: see [api]; here, use --operation")
    unknown = [name for name in statement.slo if name not in CATALOGUE]
    if unknown:
        raise SettingsError(f"[slo] {unknown[0]!r} is no operation: it has to be one of {', '.join(CATALOGUE)}")
    return Target(
        robot,
        Selection(operations=operations, interfaces=interfaces, clients=clients),
        moves=not MOVES.isdisjoint(operations),
        steps_move=MOVES.issuperset(operations),
        other=other,
        slo={name: level for name, level in statement.slo.items() if name in operations},
    )


def _shared_interfaces(other: Endpoints, interfaces: tuple[str, ...]) -> tuple[str, ...]:
    """Return the interfaces that the robot of --against has too."""
    there = {"rest": bool(other.rest), "soap": other.publishers or other.subscribers}
    shared = tuple(name for name in interfaces if there[name])
    if not shared:
        raise SettingsError(
            f"--against names a robot without {' or '.join(interfaces)}: there is nothing to compare (a "
            "statement names its SOAP services: --against other.toml)"
        )
    return shared


def _check_endpoints(endpoints: Endpoints) -> None:
    descriptions = (endpoints.publishers_wsdl, endpoints.subscribers_wsdl)
    try:
        for address in (endpoints.rest, endpoints.publishers_endpoint, endpoints.subscribers_endpoint):
            if address:
                Endpoint.parse(address)
        for location in descriptions:
            if location and "://" in location:  # otherwise it is a file
                Endpoint.parse(location)
        if endpoints.ca_file:
            tls_context(Path(endpoints.ca_file))
        for host in endpoints.trust_hosts:
            trusted_host(host)
    except EndpointError as error:
        raise SettingsError(str(error)) from None
    except ValueError as error:
        raise SettingsError(f"--trust-host: {error}") from None


def _interfaces(options: CliOptions, endpoints: Endpoints) -> tuple[str, ...]:
    soap = endpoints.publishers or endpoints.subscribers
    there = {"rest": bool(endpoints.rest), "soap": soap, "rosbridge": bool(options.rosbridge)}
    interfaces = options.selection.interfaces or tuple(name for name in INTERFACES if there[name])
    if not interfaces:
        raise SettingsError("no endpoint: give a statement, --rest, --publishers-wsdl or --subscribers-wsdl")
    if "rosbridge" in interfaces:
        _check_bridge(options)
    if "rest" in interfaces and not endpoints.rest:
        raise SettingsError("--interface rest needs --rest or the statement's [endpoints] rest")
    if "soap" in interfaces and not soap:
        raise SettingsError("--interface soap needs --publishers-wsdl, --subscribers-wsdl or an endpoint")
    return tuple(name for name in INTERFACES if name in interfaces)


def _check_bridge(options: CliOptions) -> None:
    if not options.rosbridge:
        raise SettingsError("--interface rosbridge needs --rosbridge ws://…")
    if options.against is not None:
        raise SettingsError("--against compares the web services of two robots: leave --rosbridge out")
    try:
        bridge_endpoint(options.rosbridge)
    except EndpointError as error:
        raise SettingsError(f"--rosbridge: {error}") from None


def _robot(endpoints: Endpoints, interfaces: tuple[str, ...]) -> Robot:
    """Return the robot with the addresses of the selected interfaces only."""
    soap = endpoints if "soap" in interfaces else type(endpoints)()
    return Robot(
        rest=endpoints.rest if "rest" in interfaces else None,
        publishers=soap.publishers_endpoint,
        subscribers=soap.subscribers_endpoint,
        publishers_wsdl=soap.publishers_wsdl,
        subscribers_wsdl=soap.subscribers_wsdl,
        ca_file=endpoints.ca_file,
        token=_token(endpoints.token_file),
        timeout_s=endpoints.timeout_s,
        trust_hosts=endpoints.trust_hosts,
    )


def _operations(options: CliOptions) -> tuple[str, ...]:
    unknown = [name for name in options.selection.operations if name not in CATALOGUE]
    if unknown:
        raise SettingsError(
            f"--operation {unknown[0]!r} is not one of {', '.join(CATALOGUE)}; to measure another operation, name the "
            "device's description, as in roaas load http://robot:8000/openapi.json"
        )
    if not options.selection.operations:
        return ("delivery", "pose") if options.allow_motion else ("pose",)
    moving = [name for name in options.selection.operations if name in MOVES]
    if moving and not options.allow_motion:
        raise SettingsError(
            f"operation {moving[0]!r} makes the robot drive: add --allow-motion when its surroundings are clear, "
            "or measure --operation pose"
        )
    return tuple(name for name in CATALOGUE if name in options.selection.operations)


def _token(path: str | None) -> str | None:
    """Return the bearer token in a file.

    Raises:
        SettingsError: the file is unreadable or empty, or no header may contain its text (RFC 6750 section 2.1).
    """
    if path is None:
        return None
    try:
        token = read_secret(path)
    except (OSError, UnicodeDecodeError) as error:
        raise SettingsError(str(error) if isinstance(error, OSError) else f"token file {path!r}: {error}") from None
    if not token or not token.isascii() or not token.isprintable() or " " in token:
        raise SettingsError(f"token file {path!r} is not a token: expected one line of printable ASCII without spaces")
    return token


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
    """Return what is wrong with the option --stages, as a sentence; None if nothing is."""
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
        options: options of the command.
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
