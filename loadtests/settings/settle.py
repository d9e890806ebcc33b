"""Settings from options and statement: options win over the statement, which wins over the defaults."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Self

import msgspec

from conformance.packs.table1.statement import Statement
from conformance.statement.endpoints import Endpoints
from loadtests.clients.endpoint import Endpoint, EndpointError, tls_context
from loadtests.clients.robot import Robot
from loadtests.clients.rosbridge import bridge_endpoint
from loadtests.schedule.plan import CLIENTS, INTERFACES, MOVES, OPERATIONS, Load
from loadtests.settings.cli_options import CliOptions
from loadtests.settings.contradictions import contradiction
from loadtests.settings.settings import Against, EndToEnd, Limits, Output, Selection, Settings, Steps

DEFAULT_RATE = 200.0
DEFAULT_DURATION_S = 20.0
DEFAULT_WARMUP_S = 2.0
DEFAULT_STEP_RATES = (100.0, 200.0, 400.0, 800.0, 1600.0, 3200.0, 6400.0, 12800.0)
#: Limits on operations that move the robot, unless its statement's [load] says otherwise.
MOTION_RATE = 500.0
MOTION_DURATION_S = 120.0
_MOST_TOLERANCE = 10.0
_DEFAULT_LIMIT = "the default limit for operations that move the robot; the statement's [load] {} lifts it"


class SettingsError(ValueError):
    """Settings that are impossible or not allowed; the message says what to change."""


def settle(options: CliOptions, statement: Statement) -> Settings:
    """Return the settings of a run: options over statement over defaults.

    Raises:
        SettingsError: options contradict one another, are out of range, exceed the statement's limits, or ask for
            motion without --allow-motion.
    """
    endpoints = msgspec.structs.replace(statement.endpoints, **options.endpoints)
    _check_endpoints(endpoints)
    interfaces = _interfaces(options, endpoints)
    robot = _robot(endpoints, interfaces)
    if "rosbridge" in interfaces:
        robot = replace(robot, rosbridge=options.rosbridge, delivery_topic=statement.ros.delivery_topic)
    operations = _operations(options)
    wrong = contradiction(options)
    if wrong is not None:
        raise SettingsError(wrong)
    allowed = _Allowed.of(statement, operations)
    # Defaults are lowered to what is allowed; options that exceed it are refused.
    rate = None if options.users is not None else (options.rate or min(DEFAULT_RATE, allowed.rate or DEFAULT_RATE))
    duration_s = options.duration_s or min(DEFAULT_DURATION_S, allowed.duration_s or DEFAULT_DURATION_S)
    allowed.check(rate, duration_s, options.repeats.number)
    generator = options.generator
    clients = tuple(name for name in CLIENTS if name in (options.selection.clients or CLIENTS))
    if options.against is not None:
        interfaces, clients = _shared(options.against.endpoints, interfaces), clients[:1]
    settings = Settings(
        robot=robot,
        selection=Selection(operations=operations, interfaces=interfaces, clients=clients),
        load=Load(
            rate=rate,
            users=options.users,
            duration_s=duration_s,
            warmup_s=DEFAULT_WARMUP_S if options.warmup_s is None else options.warmup_s,
            arrivals=options.arrivals,
            seed=options.seed,
        ),
        steps=_steps(options, statement, operations),
        repeats=options.repeats,
        limits=Limits(allowed.rate, allowed.duration_s),
        generator=replace(
            generator, expect=max(generator.expect, generator.processes if generator.processes > 1 else 0)
        ),
        output=Output(options.out, options.command, statement.robot),
        thresholds=options.thresholds or statement.load.thresholds,
        end_to_end=_end_to_end(options, statement, operations, allowed.rate, duration_s),
    )
    return settings if options.against is None else _compared(settings, options.against, options.tolerance)


@dataclass(frozen=True)
class _Allowed:
    """The highest rate and longest duration that a statement allows (None: no limit), and the name of its field."""

    rate: float | None
    rate_by: str
    duration_s: float | None
    duration_by: str

    @classmethod
    def of(cls, statement: Statement, operations: tuple[str, ...]) -> Self:
        """Return the limits of a statement, or those by default for operations that move the robot."""
        moves = MOVES.intersection(operations)
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


def _end_to_end(
    options: CliOptions, statement: Statement, operations: tuple[str, ...], most_rate: float | None, duration_s: float
) -> EndToEnd | None:
    if not options.end_to_end:
        return None
    domain_id = statement.ros.domain_id if options.ros_domain_id is None else options.ros_domain_id
    if domain_id is None:
        raise SettingsError("--end-to-end needs the robot's ROS domain: --ros-domain-id or [ros] domain_id")
    if "delivery" not in operations:
        raise SettingsError("--end-to-end follows deliveries, which make the robot drive: add --allow-motion")
    return EndToEnd(domain_id, most_rate, duration_s)


def _shared(other: Endpoints, interfaces: tuple[str, ...]) -> tuple[str, ...]:
    """Return the interfaces that the robot of --against has too."""
    there = {"rest": bool(other.rest), "soap": other.publishers or other.subscribers}
    shared = tuple(name for name in interfaces if there[name])
    if not shared:
        raise SettingsError(
            f"--against names a robot without {' or '.join(interfaces)}: there is nothing to compare (name its SOAP "
            "services with --against-publishers-wsdl and --against-subscribers-wsdl)"
        )
    return shared


def _compared(settings: Settings, other: Statement, tolerance: float) -> Settings:
    """Return the settings of a run against another robot, whose own limits apply as well."""
    _check_endpoints(other.endpoints)
    if settings.steps.asked:
        raise SettingsError(
            "--against compares two robots; --steps, --knee and --connections load one: run them one after the other"
        )
    if not 0 < tolerance <= _MOST_TOLERANCE:
        raise SettingsError(f"--tolerance {tolerance:.3%} is out of range: above 0, at most {_MOST_TOLERANCE:.0%}")
    load = settings.load
    allowed = _Allowed.of(other, settings.selection.operations)
    allowed.check(load.rate, load.duration_s, settings.repeats.number, "; of the robot of --against")
    ceilings = [rate for rate in (settings.limits.max_rate, allowed.rate) if rate is not None]
    return replace(
        settings,
        limits=replace(settings.limits, max_rate=min(ceilings, default=None)),
        against=Against(_robot(other.endpoints, settings.selection.interfaces), tolerance),
    )


def _check_endpoints(endpoints: Endpoints) -> None:
    descriptions = (endpoints.publishers_wsdl, endpoints.subscribers_wsdl)
    try:
        for address in (endpoints.rest, endpoints.publishers_endpoint, endpoints.subscribers_endpoint):
            if address:
                Endpoint.parse(address)
        for location in descriptions:
            if location and "://" in location:  # else it is a file
                Endpoint.parse(location)
        if endpoints.ca_file:
            tls_context(Path(endpoints.ca_file))
    except EndpointError as error:
        raise SettingsError(str(error)) from None


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
    )


def _operations(options: CliOptions) -> tuple[str, ...]:
    if not options.selection.operations:
        return ("delivery", "pose") if options.allow_motion else ("pose",)
    moving = [name for name in options.selection.operations if name in MOVES]
    if moving and not options.allow_motion:
        raise SettingsError(
            f"operation {moving[0]!r} makes the robot drive: add --allow-motion when its surroundings are clear, "
            "or measure --operation pose"
        )
    return tuple(name for name in OPERATIONS if name in options.selection.operations)


def _steps(options: CliOptions, statement: Statement, operations: tuple[str, ...]) -> Steps:
    """Return the load steps after the comparison; they use a read operation if there is one."""
    reads = tuple(name for name in operations if name not in MOVES)
    ceiling = _Allowed.of(statement, reads or operations).rate
    searches = options.knee_searches if options.knee else 0
    return Steps(_step_rates(options, ceiling), options.step_s, ceiling, searches, options.connections)


def _step_rates(options: CliOptions, ceiling: float | None) -> tuple[float, ...]:
    """Return the rates of the stepped load up to a limit; empty when no steps are wanted."""
    if options.step_rates:
        above = [rate for rate in options.step_rates if ceiling is not None and rate > ceiling]
        if above:
            raise SettingsError(f"--step-rates {above[0]:g} exceeds {ceiling:g} requests/s, the highest rate allowed")
        return tuple(sorted(set(options.step_rates)))
    if not options.steps:
        return ()
    if ceiling is None:
        return DEFAULT_STEP_RATES
    return tuple(rate for rate in DEFAULT_STEP_RATES if rate <= ceiling) or (ceiling,)


def _token(path: str | None) -> str | None:
    """Return the bearer token in a file.

    Raises:
        SettingsError: the file is unreadable or empty, or no header may contain its text (RFC 6750 section 2.1).
    """
    if path is None:
        return None
    try:
        token = Path(path).read_text("utf-8").strip()
    except (OSError, UnicodeDecodeError) as error:
        raise SettingsError(f"token file {path!r}: {getattr(error, 'strerror', None) or error}") from None
    if not token or not token.isascii() or not token.isprintable() or " " in token:
        raise SettingsError(f"token file {path!r} is not a token: expected one line of printable ASCII without spaces")
    return token
