"""``roaas certify --init``: write a first statement: operations, and a motion map as names suggest one."""

from __future__ import annotations

import json
import os
import posixpath
import re
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import msgspec

from conformance.api.call_rules import CallRules
from conformance.commandline.help_pages import inert
from conformance.commandline.out_folder import write_atomically
from conformance.contract.classes import Interface
from conformance.contract.pack import Contract
from conformance.contract.toml_file import basic_string
from conformance.documents.description import Description, DescriptionError, is_url
from conformance.documents.json_schema import Schema, UnresolvedError, kinds_of
from conformance.documents.openapi import Operation, read_operations
from conformance.documents.writing import json_text
from conformance.engine.commanded import (
    Commanded,
    axis_of,
    body_schema,
    bounds_of,
    commanded_by,
    is_velocity,
    numbers_in,
    parts_of,
    unit_of,
    with_query,
)
from conformance.engine.finding import stop_beside
from conformance.engine.map_text import direction_line, inline, key, template_of
from conformance.engine.robot_under_test import RobotUnderTest
from conformance.statement.endpoints import Endpoints
from conformance.statement.statement import Api, Calls, Statement
from conformance.target.connecting import connection_of
from conformance.transport.client import HttpClient
from conformance.transport.exchange import NoAnswerError
from conformance.verdict.run import Run

_CONTRACT_TEMPLATE = """\
# Implementation conformance statement: what the vendor says of the robot, and what it is then judged by.
# Written from the robot's own descriptions; look over every line, then: roaas certify {file} --allow-motion

[robot]
name = {name}
vendor = ""
version = {version}

[endpoints]
{endpoints}
# ca_file = "ca.pem"         # authorities to trust for https
# token_file = "token"       # holds a bearer token
# request_rate = 100         # ceiling, requests per second
# timeout_s = 10             # deadline of one request

[claims]
# profile = "full"           # claims all; beside or instead of single classes
classes = [
{claims}]
"""


def write_first_statement(path: Path, known: Statement, contract: Contract) -> str:
    """Connect to the robot and write a commented statement.

    Returns:
        Why the robot could not be reached, or an empty text.

    Raises:
        OSError: the file cannot be written.
    """
    robot = RobotUnderTest(Run(known, contract), connection_of(known.endpoints))
    robot.connect(sys.stderr)
    if not robot.was_reached:
        return "; ".join(f"{name}: {why}" for name, why in robot.run.unreachable.items())
    info = _openapi(robot.rest.client).get("info", {}) if robot.rest else {}
    info = info if isinstance(info, dict) else {}
    doubts = _doubts(robot)
    lines = [f'  "{name}",' if name not in doubts else f'  # "{name}",  # {doubts[name]}' for name in contract.classes]
    write_atomically(
        path,
        _CONTRACT_TEMPLATE.format(
            file=path.name,
            name=_quote(info.get("title", "")),
            version=_quote(info.get("version", "")),
            endpoints="\n".join(_endpoints(robot)),
            claims="".join(f"{line}\n" for line in lines),
        )
        + robot.device.statement_template,
    )
    return ""


def _quote(text: Any) -> str:
    return basic_string(str(text)[:200])


def _openapi(rest: HttpClient) -> dict[str, Any]:
    try:
        answer = rest.send("GET", "/openapi.json").response
        document = json.loads(answer.body) if answer.ok else {}
    except (NoAnswerError, ValueError, RecursionError):
        return {}
    return document if isinstance(document, dict) else {}


def _endpoints(robot: RobotUnderTest) -> list[str]:
    where = robot.run.statement.endpoints
    lines = []
    for name, interface, value in (
        ("rest", Interface.REST, where.rest),
        ("publishers_wsdl", Interface.PUBLISHERS, where.publishers_wsdl),
        ("subscribers_wsdl", Interface.SUBSCRIBERS, where.subscribers_wsdl),
        ("publishers_endpoint", Interface.PUBLISHERS, where.publishers_endpoint),
        ("subscribers_endpoint", Interface.SUBSCRIBERS, where.subscribers_endpoint),
    ):
        why = inert(robot.run.unreachable.get(interface, ""))
        remark = f"  # did not answer: {why}" if why else ""
        lines.append(f"{name} = {_quote(value)}{remark}" if value else f'# {name} = ""')
    return lines


