"""``roaas replay``: send a finding's requests again and report whether the finding still occurs."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import msgspec

from conformance.cli.stored_contract import contract_of
from conformance.cli.summary import warning
from conformance.commandline.device_options import client_certificate_options
from conformance.commandline.endings import end_like_ctrl_c, end_with_parent
from conformance.commandline.exit_codes import ExitCode
from conformance.commandline.help_pages import inert
from conformance.commandline.result_command import CommandResult, ResultCommand
from conformance.contract.locating import ContractError
from conformance.contract.pack import Contract
from conformance.engine.stored_result import MALFORMED, StoredResultError, findings, not_well_made, read_result
from conformance.statement.endpoints import Endpoints
from conformance.statement.statement import Statement, StatementError, api_of, load_statement
from conformance.verdict.finding import count_of

if TYPE_CHECKING:
    from conformance.transport.client import Connection

_WORDS = {"fail": "still there", "warn": "still there", "pass": "gone"}


@click.command(cls=ResultCommand)
@click.argument("result", type=click.Path(exists=True, path_type=Path))
@click.argument("requirement", required=False)
@click.option("--allow-motion", is_flag=True, help="Allow the recorded requests to move the robot.")
@click.option(
    "--statement",
    "statement_file",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    help="The robot's statement: run the requirements' checks again instead of the recorded requests.",
)
@click.option(
    "--contract",
    "pack",
    metavar="PACK",
    help="Folder of the contract pack, if the result's pack is not installed; its code is run.",
)
@click.option("--token-file", type=click.Path(exists=True, dir_okay=False), help="File with the bearer token to send.")
@click.option(
    "--token-for",
    "trusted",
    multiple=True,
    metavar="URL",
    help="Address to which the token or certificate may go, as RESULT may name other servers; repeatable.",
)
@client_certificate_options
@click.option(
    "--ca-file", type=click.Path(exists=True, dir_okay=False), help="Certificate authorities (PEM) to trust for HTTPS."
)
@click.option(
    "--timeout",
    "timeout_s",
    type=click.FloatRange(min=0, min_open=True),
    metavar="S",
    help="Deadline of one request.  [default: 10]",
)
@click.option(
    "--minutes",
    type=click.FloatRange(min=0, min_open=True),
    metavar="MIN",
    help="Time for all requests.  [default: 30; less for few recorded requests]",
)
def replay(  # noqa: C901 - one branch for each way to judge
    result: Path,
    requirement: str | None,
    *,
    allow_motion: bool,
    statement_file: Path | None,
    pack: str | None,
    token_file: str | None,
    trusted: tuple[str, ...],
    ca_file: str | None,
    timeout_s: float | None,
    minutes: float | None,
    **certificate: str | None,
) -> CommandResult:
    """Send the requests of findings again, in order, and report whether each failure occurs again.

    RESULT is a result.json, or its folder; REQUIREMENT is an id such as http/head, or the number of a finding; by
    default all findings. A response that is wrong in itself, or by the description in the result, is judged as in the
    run. Of any other failure, requests alone cannot tell. With --statement, the requirements' own checks run again, by
    the description that its [api] names, with the seed and effort of the result; options override the statement.

    Exit code: 0 no failure again, 1 a failure again, 2 usage, 4 it cannot be told, as where the robot does not respond.
    """
    # Imported here, so that --help stays quick.
    from conformance.engine.permission import moves  # noqa: PLC0415
    from conformance.engine.replay import Outcome, replay_and_stop  # noqa: PLC0415

    end_like_ctrl_c()
    end_with_parent()
    folder = result if result.is_dir() else result.parent
    try:
        document = read_result(result / "result.json" if result.is_dir() else result)
    except StoredResultError as error:
        raise click.UsageError(str(error)) from error
    options = {"token_file": token_file, "ca_file": ca_file, "timeout_s": timeout_s, **certificate}
    given = {name: value for name, value in options.items() if value is not None}
    connection = _connection(given)
    try:
        chosen = list(findings(document, requirement))
        if not chosen:
            raise click.UsageError(f"{result} has no finding" + (f" of {requirement}" if requirement else ""))
        if statement_file:
            place, requirements = (folder, pack), {id_ for id_, _ in chosen}
            allowed = {"allow_motion": allow_motion, "minutes": minutes}
            return _judge_again(document, place, statement_file, given, requirements, allowed)
        # Judge by the contract at hand if the result was judged by it.
        contract = contract_of(document, pack, folder)
        rest = document["target"].get("rest") if contract else None
        sure = [allow_motion or not moves(failure, contract, rest or "") for _, failure in chosen]
        acting = [failure for (_, failure), may in zip(chosen, sure, strict=True) if not may]
        chosen = [one for one, may in zip(chosen, sure, strict=True) if may]
        if not chosen:
            raise click.UsageError(
                "these requests change the device, and may move it: add --allow-motion, or name one that only reads"
            )
        if connection.token or connection.certificate:
            _check_addresses([failure for _, failure in chosen], trusted)
        replayed, unstopped = replay_and_stop(chosen, document, connection, contract, minutes)
    except MALFORMED as error:
        raise click.UsageError(str(not_well_made(result, error))) from error
    click.secho(warning({"stop_undelivered": unstopped}), fg="red", nl=False)
    for one in replayed:
        now = f"now {one.came}" if one.came else ""
        if one.sent:
            judged = f" (judged {one.told_by})" if one.told_by else ""
            now += f", after {count_of(one.sent, 'request')}{judged}"
        told = ". ".join(filter(None, (one.why, now, f"In the run: {one.message}")))
        click.echo(f"{one.outcome}: {inert(one.requirement)}: {inert(told)}")
    if acting:
        numbers = inert(", ".join(str(failure.get("number", "")) for failure in acting))
        click.echo(
            f"not sent, because they change the device, and may move it: finding {numbers}; --allow-motion sends them"
        )
    outcomes = {one.outcome for one in replayed}
    if Outcome.STILL_THERE in outcomes:
        return CommandResult(ExitCode.FAILED)
    return CommandResult(ExitCode.PASSED if outcomes == {Outcome.GONE} and not unstopped else ExitCode.INCONCLUSIVE)


def _connection(given: dict[str, Any]) -> Connection:
    """Return a connection by the options; to which servers its credentials go, _check_addresses() decides.

    Raises:
        click.UsageError: a credential cannot be used.
    """
    from conformance.target.connecting import connection_of  # noqa: PLC0415 - see replay()

    try:
        return replace(connection_of(Endpoints(**given)), trust=None)
    except (StatementError, OSError, UnicodeDecodeError) as error:
        raise click.UsageError(str(error)) from error


def _judge_again(
    document: dict[str, Any],
    place: tuple[Path, str | None],
    statement_file: Path,
    given: dict[str, Any],
    requirements: set[str],
    allowed: dict[str, Any],
) -> CommandResult:
    from conformance.documents.description import DescriptionError  # noqa: PLC0415
    from conformance.engine.replay import judged_by_checks  # noqa: PLC0415
    from conformance.transport.reach import UnreachableError  # noqa: PLC0415

    folder, pack = place
    try:
        api = api_of(statement_file)
        is_described = bool(api.openapi or api.wsdl)
        contract = contract_of(document, pack, folder) if pack or not is_described else None
        if contract is None and is_described:
            statement, contract = _describe(statement_file, given)
        elif contract is None:
            raise click.UsageError("the result is by a contract that is not at hand: name its pack with --contract")
        else:
            statement = load_statement(statement_file, contract)
        where = msgspec.structs.replace(statement.endpoints, **given)
        statement = msgspec.structs.replace(statement, endpoints=where)
        judged = judged_by_checks(
            contract, statement, requirements, seed=document["seed"], effort=document["effort"], **allowed
        )
    except UnreachableError as error:
        click.echo(f"cannot tell: the device does not respond: {inert(str(error))}")
        return CommandResult(ExitCode.INCONCLUSIVE)
    except (StatementError, ContractError, DescriptionError, OSError) as error:
        raise click.UsageError(str(error)) from error
    click.secho(warning(judged), fg="red", nl=False)
    # If the time of --minutes ended, too few requests may have been sent.
    cut = {item["id"] for item in judged["requirements"] if "the time of --minutes" in item["reason"]}
    for item in judged["requirements"]:
        is_cut = item["verdict"] == "pass" and item["id"] in cut
        word = "not judged" if is_cut else _WORDS.get(item["verdict"], "not judged")
        click.echo(f"{word}: {item['id']}: {inert(item['reason']) or 'passed'} ({count_of(item['cases'], 'case')})")
    verdicts = {item["verdict"] for item in judged["requirements"]}
    if verdicts & {"fail", "warn"}:
        return CommandResult(ExitCode.FAILED)
    gone = verdicts == {"pass"} and not cut and "stop_undelivered" not in judged
    return CommandResult(ExitCode.PASSED if gone else ExitCode.INCONCLUSIVE)


def _describe(statement_file: Path, given: dict[str, Any]) -> tuple[Statement, Contract]:
    """Return a statement, and the contract of its [api] description in its present form.

    Raises:
        StatementError, ContractError, DescriptionError: one of them cannot be used.
        UnreachableError: the server of the description does not respond.
    """
    from conformance.target.naming import DeviceOptions, what_is_judged  # noqa: PLC0415 - see replay()

    folder = Path(click.get_current_context().with_resource(tempfile.TemporaryDirectory()))
    statement, contract, _ = what_is_judged(None, statement_file, DeviceOptions.of(given, out=folder))
    return statement, contract


def _check_addresses(failures: list[dict[str, Any]], trusted: tuple[str, ...]) -> None:
    """Check that token and certificate are sent only to origins that the user trusts.

    Raises:
        click.UsageError: it would be sent elsewhere.
        ValueError: an address is invalid.
    """
    from conformance.engine.permission import strangers  # noqa: PLC0415 - as above

    others = sorted({address for failure in failures for address in strangers(failure, trusted)})
    if others:
        raise click.UsageError(
            f"the result has requests for {', '.join(map(inert, others))}: where your credentials may go there, add "
            + " ".join(f"--token-for {inert(address)}" for address in others)
        )
