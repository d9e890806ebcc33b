"""``roaas judge``: judge a stored run again, without the device."""

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from conformance.cli.stored_contract import contract_of
from conformance.commandline.exit_codes import ExitCode
from conformance.commandline.help_pages import inert
from conformance.commandline.result_command import CommandResult, ResultCommand
from conformance.engine.stored_result import MALFORMED, StoredResultError, not_well_made, read_result
from conformance.statement.statement import StatementError, empty_statement, load_statement
from conformance.verdict.finding import count_of

if TYPE_CHECKING:
    from conformance.engine.stored_result import Judged
    from conformance.verdict.verdicts import Verdict

_FAIL = "fail"
_BROKEN = frozenset({_FAIL, "warn"})


@click.command(cls=ResultCommand)
@click.argument("result", type=click.Path(exists=True, path_type=Path))
@click.argument("requirement", required=False)
@click.option(
    "--statement",
    "statement_file",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    help="The robot's statement, as it is now: limits and the maps that the run was judged by.",
)
@click.option(
    "--contract",
    "pack",
    metavar="PACK",
    help="Folder of the contract pack, if the result's pack is not installed; its code is run.",
)
def judge(result: Path, requirement: str | None, statement_file: Path | None, pack: str | None) -> CommandResult:
    """Judge a run's recorded exchanges and traces again, by this version's rules. Nothing is sent.

    RESULT is a result.json, or its folder, with the history of the run; also that of a run that was killed.
    REQUIREMENT is an id such as http/date; by default all of the classes that the run was for. Only what the history
    shows is judged: a requirement that needs an experiment keeps its verdict of the run, and is not told.

    Exit code: 0 all that was judged holds, 1 something fails, 2 usage, 4 nothing could be judged.
    """
    folder = result if result.is_dir() else result.parent
    try:
        document = read_result(result / "result.json" if result.is_dir() else result)
        judged = _judge_folder(document, folder, statement_file, pack, claimed=requirement is None)
    except (StoredResultError, StatementError) as error:
        raise click.UsageError(str(error)) from error
    except MALFORMED as error:
        raise click.UsageError(str(not_well_made(result, error))) from error
    before = {item["id"]: item for item in document["requirements"]}
    requirement = next((id_ for id_, one in before.items() if requirement in one.get("aliases", ())), requirement)
    chosen = tuple(verdict for verdict in judged.verdicts if requirement in {None, verdict.requirement.id})
    for one in chosen:
        then = str(before.get(one.requirement.id, {}).get("verdict", "not judged"))
        if requirement or one.value in _BROKEN or then in _BROKEN:
            click.echo(f"{one.value}: {one.requirement.id} ({count_of(one.evidence.cases, 'case')}{_then(one, then)})")
            for finding in one.evidence.findings.values():
                click.echo(f"  {inert(finding.text)}")
    click.echo(_summary(judged, chosen))
    if lacking := [id_ for id_ in judged.lacking if requirement in {None, id_}]:
        click.echo(f"not judged, as the statement's map is needed (--statement): {', '.join(lacking)}", err=True)
    for fault in judged.faults:
        click.echo(inert(fault), err=True)
    if not chosen:
        return CommandResult(ExitCode.INCONCLUSIVE)
    return CommandResult(ExitCode.FAILED if any(verdict.value == _FAIL for verdict in chosen) else ExitCode.PASSED)


def _then(one: "Verdict", then: str) -> str:
    """Return how the run had judged, where that differs."""
    if one.value == then:
        return ""
    alone = then in _BROKEN and one.value not in _BROKEN
    return f"; in the run: {inert(then)}{', by what only the device can show again' if alone else ''}"


def _summary(judged: "Judged", chosen: tuple["Verdict", ...]) -> str:
    told = f"{count_of(judged.requests, 'request')} in the history{'' if judged.ended else ', which was cut short'}"
    if not chosen:
        return f"nothing judged: {told}, and none of them and no trace shows it"
    values = Counter(str(verdict.value) for verdict in chosen)
    cases = sum(verdict.evidence.cases for verdict in chosen)
    kinds = ", ".join(f"{number} {value}" for value, number in sorted(values.items()))
    return f"{kinds}, of {count_of(len(chosen), 'requirement')} that this run shows ({count_of(cases, 'case')}; {told})"


def _judge_folder(
    document: dict[str, Any], folder: Path, statement_file: Path | None, pack: str | None, *, claimed: bool
) -> "Judged":
    """Judge the records in a folder, or only those for the classes that the run claimed.

    Raises:
        click.UsageError: the contract is not at hand, or the history or the traces cannot be read.
        StatementError: the statement is invalid.
    """
    # Imported here, so that --help stays quick.
    from conformance.engine.robot_under_test import RobotUnderTest  # noqa: PLC0415
    from conformance.engine.stored_result import judge_stored  # noqa: PLC0415
    from conformance.history.events import HistoryError  # noqa: PLC0415
    from conformance.scenarios.stored import TracesError  # noqa: PLC0415
    from conformance.verdict.run import Run  # noqa: PLC0415

    contract = contract_of(document, pack, folder)
    if contract is None:
        raise click.UsageError("the result is by a contract that is not at hand: name its pack with --contract")
    statement = load_statement(statement_file, contract) if statement_file else empty_statement(contract)
    then = document["statement"]["claims"] if claimed else contract.classes
    run = Run(statement, contract, claims=tuple(name for name in contract.classes if name in then), allow_motion=True)
    try:
        return judge_stored(RobotUnderTest(run), document, folder)
    except (HistoryError, TracesError) as error:
        raise click.UsageError(str(error)) from error