def _descriptions_missing(robot: RobotUnderTest) -> list[str]:
    """Return the names of the descriptions that the robot does not serve."""
    asked: list[tuple[HttpClient, str, str]] = []
    if robot.rest:
        asked += [(robot.rest.client, path, path) for path in ("/openapi.json", "/application.wadl")]
    asked += [(there.client, f"{there.path}?wsdl", f"?wsdl of {name}") for name, there in robot.soap.there.items()]
    missing = []
    for client, path, told in asked:
        try:
            served = client.send("GET", path).response.ok
        except NoAnswerError:
            served = False
        if not served:
            missing.append(told)
    return missing


def _doubts(robot: RobotUnderTest) -> dict[str, str]:
    """Return, by class, why the robot does not seem to implement it."""
    unreached = robot.run.unreachable
    doubts: dict[str, str] = {
        name: f"no address for {' and '.join(missing)}"
        for name, missing in robot.run.statement.lacking(robot.run.contract).items()
    }
    for name, item in robot.run.contract.classes.items():
        silent = [interface for interface in item.interfaces if interface in unreached]
        if silent:
            doubts.setdefault(name, f"{' and '.join(silent)} did not answer")
    doubts = {**robot.device.doubts, **doubts}
    if "describe" not in doubts:
        missing = _descriptions_missing(robot)
        if missing:
            doubts["describe"] = f"the robot serves no {' and no '.join(missing)}"
    if robot.rest and "rest-formats" not in doubts:
        try:
            answer = robot.rest.client.send("GET", robot.rest.path, headers=[("Accept", "application/xml")]).response
            xml = answer.media_type == "application/xml"
        except NoAnswerError:
            xml = False
        if not xml:
            doubts["rest-formats"] = "the robot did not send XML when asked for it"
    return doubts


_GOES: Final = re.compile(r"goto|go_to|go-to|move|target|goal|pose|position|joint", re.IGNORECASE)
_STAMP: Final = re.compile(r"stamp|timestamp", re.IGNORECASE)
_MEASURED: Final = re.compile(r"twist|velocit|speed", re.IGNORECASE)


class _Pair(NamedTuple):
    """A command and where its effect is read: the commanded numbers, by their places in one state, or in one each."""

    state: Operation
    sent: Operation
    places: Mapping[str, Commanded]
    reads: Mapping[str, Operation] = {}


def proposed_map(operations: Sequence[Operation]) -> Iterator[str]:
    """Yield the lines of a map; nothing where no names suggest one.

    What is sent and what is read are taken for one axis if they have the same name.
    """
    reading = [item for item in operations if item.safe and item.shape]
    acting = [with_query(item) for item in operations if not (item.safe or item.never)]
    sending = [(item, numbers) for item in acting if (numbers := commanded_by(item))]
    goes = _best(reading, [one for one in sending if not is_velocity(*one) and _GOES.search(one[0].label)], _position)
    drives = _best(reading, [one for one in sending if is_velocity(*one)], _velocity)
    goes = goes or max(
        (pair for item in sending if not is_velocity(*item) if (pair := _axis_by_axis(reading, *item))),
        key=lambda pair: len(pair.places),
        default=None,
    )
    first = goes or drives
    if first is None:
        return
    # A map has one operation that reads everything.
    drives = drives if drives and drives.state is first.state else None
    schemas = dict(numbers_in(first.state.shape or {}))
    schemas |= {at: one.shape or {} for at, one in first.reads.items()}
    driven = {at: one for at, one in (drives.places if drives else {}).items() if not _MEASURED.search(at)}
    axes = {at: one.name for at, one in {**driven, **(goes.places if goes else {})}.items()}
    yield "[motion.state]"
    yield f"read = {basic_string(first.state.label)}"
    yield from (f"stamp = {basic_string(at)}" for at in _stamps(first.state.shape or {}))
    yield ""
    yield "[motion.state.axes]  # limits and units: yours"
    for at, name in axes.items():
        number = goes.places.get(at) if goes else None
        own_bounds = None if number is None or number.is_relative else number.bounds
        least, most = own_bounds or bounds_of(schemas[at]) or (-0.1, 0.1)
        own = "" if goes else ", tolerance = 0.05"
        unit = basic_string(unit_of(at, schemas[at]))
        read = first.reads.get(at, first.state)
        own += "" if read is first.state else f", read = {basic_string(read.label)}"
        place = basic_string(at.rpartition("#")[2])
        source = f"  # limits: {number.source}" if number and own_bounds else ""
        yield f"{key(name)} = {{ at = {place}, unit = {unit}, limits = [{least:g}, {most:g}]{own} }}{source}"
    if goes:
        yield ""
        yield "[motion.goto]"
        yield from _sending_lines(goes)
        if any(command.is_relative for command in goes.places.values()):
            yield "relative = true"
        yield "tolerance = 0.05"
    if first:
        yield from _stop(operations, first.sent)
    if drives:
        yield ""
        yield "[motion.velocity]"
        yield from _sending_lines(drives)
        yield "tolerance = 0.05"
        yield "# hold_s = 0.5  # so long after the last command it goes on"
        yield ""
        yield "[motion.velocity.axes]  # of: the axis that it changes, by scale at velocity 1"
        for at, one in drives.places.items():
            least, most = one.bounds or (-0.1, 0.1)
            where = f"of = {basic_string(axes[at])}" if at in axes else f"at = {basic_string(at)}"
            source = f"  # limits: {one.source}" if one.bounds else ""
            yield f"{key(one.name)} = {{ limits = [{least:g}, {most:g}], {where} }}{source}"


