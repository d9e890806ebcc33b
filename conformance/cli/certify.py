"""``roaas certify``: read the options, run the certification, print the verdict, return the exit code."""

from __future__ import annotations

import datetime as dt
import difflib
import gc
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from conformance.api.call_rules import CallRules, plan_lines
from conformance.cli.certify_drive import NotShownError, drive_options, options_for, with_map
from conformance.cli.certify_init import init, init_described
from conformance.cli.certify_options import CertifyOptions
from conformance.cli.selecting import SelectionError, failed_before, select_ids
from conformance.cli.summary import print_summary
from conformance.commandline.device_options import credential_options, description_options
from conformance.commandline.endings import end_like_ctrl_c, end_with_parent
from conformance.commandline.exit_codes import ExitCode
from conformance.commandline.help_pages import Group, inert, options_of
from conformance.commandline.out_folder import command_without_folders
from conformance.commandline.result_command import CommandResult, FrontDoor, ResultCommand
from conformance.contract.locating import ContractError
from conformance.contract.pack import DEFAULT_PACK, Contract
from conformance.contract.places import places
from conformance.contract.requirement_sets import RequirementSetError, judged_by
from conformance.documents.description import DescriptionError, is_url
from conformance.documents.openapi import operations_of
from conformance.statement.statement import Statement, StatementError, api_of
from conformance.target.naming import Judged, lock_result_folder, split_args, targets_or_roaas_toml, what_is_judged
from conformance.transport.reach import UnreachableError
from conformance.verdict.effort import DEEP_MINUTES, EFFORTS, Effort
from conformance.verdict.finding import count_of

if TYPE_CHECKING:
    from conformance.engine.certification import Certification
    from conformance.verdict.run import Run

_POSITIVE = click.FloatRange(min=0, min_open=True)
_FILE = click.Path(exists=True, dir_okay=False)
_START = """\
Judge a device by its own OpenAPI description or WSDL. Only what reads is called, so nothing moves:
  roaas certify http://robot:8000/openapi.json

Call operations that change something as well:
  roaas certify http://robot:8000/openapi.json --call 'POST /api/move/*'

See whether it moves and stops as told; this moves it:
  roaas certify http://robot:8000/openapi.json --drive 'PUT /velocity' --allow-motion"""


