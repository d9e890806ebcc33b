"""The paper's robot as a target: its addresses, interfaces and operations, from options and statement."""

from dataclasses import replace
from pathlib import Path

import msgspec

from conformance.commandline.secret_file import read_secret
from conformance.papers_robot.statement import RobotStatement
from conformance.statement.endpoints import Endpoints
from conformance.transport.reach import trusted_host
from loadtests.clients.endpoint import Endpoint, EndpointError, tls_context
from loadtests.clients.payloads import CATALOGUE, CLIENTS, INTERFACES, MOVES
from loadtests.clients.robot import Robot
from loadtests.clients.rosbridge import bridge_endpoint
from loadtests.settings.settings import CliOptions, Selection, SettingsError, Target


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
        raise SettingsError(f"token file {path!r}: {getattr(error, 'strerror', None) or error}") from None
    if not token or not token.isascii() or not token.isprintable() or " " in token:
        raise SettingsError(f"token file {path!r} is not a token: expected one line of printable ASCII without spaces")
    return token