def why_no_map(operations: Sequence[Operation]) -> Iterator[str]:
    """Yield a sentence on each operation that may move the device, where no map is proposed."""
    for operation in (item for item in operations if not item.safe):
        named = "" if operation.never else ", ".join(number.name for number in commanded_by(operation))
        why = f"no GET tells numbers called {named}; --drive '{operation.label}' finds what shows them"
        none = "it must never be called" if operation.never else "it takes no numbers"
        yield f"{operation.label}: {why if named else none}."


def _sending_lines(pair: _Pair) -> Iterator[str]:
    """Yield how an operation is sent."""
    yield f"send = {basic_string(pair.sent.label)}"
    schema, numbers = body_schema(pair.sent), list(pair.places.values())
    if schema is not None:
        yield f"body = {inline(template_of(schema, {command.place: f'{{{command.name}}}' for command in numbers}))}"
    yield from (direction_line(command) for command in numbers if command.direction)


def _stop(operations: Sequence[Operation], move: Operation) -> Iterator[str]:
    """Propose the operation that stops a move."""
    if (found := stop_beside(operations, move)) is not None:
        yield ""
        yield "[motion.stop]"
        yield f"send = {basic_string(found.label)}"
        body = body_schema(found)
        if body is not None:
            yield f"body = {inline(template_of(body, {}))}  # an id of the move: " + '"{goto:/id}"'
        yield "rests_within_s = 0.5"


def _belongs(state: Operation, sent: Operation) -> bool:
    """Return whether the path of a state needs no other parameters than that of the command."""
    return {item.name for item in state.parameters if item.required} <= {item.name for item in sent.parameter("path")}


def _axis_by_axis(reading: Sequence[Operation], sent: Operation, numbers: Sequence[Commanded]) -> _Pair | None:
    """Return for each number the operation of the same name that reads it; None if a number has no such operation."""
    folder, reads, places = posixpath.dirname(sent.template), dict[str, Operation](), dict[str, Commanded]()
    for number in numbers:
        for state in reading:
            named = posixpath.basename(state.template).lower() == axis_of(number.place)
            values = [at for at, _ in numbers_in(state.shape or {}) if at.rpartition("/")[2].lower() == "value"]
            if named and values and posixpath.dirname(state.template) == folder and _belongs(state, sent):
                at = f"{number.name}#{values[0]}"
                reads[at], places[at] = state, number
                break
    return _Pair(next(iter(reads.values())), sent, places, reads) if len(places) == len(numbers) else None


def _best(
    reading: Sequence[Operation],
    sending: Sequence[tuple[Operation, Sequence[Commanded]]],
    place_of: Callable[[Commanded, Sequence[str]], str | None],
) -> _Pair | None:
    """Return the pair of operations for which the response of one contains most of what the other commands."""
    found = []
    for state in reading:
        told = [at for at, _ in numbers_in(state.shape or {})]
        for sent, numbers in ((sent, numbers) for sent, numbers in sending if _belongs(state, sent)):
            # The first of several numbers of one name: in an ONVIF vector, pan comes before zoom.
            places = {at: command for command in reversed(numbers) if (at := place_of(command, told)) is not None}
            found.append(_Pair(state, sent, places))
    return max(
        (pair for pair in found if pair.places),
        key=lambda pair: (len(pair.places), not any(one.is_relative for one in pair.places.values())),
        default=None,
    )


def _position(number: Commanded, told: Sequence[str]) -> str | None:
    """Return where a state contains the position of the commanded axis."""
    return next((at for at in told if not _MEASURED.search(at) and axis_of(at) == axis_of(number.place)), None)


