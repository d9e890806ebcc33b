"""The target of ``roaas certify``: arguments and options as a statement and a contract."""

from __future__ import annotations

import difflib
import itertools
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, Final, NamedTuple, Self

import click
import msgspec

from conformance.commandline.device_options import advice
from conformance.commandline.extras import lacking_ros, lacking_soap
from conformance.commandline.help_pages import USUAL_STATEMENT
from conformance.commandline.out_folder import FolderError, hold, own_folder, write_atomically, write_json
from conformance.contract.described import MOTION, ROS, STATES
from conformance.contract.pack import DEFAULT_PACK, Contract
from conformance.contract.toml_file import basic_string
from conformance.documents.description import is_url
from conformance.documents.openapi import operations_of
from conformance.statement.endpoints import Endpoints
from conformance.statement.motion_calls import named_by
from conformance.statement.motion_map import MotionMap
from conformance.statement.ros_map import RosMap
from conformance.statement.statement import (
    Api,
    Calls,
    Statement,
    StatementError,
    api_of,
    bridge_in,
    empty_statement,
    endpoints_of,
    load_statement,
    maps_in,
)
from conformance.target.connecting import connection_of, place_api_key
from conformance.target.describing import described_contract, is_wsdl, soap_contract

_BY_MAP: Final = "--ros and --ros-play judge a gateway by its ROS map: give"


@dataclass(frozen=True)
class DeviceOptions:
    """A command's options on a device, which override the statement.

    Attributes:
        endpoints: the given fields of Endpoints, by name.
        pack: the contract pack.
        out: folder of the results, in which the pack of a description is written.
        overlays, base_url, wsdl, schemas, allow_files: as in Api; on the device's description.
        profile, classes: what is claimed.
        allow, never: patterns of operations that may or must not be called.
        ros_domain_id: the device's ROS domain, or None.
        ros, ros_play: whether a gateway is judged by its ROS map; with the suite in the robot's place.
    """

    endpoints: Mapping[str, Any] = field(default_factory=dict)
    pack: Path | str = DEFAULT_PACK
    out: Path = Path("out")
    overlays: tuple[str, ...] = ()
    base_url: str | None = None
    wsdl: str | None = None
    schemas: Path | None = None
    allow_files: bool = False
    profile: str | None = None
    classes: tuple[str, ...] = ()
    allow: tuple[str, ...] = ()
    never: tuple[str, ...] = ()
    ros_domain_id: int | None = None
    ros: bool = False
    ros_play: bool = False

    @property
    def moves(self) -> bool:
        """Return whether the run finds its motion map by driving, so that the statement needs none."""
        return False

    @classmethod
    def of(cls, options: Mapping[str, Any], **own: Any) -> Self:
        """Return the options of a command by their names in Python; ``own`` overrides them."""
        given = {name: value for name, value in {**options, **own}.items() if value is not None and value != ()}
        where = {name: given[name] for name in Endpoints.__struct_fields__ if name in given}
        known = {one.name for one in fields(cls)} - {"endpoints"}
        return cls(where, **{name: value for name, value in given.items() if name in known})

    def apply(self, endpoints: Endpoints) -> Endpoints:
        """Return endpoints with those given by the command."""
        return msgspec.structs.replace(endpoints, **self.endpoints)


class Judged(NamedTuple):
    """The statement and contract by which a device is judged, with remarks for the reader of the result."""

    statement: Statement
    contract: Contract
    remarks: tuple[str, ...] = ()


# A host with a port or with a dot in its name, and perhaps a path.
_ADDRESS: Final = re.compile(r"(\[[0-9a-fA-F:]+\]|[\w-]+(\.[\w-]+)*)(:\d{1,5}(/.*)?|/.*(openapi|swagger|wsdl|api).*)")
# Names in a folder that are searched for a similar one.
_MOST_NAMES: Final = 1000
# Options for a robot with the paper's contract alone.
_PAPERS: Final = ("publishers_wsdl", "subscribers_wsdl", "publishers_endpoint", "subscribers_endpoint")
# The options that name a device, by their names in Python.
_NAMES: Final = (
    "openapi", "wsdl", "rest", "publishers_wsdl", "subscribers_wsdl", "publishers_endpoint", "subscribers_endpoint",
    "rosbridge", "fleet", "init",
)  # fmt: skip