@click.command(cls=ResultCommand, start=_START)
@click.argument("targets", nargs=-1, metavar="[DESCRIPTION] [STATEMENT]")
@options_of(Group.DEVICE)
@click.option("--init", is_flag=True, help="Write a commented STATEMENT from the device's descriptions; test nothing.")
@click.option(
    "--ros",
    is_flag=True,
    help="Judge a ROS 2 web gateway by its ROS map, from both ends; with --init: propose the map.",
)
@click.option("--ros-play", is_flag=True, help="Like --ros, but the suite plays the robot: none is needed.")
@options_of(Group.DEVICE, rare=True)
@click.option("--force", is_flag=True, help="With --init: overwrite STATEMENT.")
@click.option("--rest", metavar="URL", help="Base URL of the REST interface.")
@click.option("--publishers-wsdl", metavar="URL", help="WSDL of the publishers service, URL or file.")
@click.option("--subscribers-wsdl", metavar="URL", help="WSDL of the subscribers service, URL or file.")
@click.option("--publishers-endpoint", metavar="URL", help="Address of the publishers service, if not its WSDL's.")
@click.option("--subscribers-endpoint", metavar="URL", help="Address of the subscribers service, if not its WSDL's.")
@click.option(
    "--ros-domain-id",
    type=click.IntRange(0, 232),
    help="ROS domain of the robot: observe its topics with a probe (needs rclpy).",
)
@click.option("--fleet", type=_FILE, metavar="FILE", help="Test several robots, each in its own process (TOML).")
@click.option(
    "--parallel", type=click.IntRange(min=1), metavar="N", help="With --fleet: at most N robots at once.  [default: 4]"
)
@description_options
@options_of(Group.CALLS)
@click.option(
    "--allow-motion", is_flag=True, help="Allow the suite to move the robot; most of the paper's contract needs that."
)
@drive_options
@options_of(Group.CALLS)
@click.option(
    "--request-rate", type=click.FloatRange(min=1), metavar="R", help="At most R requests per second, 1 or more."
)
@options_of(Group.CREDENTIALS)
@click.option("--token-file", type=_FILE, help="File with the bearer token to send.")
@click.option("--ca-file", type=_FILE, help="Certificate authorities (PEM) to trust for HTTPS instead of the system's.")
@credential_options
@options_of(Group.EFFORT)
@click.option("--effort", type=click.Choice(EFFORTS), default="standard", help="How many cases to test.")
@click.option("--minutes", type=_POSITIVE, metavar="M", help="Send requests for about M minutes, the usual ones first.")
@click.option("--class", "classes", multiple=True, metavar="NAME", help="Claim a conformance class; repeatable.")
@click.option(
    "--select",
    multiple=True,
    metavar="ID|CLASS",
    help="Judge only these requirements: http, http/date or 'http/*'; repeatable.",
)
@click.option("--exclude", multiple=True, metavar="ID|CLASS", help="Judge all but these requirements; repeatable.")
@click.option("--last-failed", is_flag=True, help="Judge only what failed in the result that is in the --out folder.")
@click.option("-x", "--exit-first", is_flag=True, help="End the run at the first failure of a MUST.")
@click.option("--plan", is_flag=True, help="Print the scenarios and checks in their order; send nothing.")
@options_of(Group.EFFORT, rare=True)
@click.option("--profile", metavar="NAME", help="Claim the classes of a profile of the contract, such as full.")
@click.option(
    "--contract",
    "pack",
    metavar="PACK",
    default=DEFAULT_PACK,
    help="Contract pack to test against: its name, or its folder, whose code is run.",
)
@click.option(
    "--requirements",
    metavar="SET",
    help="Only this frozen set of requirements counts; newer ones are shown.  [default: all]",
)
@click.option(
    "--seed",
    type=click.IntRange(min=0),
    default=0,
    help="Seed of all random choices: the same seed gives the same cases.",
)
@click.option("--nonce", metavar="TEXT", help="Text chosen by the relying party; the seed is derived from it.")
@click.option("--timeout", "timeout_s", type=_POSITIVE, metavar="S", help="Deadline of one request.  [default: 10]")
@click.option(
    "--restart-command",
    metavar="CMD",
    default="",
    show_default=False,
    help="Command that restarts a device that stopped responding, so that the run can go on.",
)
@click.option(
    "--wait", "wait_s", type=_POSITIVE, metavar="S", help="Wait S seconds for a lost device.  [default: 20 or 60]"
)
@options_of(Group.OUTPUT)
@click.option(
    "--out", type=click.Path(file_okay=False, path_type=Path), default=Path("out"), help="Folder for the results."
)
@click.option(
    "--baseline", type=click.Path(path_type=Path), help="Accepted failures, each with reason and expiry date (TOML)."
)
@click.option(
    "--write-baseline",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="Write what fails to a baseline, with today's date, for you to give reasons.",
)
@click.option("--json", "as_json", is_flag=True, help="Print result.json to stdout in place of the summary.")
@click.option("--quiet", "-q", "progress", flag_value="none", help="Write no progress; the same as --progress none.")
@options_of(Group.OUTPUT, rare=True)
@click.option(
    "--progress",
    type=click.Choice(["auto", "lines", "none"]),
    default="auto",
    help="What is written to stderr: auto is a bar on a terminal, and lines elsewhere.",
)
@click.option("--sign", "key", type=_FILE, metavar="KEY", help="Sign the result with this private key.")
@click.pass_obj
def certify(door: FrontDoor, /, targets: tuple[str, ...], **given: Any) -> CommandResult:
    """Judge a device by its own description, or by its contract.

    DESCRIPTION is the URL or file of an OpenAPI or Swagger description or of a WSDL: the device is judged by it and by
    what binds every web API. Only GET, HEAD and OPTIONS are sent, unless --call allows more.

    STATEMENT is the device's implementation conformance statement (TOML); options override it. If neither is given,
    it is roaas.toml in the working directory. If no classes are claimed, all are judged whose interface has an address.

    Exit code: 0 conformant, 1 not conformant, 2 usage, 3 robot not reached, 4 inconclusive, 130 interrupted.
    """
    # However it ends, a run has to stop the robot and write its result.
    end_like_ctrl_c()
    end_with_parent()
    options = CertifyOptions.of(given)
    if options.as_json and (options.plan or options.init):
        raise click.UsageError("--json prints the result of a run, and --plan and --init have none: give one of them")
    source, statement = None, None
    if not options.fleet:
        named = targets_or_roaas_toml(targets, given)
        source, statement = split_args(named, options.openapi or options.wsdl, new=options.init)
    options = options_for(options, named=bool(source or statement))
    if options.fleet:
        from conformance.cli.certify_fleet import certify_fleet  # noqa: PLC0415 - one robot needs nothing of it

        # Report wrong options once, before the first run starts.
        options.check_nonce()
        if options.key:
            door.notary(Path(options.key))
        return certify_fleet(Path(options.fleet), options)
    if options.parallel is not None:
        raise click.UsageError("--parallel says how many robots of a --fleet are judged at once: give --fleet")
    try:
        done = _carry_out(door, source, statement, options)
    except UnreachableError as unreachable:
        click.echo(f"the device cannot be reached: {inert(str(unreachable))}", err=True)
        return CommandResult(ExitCode.UNREACHABLE)
    except NotShownError as reason:
        click.echo(f"inconclusive: {inert(str(reason))}", err=True)
        return CommandResult(ExitCode.INCONCLUSIVE)
    except (StatementError, ContractError, DescriptionError) as error:
        raise click.UsageError(str(error)) from error
    except KeyboardInterrupt:
        return CommandResult(ExitCode.INTERRUPTED)
    # Exempt existing objects from the garbage collector, which would scan them all before the process ends (half a
    # second).
    gc.freeze()
    return done