def _velocity(number: Commanded, told: Sequence[str]) -> str | None:
    """Return where a state contains a velocity, or else the position that it changes."""
    measured = (at for at in told if _MEASURED.search(at) and f"{at}/".endswith(f"{number.place}/"))
    changed = (at for at in told if not _MEASURED.search(at) and axis_of(at) == axis_of(number.place))
    return next(measured, None) or (next(changed, None) if axis_of(number.place).strip("xyz") else None)


def _stamps(schema: Schema) -> list[str]:
    found = [f"/{name}" for part in parts_of(schema) for name in part.get("properties", {}) if _STAMP.search(name)]
    return found[:1]


_MOST_REASONS = 20  # operations without a proposed map that a comment names, at most
# A first statement.
_TEMPLATE = """\
# Statement on a device that is judged by its own description, and by what binds every web API.
# Written from the description; look over every line, then: roaas certify {file}

[robot]
name = {name}
vendor = ""
version = {version}

[api]
{api}

[endpoints]
# ca_file = "ca.pem"         # authorities to trust for https
# request_rate = 100         # ceiling, requests per second
# timeout_s = 10             # deadline of one request
{credentials}
[calls]
# Operations that may be called although they may change something: "METHOD PATH", an operationId or a tag; * is any
# text. What moves the device (x-roaas-motion in an overlay) also needs --allow-motion.
# {count}
allow = [
{allow}]
# Operations that must never be called, whatever else is said.
never = [{never}]

# How the device moves, so that its motion is judged as well: docs/motion.md.
{motion}
[values]
# Values for parameters that the description gives none for. Without them, ids are taken from what the device lists.
{values}{ros}"""
_ROS = """
# Which operation is what of the ROS graph: docs/ros-gateway.md. What is a guess is a comment.
"""


def write_described_statement(
    path: Path,
    found: Description,
    api: Api,
    calls: Calls,
    where: Endpoints,
    ros: Callable[[Sequence[Operation]], Iterator[str]] | None,
) -> None:
    """Write a commented statement for a device with a description.

    Args:
        path: the file to write.
        found: the description.
        api: overlays and base URL as the options give them.
        calls: what may be called as the options say it.
        where: credentials and the connection as the options give them.
        ros: makes the lines of a ROS map of the operations; None if there is none.

    Raises:
        DescriptionError: the description is malformed.
        OSError: the file cannot be written.
    """
    try:
        operations = read_operations(found.document, closed=True)
    except (UnresolvedError, AttributeError, TypeError, KeyError) as error:
        raise DescriptionError(f"{found.source} is no usable OpenAPI description: {error!r}") from error
    info = found.document.get("info")
    info = info if isinstance(info, dict) else {}
    rules = CallRules(calls.allow, calls.never)
    called = sum(rules.decide(item).may for item in operations)
    write_atomically(
        path,
        _TEMPLATE.format(
            file=path.name,
            name=basic_string(str(info.get("title", ""))[:200]),
            version=basic_string(str(info.get("version", ""))[:200]),
            api="\n".join(_api(path.parent, found, api)),
            credentials="".join(
                f"{line}\n" for line in (*_connection_lines(path.parent, where), *_credentials(found.document))
            ),
            count=f"Called are {called} of {len(operations)} operations. Take the # from a line to call it as well.",
            allow="".join(f"  {line}\n" for line in _groups(operations, rules)),
            never=", ".join(map(basic_string, calls.never)),
            motion="".join(f"# {line}".rstrip() + "\n" for line in _motion(operations)),
            values="".join(f"{line}\n" for line in _values(operations)) or "# id = [1, 2]\n",
            ros=_ROS
            + "".join(
                f"{line}\n"
                for line in ros(
                    [operation for operation in operations if operation.method != "GET" or rules.decide(operation).may]
                )
            )
            if ros
            else "",
        ),
    )


def _motion(operations: Sequence[Operation]) -> list[str]:
    """Return the lines of a motion map that the names suggest."""
    found = list(proposed_map(operations))
    lead = "Names in the description suggest this map. Complete it, and take the # away:"
    if found:
        return [lead, *found]
    reasons = list(why_no_map(operations))
    more = [f"Not shown: {len(reasons) - _MOST_REASONS}."] if len(reasons) > _MOST_REASONS else []
    states = "If operations are allowed in some states alone, a map of states judges them: [states] in docs/motion.md."
    lines = ["No map is proposed.", *map(_one_line, reasons[:_MOST_REASONS]), *more, states]
    return lines if reasons else ["No map is proposed: no operation changes anything."]