def targets_or_roaas_toml(targets: tuple[str, ...], options: Mapping[str, Any]) -> tuple[str, ...]:
    """Return a command's arguments, or ./roaas.toml if they name no device, which is printed on stderr."""
    if targets or any(options.get(name) for name in _NAMES) or not USUAL_STATEMENT.is_file():
        return targets
    click.echo(f"statement: {USUAL_STATEMENT}", err=True)
    return (str(USUAL_STATEMENT),)


def split_args(targets: tuple[str, ...], openapi: str | None, *, new: bool = False) -> tuple[str | None, Path | None]:
    """Return the description and the statement that the command names; either may be None.

    Args:
        targets: the arguments.
        openapi: the description that an option names.
        new: whether the statement is yet to be written.

    Raises:
        click.UsageError: two descriptions or two statements are named, or there is no such file.
    """
    for target in targets:
        if not is_url(target, bridge=True) and not Path(target).exists() and not (new and target.endswith(".toml")):
            raise click.UsageError(_no_file(target))
    described = [
        target
        for target in targets
        if is_url(target, bridge=True) or target.endswith((".json", ".yaml", ".yml", ".wsdl"))
    ]
    statements = [target for target in targets if target not in described]
    described += [openapi] if openapi else []
    for what, named in (("descriptions", described), ("statements", statements)):
        if len(named) > 1:
            raise click.UsageError(f"{' and '.join(named)} are several {what}: name one")
    return next(iter(described), None), Path(statements[0]) if statements else None


def _no_file(target: str) -> str:
    """Return the error text for an argument that is neither a URL nor a file."""
    scheme, found, _ = target.partition("://")
    if found:
        return f"{target}: {scheme}:// is not read; give the address as http:// or https://"
    if _ADDRESS.fullmatch(target):
        return f"there is no file {target}; an address needs http:// or https:// before it: http://{target}"
    folder = Path(target).parent
    names = (str(path) for path in itertools.islice(folder.glob("*"), _MOST_NAMES) if path.is_file())
    near = difflib.get_close_matches(str(folder / Path(target).name), names, 1)
    return f"there is no file {target}" + (f"; did you mean {near[0]}?" if near else "")


def what_is_judged(source: str | None, statement: Path | None, options: DeviceOptions) -> Judged:
    """Return the statement and contract by which a device is judged.

    Raises:
        DescriptionError, StatementError, ContractError: one of them cannot be used.
        UnreachableError: the server of the description does not respond.
    """
    contract = Contract.load(options.pack)
    if source and not is_url(source) and is_url(source, bridge=True):
        if not options.ros_play:
            ways = "`roaas certify --ros-play` judges it, or `roaas certify --ros` by a statement with its map"
            raise StatementError(f"{source} is a rosbridge: {ways}")
        statement, source = usual_map(source, options.ros_domain_id or 0, options.out), None
    if statement and (bridge := bridge_in(statement)):
        # Nothing else of a web API can be asked of a WebSocket.
        source = description_of(bridge, options.out)
        options = replace(options, classes=options.classes or (ROS,))
    api = api_of(statement) if statement else None
    source = source or (api.openapi or api.wsdl if api else None)
    if source is not None:
        return _judge_described(source, api, statement, options)
    if options.ros or options.ros_play:
        raise StatementError(f"{_BY_MAP} a statement with [api], as it goes by the gateway's own description")
    declared = load_statement(statement, contract) if statement else empty_statement(contract)
    return Judged(_apply(declared, options, contract), contract)


