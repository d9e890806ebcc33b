"""``roaas certify --init``: write a first statement from the robot's descriptions."""

import json
import sys
from pathlib import Path
from typing import Any

from conformance.commandline.help_pages import inert
from conformance.commandline.out_folder import write_atomically
from conformance.contract.classes import Interface
from conformance.contract.pack import Contract
from conformance.contract.toml_file import basic_string
from conformance.engine.robot_under_test import RobotUnderTest
from conformance.statement.statement import Statement
from conformance.target.connecting import connection_of
from conformance.transport.client import HttpClient
from conformance.transport.exchange import NoAnswerError
from conformance.verdict.run import Run

_TEMPLATE = """\
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
        _TEMPLATE.format(
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
    for key, interface, value in (
        ("rest", Interface.REST, where.rest),
        ("publishers_wsdl", Interface.PUBLISHERS, where.publishers_wsdl),
        ("subscribers_wsdl", Interface.SUBSCRIBERS, where.subscribers_wsdl),
        ("publishers_endpoint", Interface.PUBLISHERS, where.publishers_endpoint),
        ("subscribers_endpoint", Interface.SUBSCRIBERS, where.subscribers_endpoint),
    ):
        why = inert(robot.run.unreachable.get(interface, ""))
        remark = f"  # did not answer: {why}" if why else ""
        lines.append(f"{key} = {_quote(value)}{remark}" if value else f'# {key} = ""')
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
