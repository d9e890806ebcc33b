"""``roaas certify --init`` for a device that is judged by its own description: a statement with its operations."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import msgspec

from conformance.api.call_rules import CallRules
from conformance.commandline.out_folder import write_atomically
from conformance.contract.toml_file import basic_string
from conformance.documents.description import Description, DescriptionError, is_url
from conformance.documents.json_schema import UnresolvedError, kinds_of
from conformance.documents.openapi import Operation, read_operations
from conformance.documents.writing import json_text
from conformance.engine.first_motion import proposed_map, why_no_map
from conformance.statement.endpoints import Endpoints
from conformance.statement.statement import Api, Calls

# _MOST_REASONS: operations without a proposed map that a comment names. _TEMPLATE: a first statement.
_MOST_REASONS = 20
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
        ros: makes the lines of a ROS map of the operations; None: there is none.

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