def _judge_described(source: str, api: Api | None, statement: Path | None, options: DeviceOptions) -> Judged:
    """Return the statement and contract of a device that is judged by its own description.

    Raises:
        DescriptionError, StatementError, ContractError: one of them cannot be used.
        UnreachableError: the server of the description does not respond.
    """
    for name in _PAPERS:
        if name in options.endpoints:
            raise StatementError(
                f"--{name.replace('_', '-')} is for a robot with the paper's contract, and this device is judged by "
                f"its description {source}: leave one of them out"
            )
    where = options.apply(endpoints_of(statement) if statement else Endpoints())
    api = api or Api()
    base_url = options.base_url or api.base_url
    soap = is_wsdl(source) or source in {options.wsdl, api.wsdl}
    _check_soap(["soap"] if soap else [])
    try:
        # The description may say where the API key goes, so it is fetched without the key.
        connection = connection_of(where if where.api_key else msgspec.structs.replace(where, api_key_file=None))
        more: dict[str, Any] = {
            "mapped": _map_classes(statement, options),
            "allow_files": options.allow_files or api.allow_files,
        }
        if soap:
            schemas = options.schemas or (Path(api.schemas) if api.schemas else None)
            contract, where, remarks = soap_contract(
                source, base_url, where, connection, options.out, schemas=schemas, **more
            )
        else:
            contract, where, remarks = described_contract(
                source, options.overlays or api.overlays, base_url, where, connection, options.out, **more
            )
    except OSError as error:
        raise StatementError(str(error)) from error
    declared = load_statement(statement, contract) if statement else empty_statement(contract)
    _check_map(declared, contract)
    if options.ros_play:
        # The suite is the robot, and it does not move.
        declared = msgspec.structs.replace(declared, motion_map=None, state_map=None)
    if soap and declared.motion_map is not None:
        _check_messages(declared.motion_map, contract)
    where = place_api_key(where, contract.openapi)
    return Judged(_apply(msgspec.structs.replace(declared, endpoints=where), options, contract), contract, remarks)


def _map_classes(statement: Path | None, options: DeviceOptions) -> tuple[str, ...]:
    """Return the classes that the maps of a statement claim.

    Raises:
        StatementError: a gateway is to be judged, and has no map.
        click.UsageError: ROS is not installed.
    """
    maps = maps_in(statement) if statement else ()
    moves = ((MOTION,) if options.moves or "motion" in maps else ()) + ((STATES,) if "states" in maps else ())
    if not (options.ros or options.ros_play):
        return moves
    moves = () if options.ros_play else moves
    if "ros" not in maps:
        raise StatementError(f"{_BY_MAP} a statement with a table [ros]: docs/ros-gateway.md shows one")
    if problem := lacking_ros("judging a ROS gateway"):
        raise click.UsageError(problem)
    return (*moves, ROS)


def _check_map(declared: Statement, contract: Contract) -> None:
    """Check that the description has the operations that the maps name.

    Raises:
        StatementError: it lacks one.
    """
    labels = [operation.label for operation in operations_of(contract)]
    calls = [("motion", call) for call in (declared.motion_map.calls if declared.motion_map else ())]
    calls += [("ros.operations", call) for call in (declared.ros_map.describable if declared.ros_map else ())]
    calls += [("states", call) for call in (declared.state_map.calls if declared.state_map else ())]
    for table, call in calls:
        if not named_by([call], labels):
            near = difflib.get_close_matches(call, labels, 1, 0)
            raise StatementError(
                f"[{table}] names {call!r}, which the description does not have"
                + (f"; did you mean {near[0]!r}?" if near else "")
            )


def _check_messages(motion: MotionMap, contract: Contract) -> None:
    """Check that the messages of a WSDL have the elements that the motion map gives them.

    Raises:
        StatementError: they do not.
    """
    # xmlschema and lxml take a third of a second, which other devices need not pay.
    from conformance.documents.wsdl_pack import messages_of  # noqa: PLC0415
    from conformance.documents.xsd_shapes import NoElementError, node_of  # noqa: PLC0415

    declared = messages_of(contract)
    for call, body in motion.bodies:
        if body is not None and call in declared:
            try:
                node_of(declared[call], body)
            except NoElementError as error:
                raise StatementError(f"[motion] {call}: {error}") from error