def _api(folder: Path, found: Description, api: Api) -> Iterator[str]:
    yield f"{'wsdl' if api.wsdl else 'openapi'} = {basic_string(_beside(folder, found.source))}"
    overlays = ", ".join(basic_string(_beside(folder, overlay)) for overlay in api.overlays)
    yield f"overlays = [{overlays}]" if overlays else '# overlays = ["overlay.yaml"]  # OpenAPI Overlays to apply to it'
    if api.base_url:
        yield f"base_url = {basic_string(api.base_url)}"
    elif found.base_url:
        yield f"# base_url = {basic_string(found.base_url)}  # where the operations are, by the description"
    else:
        yield '# base_url = "http://robot:8000"  # needed: the description does not say where the operations are'


def _beside(folder: Path, source: str) -> str:
    """Return a file's name relative to a folder; a URL stays unchanged."""
    return source if is_url(source) else Path(os.path.relpath(source, folder)).as_posix()


def _connection_lines(folder: Path, where: Endpoints) -> Iterator[str]:
    """Yield what the options say of the connection."""
    for name, value in msgspec.structs.asdict(where).items():
        if name != "rest" and value != getattr(Endpoints(), name):
            text = _beside(folder, value) if name.endswith("_file") else value
            yield f"{name} = {json_text(list(text) if isinstance(text, tuple) else text)}"


def _credentials(document: dict[str, Any]) -> Iterator[str]:
    """Yield hints on the credentials that the description asks for."""
    components = document.get("components")
    schemes = components.get("securitySchemes") if isinstance(components, dict) else None
    for name, scheme in schemes.items() if isinstance(schemes, dict) else ():
        kind = scheme.get("type", "") if isinstance(scheme, dict) else ""
        how = [kind, *(str(scheme[key]) for key in ("scheme", "in", "name") if kind and key in scheme)]
        yield f"# The description names the security scheme {_one_line(name)}: {_one_line(' '.join(how))}."
    yield '# token_file = "token"       # holds a bearer token'
    yield '# api_key_file = "key"       # holds an API key, sent where the description says'
    yield ""
    yield "# [auth]                     # a login before the run, whose token all requests carry"
    yield '# login = "POST /login"'
    yield '# body_file = "login.json"   # its content, for example a user name and a password'
    yield '# token = "/access_token"    # where the response has the token'


def _groups(operations: Sequence[Operation], rules: CallRules) -> Iterator[str]:
    """Yield the lines of ``allow``: given patterns, then all operations by group, most as comments."""
    for pattern in rules.allow:
        yield f"{basic_string(pattern)},"
    first = Counter(_segments(item)[:1] for item in operations)
    shared = {segment for segment, count in first.items() if count > len(operations) / 2}
    groups: dict[str, list[Operation]] = {}
    for operation in operations:
        groups.setdefault(_group(operation, shared), []).append(operation)
    for name, items in groups.items():
        yield f"# -- {_one_line(name)}"
        for operation in items:
            reason, label = rules.decide(operation), basic_string(operation.label)
            why = str(reason).partition(":")[0] + "; it moves the device, so --allow-motion too" * operation.motion
            if operation.stop:
                yield f"# sent at the end, to stop the device: {_one_line(operation.label)}"
            else:
                yield f"# called: {_one_line(operation.label)}" if reason.may else f"# {label},  # {why}"


def _group(operation: Operation, shared: set[tuple[str, ...]]) -> str:
    """Return the group of an operation: its first tag, or the first segment of its path that most do not share."""
    segments = _segments(operation)
    own = segments[1:] if segments[:1] in shared and len(segments) > 1 else segments
    return str(next(iter(operation.tags), next(iter(own), "/")))


def _segments(operation: Operation) -> tuple[str, ...]:
    return tuple(part for part in operation.template.split("/") if part and "{" not in part)


def _values(operations: Iterable[Operation]) -> Iterator[str]:
    """Yield a comment for each name of a required parameter without examples and known values, with an operation."""
    told: dict[str, str] = {}
    for operation in operations:
        for parameter in operation.parameters:
            known = parameter.examples or {"default", "enum", "const", "example", "examples"} & parameter.schema.keys()
            if parameter.required and not known and kinds_of(parameter.schema) != {"boolean"}:
                told.setdefault(parameter.name, operation.label)
    for name, label in told.items():
        yield f"# {basic_string(name)} = []  # {_one_line(label)}"


def _one_line(text: str) -> str:
    """Return text that can stand in a comment: printable, and on one line."""
    return " ".join("".join(char if char.isprintable() else " " for char in text).split())[:200]
