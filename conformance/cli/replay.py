"""``roaas replay``: a finding's requests again, and whether it is still there."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click

from conformance.cli.summary import inert
from conformance.contract.command import CommandResult, ResultCommand
from conformance.contract.exit_codes import ExitCode

_FORMAT = "roaas-result/1"


@click.command(cls=ResultCommand, context_settings={"help_option_names": ["-h", "--help"]})
@click.argument("result", type=click.Path(exists=True, path_type=Path))
@click.argument("requirement", required=False)
@click.option("--allow-motion", is_flag=True, help="The robot may be moved, as by the requests that were recorded.")
@click.option("--token-file", type=click.Path(exists=True, dir_okay=False), help="Holds the bearer token to send.")
@click.option("--ca-file", type=click.Path(exists=True, dir_okay=False), help="Authorities to trust for HTTPS.")
@click.option(
    "--timeout",
    "timeout_s",
    type=click.FloatRange(min=0, min_open=True),
    default=10.0,
    show_default=True,
    metavar="S",
    help="Deadline of one request.",
)
def replay(
    result: Path,
    requirement: str | None,
    *,
    allow_motion: bool,
    token_file: str | None,
    ca_file: str | None,
    timeout_s: float,
) -> CommandResult:
    """Send a finding's requests again, in order, and say whether it is still there.

    RESULT is a result.json, or the folder that holds one; REQUIREMENT is an id such as http/head, by default all that
    were not met. A finding counts as still there when the last answer has the status, the media type and content as
    then; whether values are right, only `roaas certify` says.

    Exit code: 0 all gone, 1 one is still there, 2 usage, 3 robot not reached.
    """
    # Imported here, so that --help stays quick.
    from conformance.engine.replay import Outcome, findings, moves  # noqa: PLC0415
    from conformance.engine.replay import replay as send_again  # noqa: PLC0415
    from conformance.transport.client import Connection  # noqa: PLC0415

    document = _read(result / "result.json" if result.is_dir() else result)
    token = Path(token_file).read_text(encoding="utf-8").strip() if token_file else None
    connection = Connection(timeout_s=timeout_s, ca_file=Path(ca_file) if ca_file else None, token=token)
    try:
        chosen = list(findings(document, requirement))
        if not chosen:
            raise click.UsageError(f"{result} has no finding" + (f" of {requirement}" if requirement else ""))
        if not allow_motion and any(moves(document, failure) for _, failure in chosen):
            raise click.UsageError("these requests may move the robot: add --allow-motion, or name one that only reads")
        replayed = [send_again(id_, failure, connection) for id_, failure in chosen]
    except (KeyError, TypeError, ValueError) as error:
        raise click.UsageError(f"{result} is no well-made {_FORMAT}: {error!r}") from error
    for one in replayed:
        came = f" ({one.came}, after {one.sent} requests)" if one.sent else f" ({one.came})" if one.came else ""
        click.echo(f"{one.outcome}: {one.requirement}: {inert(one.message)}{inert(came)}")
    outcomes = {one.outcome for one in replayed}
    if Outcome.STILL_THERE in outcomes:
        return CommandResult(ExitCode.FAILED)
    if Outcome.UNREACHABLE in outcomes:
        return CommandResult(ExitCode.UNREACHABLE)
    if outcomes == {Outcome.NOT_REPLAYED}:
        raise click.UsageError("none of these findings has requests that could be sent again")
    return CommandResult(ExitCode.PASSED)


def _read(path: Path) -> dict[str, Any]:
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise click.UsageError(f"{path} cannot be read: {error}") from error
    if not isinstance(document, dict) or document.get("format") != _FORMAT:
        raise click.UsageError(f"{path} is no {_FORMAT}")
    return document