def _carry_out(door: FrontDoor, source: str | None, statement: Path | None, options: CertifyOptions) -> CommandResult:
    """Carry out the options for one robot: write a first statement, print the plan, or certify.

    Raises:
        StatementError, ContractError, DescriptionError: one of the files cannot be used.
        UnreachableError: the server of the description does not respond.
    """
    if options.init and source is not None:
        return init_described(statement, source, options, force=options.force)
    if not (options.plan or options.init):
        lock_result_folder(options.out)
    judged = what_is_judged(source, statement if not options.init else None, options)
    chosen, contract, _ = judged
    if options.init:
        return init(statement, chosen, contract, force=options.force)
    options.check_nonce()
    options.check_new_baseline()
    # Before the run, so that a key that cannot sign is reported at once.
    notary = door.notary(Path(options.key), str(contract.directory)) if options.key else None
    if options.plan:
        return _plan(judged, options)
    if chosen.motion_map is not None and not contract.is_claimed:
        from conformance.engine.map_text import check_map  # noqa: PLC0415 - of a map alone

        check_map(_run(chosen, options, contract), statement)
    if options.drive:
        judged = with_map(judged, options, _run(chosen, options, contract), source)
    outcome = _certify(door, judged, options, statement, source)
    if outcome.unwritten:
        print_summary(outcome)
        kept = "What is printed is all that is kept" if outcome.path.parent == options.out else f"See {outcome.path}"
        where = inert(str(options.out))
        click.echo(f"error: the result could not be written to {where}: {inert(outcome.unwritten)}. {kept}", err=True)
        return CommandResult(outcome.exit_code)
    if options.as_json:
        click.echo(outcome.path.read_text(encoding="utf-8"), nl=False)
    else:
        print_summary(outcome)
        click.echo(f"result: {outcome.path}")
    if options.write_baseline:
        _write_baseline(options.write_baseline, outcome, contract, options.baseline)
    return CommandResult(outcome.exit_code, outcome.path, notary, tell=not options.as_json)


