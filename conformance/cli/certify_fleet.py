"""``roaas certify --fleet``: certify several robots, write a page, return one exit code."""

import asyncio
import contextlib
import sys
from pathlib import Path

import click
from click.core import ParameterSource

from conformance.cli.certify_options import CertifyOptions
from conformance.cli.summary import warning
from conformance.commandline.endings import Started
from conformance.commandline.help_pages import inert
from conformance.commandline.result_command import CommandResult
from conformance.contract.locating import ContractError
from conformance.contract.pack import Contract
from conformance.fleet.fleet_file import TIME_LIMIT_S, FleetError, load_fleet, refuse_same_identity
from conformance.fleet.member_run import MemberResult, Outcome
from conformance.target.naming import lock_result_folder
from conformance.verdict.effort import DEEP_MINUTES
from conformance.verdict.finding import count_of

PARALLEL = 4
# Options that apply to each robot of a fleet; all others belong to one robot, in the fleet file.
_FOR_ALL = (
    "profile", "classes", "pack", "requirements", "effort", "minutes", "seed", "nonce", "timeout_s", "request_rate",
    "key", "trust_hosts", "select", "exclude",
)  # fmt: skip
_OWN = ("fleet", "parallel", "out", "allow_motion", "progress", "as_json")


def certify_fleet(path: Path, options: CertifyOptions) -> CommandResult:
    """Certify the robots of a fleet file.

    Raises:
        click.UsageError: the file is invalid, or an option is given that applies to a single robot.
    """
    from conformance.fleet.member_run import MemberRun  # noqa: PLC0415 - --help needs no asyncio
    from conformance.fleet.result import ROBOTS_FOLDER, FleetRun, exit_code, fleet_document, write_fleet  # noqa: PLC0415

    shared = _shared_options()
    try:
        members = load_fleet(path, Contract.load(options.pack))
        if options.key:
            refuse_same_identity(path, members)
    except (FleetError, ContractError) as error:
        raise click.UsageError(str(error)) from error
    lock_result_folder(options.out)
    deep_s = 60 * DEEP_MINUTES if options.effort == "deep" else 0
    limit_s = TIME_LIMIT_S + (60 * options.minutes if options.minutes else deep_s)
    runs = [
        MemberRun(
            member,
            options.out / ROBOTS_FOLDER / member.name,
            [*shared, *(["--allow-motion"] if options.allow_motion and member.movable else [])],
            member.time_limit_s or limit_s,
        )
        for member in members
    ]
    started = Started()
    parallel = options.parallel or PARALLEL

    def write(results: list[MemberResult], *, interrupted: bool) -> Path:
        document = fleet_document(
            results, started=started.at, finished=started.now, parallel=parallel, interrupted=interrupted
        )
        return write_fleet(document, options.out)

    def keep(results: list[MemberResult]) -> None:
        with contextlib.suppress(OSError):  # reported at the end: a full disk must not delay the other robots
            write(results, interrupted=True)

    async def judge() -> tuple[list[MemberResult], bool]:
        fleet = FleetRun(runs, parallel, None if options.progress == "none" else sys.stderr, keep)
        return await fleet.judge(), fleet.was_interrupted

    results, interrupted = asyncio.run(judge())
    try:
        written = write(results, interrupted=interrupted)
    except OSError as error:
        raise click.UsageError(f"--out {options.out}: {error}") from error
    if options.as_json:
        click.echo(written.read_text(encoding="utf-8"), nl=False)
    else:
        _print_summary(results)
        click.echo(f"result: {written}")
    return CommandResult(exit_code(results, interrupted=interrupted), written, tell=not options.as_json)


def _shared_options() -> list[str]:
    """Return the given options that apply to all robots.

    Raises:
        click.UsageError: an option is given that applies to a single robot.
    """
    context = click.get_current_context()
    shared: list[str] = []
    for parameter in context.command.params:
        name = parameter.name or ""
        if context.get_parameter_source(name) is not ParameterSource.COMMANDLINE or name in _OWN:
            continue
        if name not in _FOR_ALL:
            told = parameter.opts[0] if isinstance(parameter, click.Option) else parameter.make_metavar(context)
            raise click.UsageError(f"{told} belongs to one robot, and there is --fleet: write it into the fleet's file")
        values = context.params[name] if parameter.multiple else [context.params[name]]
        shared += [word for value in values for word in (parameter.opts[0], str(value))]
    return shared


def _print_summary(results: list[MemberResult]) -> None:
    """Print one line for each robot: its verdict, and the classes it passed."""
    width = max(len(result.member.name) for result in results)
    for result in results:
        if said := warning(result.document or {}, f"{result.member.name}: "):
            click.secho(said, fg="red", nl=False)
    click.echo()
    for result in results:
        trusted = ", ".join(result.trusted_classes)
        reason = f": {result.reason}" if result.reason and not trusted else ""
        told = f"may be trusted with {trusted or 'nothing'}{reason}"
        click.echo(f"  {result.member.name:<{width}}  {result.outcome:<14}  {inert(told)}")
    count = sum(result.outcome is Outcome.CONFORMANT for result in results)
    click.echo(f"\n{count} of {count_of(len(results), 'robot')} conformant")
