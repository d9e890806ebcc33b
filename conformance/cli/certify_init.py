"""``roaas certify --init``: write a first statement."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import click

from conformance.commandline.exit_codes import ExitCode
from conformance.commandline.extras import lacking_ros
from conformance.commandline.help_pages import inert
from conformance.commandline.result_command import CommandResult
from conformance.contract.pack import Contract
from conformance.documents.description import Description
from conformance.statement.endpoints import Endpoints
from conformance.statement.ros_map import RosMap
from conformance.statement.statement import Api, Calls, Statement, StatementError
from conformance.target.connecting import connection_of
from conformance.target.describing import fetch_description, is_wsdl, trusting
from conformance.target.naming import DeviceOptions, what_is_judged
from conformance.transport.client import HttpClient
from ros_probe.process import ProbeError


def init(path: Path | None, chosen: Statement, contract: Contract, *, force: bool) -> CommandResult:
    """Write a statement for a robot with a contract.

    Raises:
        click.UsageError: no file is named, or it exists.
    """
    from conformance.engine.first_described import write_first_statement  # noqa: PLC0415 - only --init needs it

    path = _new_file(path, force=force)
    problem = write_first_statement(path, chosen, contract)
    if problem:
        click.echo(f"the robot cannot be reached: {inert(problem)}", err=True)
        return CommandResult(ExitCode.UNREACHABLE)
    click.echo(f"wrote {path}: look it over, then run `roaas certify {path}`")
    return CommandResult(ExitCode.PASSED)


def _new_file(path: Path | None, *, force: bool) -> Path:
    """Return the file that --init writes.

    Raises:
        click.UsageError: none is named, or it exists.
    """
    if path is None:
        raise click.UsageError("--init writes a statement: name the file, as in `roaas certify --init robot.toml`")
    if path.exists() and not force:
        raise click.UsageError(f"{path} exists already; --force overwrites it")
    return path


def init_described(path: Path | None, source: str, options: DeviceOptions, *, force: bool) -> CommandResult:
    """Write a statement for a device with a description.

    Raises:
        DescriptionError: there is no usable description.
        StatementError: a file cannot be read or written.
        UnreachableError: the server of the description does not respond.
    """
    from conformance.engine.first_described import write_described_statement  # noqa: PLC0415 - only --init needs it
    from conformance.engine.first_ros import ros_proposals  # noqa: PLC0415 - as above

    path = _new_file(path, force=force)
    where = options.apply(Endpoints())
    if options.ros and (problem := lacking_ros("proposing a ROS map")):
        raise click.UsageError(problem)
    wsdl = source if is_wsdl(source) or source == options.wsdl else None
    api = Api(overlays=options.overlays, base_url=options.base_url or where.rest, wsdl=wsdl)
    try:
        found = (
            _read_wsdl(source, options)
            if wsdl
            else fetch_description(
                source, api.overlays, connection_of(where), api.base_url, allow_files=options.allow_files
            )
        )
        base_url = api.base_url or found.base_url
        if options.ros and not base_url:
            raise StatementError(f"{source} does not say where the operations are: give --base-url")
        connection = connection_of(where)
        connection.trust = trusting(connection, source, api.base_url)
        client = HttpClient(base_url or "", connection)
        domain_id = RosMap({}, domain_id=options.ros_domain_id).domain
        ros = partial(ros_proposals, domain_id=domain_id, client=client, is_soap=bool(wsdl)) if options.ros else None
        write_described_statement(path, found, api, Calls(options.allow, options.never), where, ros)
    except (OSError, ProbeError) as error:
        raise StatementError(str(error)) from error
    for remark in (*found.elsewhere, *found.remarks, *found.not_called, *found.unread):
        click.echo(inert(remark), err=True)
    click.echo(f"wrote {path}: look it over, then run `roaas certify {path}`")
    return CommandResult(ExitCode.PASSED)


def _read_wsdl(source: str, options: DeviceOptions) -> Description:
    """Return what a WSDL describes in the form of other descriptions, with its messages as if they were JSON."""
    from conformance.documents.wsdl_pack import services_of, with_messages  # noqa: PLC0415 - lxml takes a while

    with TemporaryDirectory() as folder:
        judged = what_is_judged(source, None, replace(options, out=Path(folder), ros=False, ros_domain_id=None))
        services = services_of(judged.contract)
        document = with_messages(services, {}) if services else judged.contract.openapi
    return Description(source, document, document, judged.statement.endpoints.rest or "", unread=judged.remarks)