def _operations(told: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the operations of a failure in result.json; none if it is in doubt."""
    return [] if told.get("doubt") else told.get("operations", [])


def _write_baseline(path: Path, outcome: Certification, contract: Contract, old: Path | None) -> None:
    """Write the failures to a baseline file, and print what the user has to add."""
    from conformance.verdict.baseline import baseline_text, load_baseline  # noqa: PLC0415 - only for this option

    found = [
        (contract.ledger[item["id"]], {one["operation"] for told in item["failures"] for one in _operations(told)})
        for item in outcome.document["requirements"]
        if item["verdict"] == "fail" or "expected_failure" in item
    ]
    known = load_baseline(old, contract.ledger, contract.ids_by_alias) if old else ()
    today = dt.datetime.now(dt.UTC).date()
    path.write_text(baseline_text(found, known, today), encoding="utf-8")
    told = "Write a reason and a last day to each, then give it by --baseline." if found else "Nothing fails."
    click.echo(f"baseline: {path}, {count_of(len(found), 'failure')}. {told}", err=True)


def _plan(judged: Judged, options: CertifyOptions) -> CommandResult:
    """Print the plan of the run, and to stderr by which description it is made."""
    from conformance.engine.planning import plan_of  # noqa: PLC0415 - only --plan needs it
    from conformance.engine.robot_under_test import RobotUnderTest  # noqa: PLC0415 - as above

    for remark in judged.remarks:
        click.echo(inert(remark), err=True)
    for line in plan_of(RobotUnderTest(_run(judged.statement, options, judged.contract))):
        click.echo(line)
    return CommandResult(ExitCode.PASSED)


def _certify(
    door: FrontDoor | None, judged: Judged, options: CertifyOptions, statement: Path | None, source: str | None
) -> Certification:
    """Run one certification of the device that the statement and the contract in ``judged`` describe."""
    chosen, contract, remarks = judged
    # Imported here: Schemathesis and its like cost a second that --help and wrong usage need not pay.
    from conformance.engine.certification import certify as run_certification  # noqa: PLC0415
    from conformance.engine.robot_under_test import RobotUnderTest  # noqa: PLC0415
    from conformance.engine.suite import file_digest  # noqa: PLC0415
    from conformance.target.connecting import connection_of  # noqa: PLC0415
    from conformance.verdict.baseline import BaselineError, load_baseline  # noqa: PLC0415
    from conformance.verdict.run import Given  # noqa: PLC0415

    try:
        connection = connection_of(chosen.endpoints)
        if chosen.endpoints.ca_file:
            connection.tls()
        requirements = judged_by(contract, options.requirements)
        baseline = load_baseline(options.baseline, contract.ledger, contract.ids_by_alias) if options.baseline else ()
        given = Given(
            statement=file_digest(statement) if statement else None,
            baseline=file_digest(options.baseline) if options.baseline else None,
            nonce=options.nonce,
            places=_places(contract, statement, source),
        )
    except (OSError, BaselineError, RequirementSetError) as error:
        raise StatementError(str(error)) from error
    run = _run(chosen, options, contract)
    run.requirement_set, run.given = requirements, given
    run.selection = replace(run.selection, accepted=frozenset(entry.requirement for entry in baseline))
    run.restart_command, run.wait_s = options.restart_command, options.wait_s
    run.prepare = door.prepare if door else None  # without roaas.py there is no front door
    notes = (*remarks, *_notes(run))
    command = command_without_folders(sys.argv[1:], ("--call", "--never"))
    robot = RobotUnderTest(run, connection)
    calls = (
        () if contract.is_claimed else tuple(plan_lines(CallRules.of(run), operations_of(contract), run.mapped_calls))
    )
    progress, bar = None if options.progress == "none" else sys.stderr, options.progress == "auto"
    said: dict[str, Any] = {"progress": progress, "bar": bar, "notes": notes, "announced": calls}
    return run_certification(robot, options.out, command=command, baseline=baseline, **said)


def _places(contract: Contract, statement: Path | None, source: str | None) -> dict[str, Any]:
    """Return the file lines that reports point to; for a description at a URL, those of the copy beside the result."""
    if not contract.openapi_path or contract.is_claimed:
        return places(contract, statement)
    api = api_of(statement) if statement and source is None else None
    named = source or (api.openapi if api else None)
    file = Path(named) if named and not is_url(named) else contract.openapi_path
    return places(contract, statement, file, [operation.label for operation in operations_of(contract)])


def _run(chosen: Statement, options: CertifyOptions, contract: Contract) -> Run:
    """Return the run that the options describe."""
    from conformance.verdict.run import Run, Selection, seed_of_nonce  # noqa: PLC0415 - see _certify
    from conformance.verdict.time_limit import TimeLimit  # noqa: PLC0415 - as above

    known = {name for item in contract.ledger.values() for name in item.classes}
    claims = tuple(name for name in chosen.claims_of(contract) if name in known)
    try:
        among = failed_before(options.out / "result.json") if options.last_failed else None
        ids, played = select_ids(contract.ledger, claims, options.select, options.exclude, among) or (None, None)
    except SelectionError as error:
        raise click.UsageError(str(error)) from error
    return Run(
        statement=chosen,
        contract=contract,
        claims=claims,
        selection=Selection(ids, played, options.exit_first),
        allow_motion=options.allow_motion,
        ros="play" if options.ros_play else "watch" if options.ros else "",
        seed=options.seed if options.nonce is None else seed_of_nonce(options.nonce),
        effort=Effort(options.effort, minutes=options.minutes or DEEP_MINUTES),
        limit=TimeLimit(options.minutes),
    )


def _notes(run: Run) -> tuple[str, ...]:
    notes = []
    if run.statement.claims is None and run.contract.is_claimed:
        notes.append(f"No classes were claimed; judged are those that have an address: {', '.join(run.claims)}.")
    notes += [
        f"Class {name} is not claimed: the robot's {' and '.join(missing)} interface has no address."
        for name, missing in run.statement.lacking(run.contract).items()
    ]
    operations = operations_of(run.contract) if run.contract.openapi_path else ()
    labels = [operation.label for operation in operations]
    for pattern in CallRules.of(run).unused_patterns(operations):
        near = difflib.get_close_matches(pattern, labels, 1)
        meant = f"; did you mean {near[0]!r}?" if near else "."
        notes.append(f"The pattern {pattern!r} matches no operation of the description{meant}")
    maps = run.statement.motion_map or run.statement.state_map
    if run.allow_motion and not (run.contract.is_claimed or maps):
        notes.append("--allow-motion allows nothing here, as the statement has no map: --call allows operations.")
    if not run.allow_motion and (run.contract.is_claimed or maps):
        notes.append("Without --allow-motion nothing was sent that moves the robot; what needs motion is skipped.")
    return tuple(notes)
