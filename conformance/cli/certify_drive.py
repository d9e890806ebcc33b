"""``roaas certify --drive``: find a device's axes by driving it a little, after asking once, and judge its motion."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click
import msgspec
from click.core import ParameterSource

from conformance.commandline.help_pages import Group, inert, options_of
from conformance.commandline.out_folder import write_atomically
from conformance.contract.described import MOTION
from conformance.contract.toml_file import basic_string
from conformance.documents.openapi import Operation, operations_of, read_operations
from conformance.statement.motion_calls import named_by
from conformance.statement.statement import Calls, StatementError, motion_map_of
from conformance.target.describing import is_wsdl
from conformance.target.naming import Judged

if TYPE_CHECKING:
    from conformance.cli.certify_options import CertifyOptions
    from conformance.verdict.run import Run

_Command = TypeVar("_Command", bound=Callable[..., Any])
_OPTIONS = (
    click.option(
        "--drive",
        metavar="OPERATION",
        help="Judge how the robot moves, without a file: 'PUT /velocity' commands it. Its axes are found by driving it "
        "a little; asks before it moves.",
    ),
    options_of(Group.CALLS, rare=True),
    click.option("--read", metavar="OPERATION", help="With --drive: 'GET /state' tells where it is.  [default: found]"),
    click.option(
        "--before",
        multiple=True,
        metavar="OPERATION",
        help="With --drive: 'POST /enable' is sent before the robot can move; repeatable, with JSON behind it if it "
        "needs some.  [default: found]",
    ),
    click.option("--yes", is_flag=True, help="With --drive: move the robot without asking."),
    click.option(
        "--save-map",
        type=click.Path(dir_okay=False, path_type=Path),
        metavar="FILE",
        help="With --drive: write a statement with the map that was found.",
    ),
)


class NotShownError(Exception):
    """Raised when no reading shows that the robot follows commands; the message names the tries."""


def drive_options(command: _Command) -> _Command:
    """Add the options of a run that finds the motion map by itself."""
    for option in reversed(_OPTIONS):
        command = option(command)
    return command


def options_for(options: CertifyOptions, *, named: bool) -> CertifyOptions:
    """Return the options of a run; with --drive it judges motion alone, at quick effort, unless options say otherwise.

    Args:
        options: as they are given.
        named: whether a description or a statement is named.

    Raises:
        click.UsageError: they do not fit together, or nobody can be asked.
    """
    if options.drive is None:
        given = {
            "--read": options.read,
            "--before": options.before,
            "--yes": options.yes,
            "--save-map": options.save_map,
        }
        for name in (name for name, value in given.items() if value):
            raise click.UsageError(f"{name} says more on --drive: give --drive 'METHOD /path' as well")
        return options
    for name, value in (("--init", options.init), ("--plan", options.plan), ("--fleet", options.fleet)):
        if value:
            raise click.UsageError(f"--drive moves one robot, and {name} does not: give one of them")
    if not named:
        raise click.UsageError("--drive goes by the device's own description: name its URL or file")
    if not options.allow_motion:
        raise click.UsageError("--drive moves the robot: give --allow-motion, and give the robot room")
    if options.save_map and options.save_map.exists() and not options.force:
        raise click.UsageError(f"{options.save_map} exists already; --force overwrites it")
    if not (options.yes or sys.stdin.isatty()):
        raise click.UsageError("--drive asks before the robot moves, and nobody can answer here: give --yes")
    default = click.get_current_context().get_parameter_source("effort") is ParameterSource.DEFAULT
    classes = options.classes if options.classes or options.profile else (MOTION,)
    return replace(options, classes=classes, effort="quick" if default else options.effort)


def _read_description(judged: Judged) -> tuple[Sequence[Operation], str]:
    """Return the operations of the device's description, and its text on the whole API."""
    from conformance.documents.wsdl_pack import services_of, with_messages  # noqa: PLC0415 - lxml takes a while

    services = services_of(judged.contract)
    if services is not None:
        return read_operations(with_messages(services, judged.statement.values), closed=True), services.documentation
    info = judged.contract.openapi.get("info")
    return operations_of(judged.contract), str(info.get("description", "")) if isinstance(info, dict) else ""


def with_map(judged: Judged, options: CertifyOptions, run: Run, source: str | None) -> Judged:
    """Show the planned drive, ask for consent, drive the robot a little, and return the target with the found map.

    Raises:
        StatementError: the statement has a map, or the description says too little.
        NotShownError: no map could be found.
        KeyboardInterrupt: nobody wants it to move.
    """
    # Modules that talk to a device are imported late, so that --help stays quick.
    from conformance.api.permission import Permission  # noqa: PLC0415
    from conformance.api.rest.interface import RestInterface  # noqa: PLC0415
    from conformance.engine.finding import plan_of  # noqa: PLC0415
    from conformance.engine.found_positions import PositionFinder  # noqa: PLC0415
    from conformance.engine.found_velocities import VelocityFinder  # noqa: PLC0415
    from conformance.engine.guarded_finding import find_guarded  # noqa: PLC0415
    from conformance.scenarios.motion.binding import binding_of  # noqa: PLC0415
    from conformance.scenarios.scenario import NotPossibleError  # noqa: PLC0415
    from conformance.target.connecting import connection_of  # noqa: PLC0415
    from conformance.transport.client import HttpClient  # noqa: PLC0415

    statement = judged.statement
    if MOTION not in judged.contract.classes:
        raise StatementError("--drive is for a device that is judged by its own description: name its URL or file")
    if statement.motion_map is not None:
        raise StatementError("the statement has a motion map: leave --drive out, or take [motion] out")
    drive = options.drive or ""
    try:
        operations, text = _read_description(judged)
        plan = plan_of(operations, drive, options.read, options.calls, options.before, text)
        for line in plan.lines():
            click.echo(inert(line), err=True)
        if not options.yes and not click.confirm("May the robot move?", err=True):
            raise KeyboardInterrupt
        sent = named_by(plan.preparing.calls, [operation.label for operation in operations])
        calls = Calls((*statement.calls.allow, (plan.named or plan.drive).label, *sorted(sent)), statement.calls.never)
        run.statement = msgspec.structs.replace(statement, calls=calls)
        connection = connection_of(statement.endpoints)
        permission, base_url = Permission(run), statement.endpoints.rest or ""
        permission.may_call_ports(base_url)
        connection.permit = permission.refusal
        api = RestInterface(run, HttpClient(base_url, connection))
    except NotPossibleError as reason:
        raise StatementError(f"--drive: {reason}") from reason
    finder = VelocityFinder if plan.is_velocity else PositionFinder
    try:
        found = find_guarded(finder(api, binding_of(api), plan), api, partial(click.echo, err=True))
    except NotPossibleError as reason:
        raise NotShownError(str(reason)) from reason
    api.client.close()
    text = "\n".join(found.lines)
    for line in ("", "# The motion map that was found:", *found.lines, ""):
        click.echo(inert(line), err=True)
    motion = motion_map_of(text, f"the map of {drive}")
    if options.save_map:
        kind = "wsdl" if is_wsdl(source or "") or source == options.wsdl else "openapi"
        where = f"[api]\n{kind} = {basic_string(source)}\n\n" if source else ""
        write_atomically(options.save_map, f"{where}{text}\n")
        click.echo(f"wrote {options.save_map}", err=True)
    notes = tuple(f"Found by driving: {note}" for note in found.notes)
    return Judged(msgspec.structs.replace(statement, motion_map=motion), judged.contract, (*judged.remarks, *notes))