def _apply(declared: Statement, options: DeviceOptions, contract: Contract) -> Statement:
    """Return the statement with the options applied, which override it.

    Raises:
        StatementError: an option has an invalid value.
    """
    where = options.apply(declared.endpoints)
    for key in ("rest", "publishers_endpoint", "subscribers_endpoint"):
        url = getattr(where, key)
        if url is not None and not url.startswith(("http://", "https://")):
            raise StatementError(f"{key.replace('_', '-')} {url!r} is no URL: it has to start with http:// or https://")
    if not where.interfaces:
        raise StatementError(
            "no robot is named: give the URL of its description, as in `roaas certify http://robot:8000`, or "
            + advice("--rest, --publishers-wsdl or --subscribers-wsdl, or ")
            + "a STATEMENT with [endpoints]"
        )
    _check_soap(where.interfaces)
    claims = declared.claims
    if options.profile or options.classes:
        claims = _claims(options, contract)
    if options.ros_domain_id is not None:
        declared = declared.on_domain(options.ros_domain_id)
    calls = declared.calls
    if options.allow or options.never:
        calls = Calls((*calls.allow, *options.allow), (*calls.never, *options.never))
    return msgspec.structs.replace(declared, endpoints=where, claims=claims, calls=calls)


def _check_soap(interfaces: Iterable[str]) -> None:
    """Check that the libraries are installed by which these interfaces are judged.

    Raises:
        click.UsageError: one is missing.
    """
    problem = lacking_soap(interfaces)
    if problem:
        raise click.UsageError(problem)


def _claims(options: DeviceOptions, contract: Contract) -> tuple[str, ...]:
    """Return the classes that the options claim.

    Raises:
        StatementError: the contract has no such profile or class.
    """
    for option, names, known in (
        ("--profile", filter(None, [options.profile]), contract.profiles),
        ("--class", options.classes, contract.classes),
    ):
        for name in names:
            if name not in known:
                near = difflib.get_close_matches(name, known, 1)
                meant = f"did you mean {near[0]}? " if near else ""
                raise StatementError(f"{option} {name!r}: {meant}{contract.name} has {', '.join(known)}")
    return (*contract.profiles.get(options.profile or "", ()), *options.classes)


def lock_result_folder(out: Path) -> None:
    """Make the folder for results, and lock it against other runs until the command ends.

    Raises:
        click.UsageError: it cannot take the results.
    """
    try:
        click.get_current_context().with_resource(hold(out))
    except FolderError as error:
        raise click.UsageError(f"{advice('--out ')}{out}: {error}") from error


_MAP: Final = """# {url} as it was judged: change the topics and services, and give this file in place of the URL.
[ros]
domain_id = {domain_id}

[ros.rosbridge]
url = {url}
subscribe = {{ "/odom" = "nav_msgs/msg/Odometry", "/note" = "std_msgs/msg/String" }}
publish = {{ "/cmd_vel" = "geometry_msgs/msg/Twist", "/say" = "std_msgs/msg/String" }}
call = {{ "/enable" = "std_srvs/srv/SetBool" }}
"""


def usual_map(url: str, domain_id: int, out: Path) -> Path:
    """Write a statement with a usual map of a rosbridge; return its file.

    Raises:
        OSError: it cannot be written.
    """
    file = own_folder(out) / "rosbridge.toml"
    write_atomically(file, _MAP.format(url=basic_string(url), domain_id=domain_id))
    return file


def description_of(ros: RosMap, out: Path) -> str:
    """Write an OpenAPI description of a rosbridge's operations; return its file.

    Raises:
        OSError: it cannot be written.
    """
    paths: dict[str, dict[str, Any]] = {}
    for call in ros.calls:
        method, _, path = call.partition(" ")
        names = [
            {"name": name, "in": "path", "required": True, "schema": {"type": "string"}}
            for name in re.findall(r"\{(\w+)\}", path)
        ]
        responses = {"200": {"description": "what came"}}
        paths.setdefault(path, {})[method.lower()] = {"responses": responses, "parameters": names}
    server = {"url": ros.rosbridge.replace("ws", "http", 1)}
    info = {"title": "rosbridge", "version": "2"}
    file = own_folder(out) / "rosbridge.json"
    write_json(file, {"openapi": "3.1.0", "info": info, "servers": [server], "paths": paths})
    return str(file)
