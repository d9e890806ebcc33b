"""``roaas contract``: list the requirements, export the contract's files, show the coverage."""

import json
import shutil
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

import click

from conformance.commandline.exit_codes import ExitCode
from conformance.contract.classes import Level
from conformance.contract.ledger import Requirement
from conformance.contract.locating import ContractError
from conformance.contract.pack import DEFAULT_PACK, Contract
from conformance.verdict.finding import count_of

#: ``--contract``, as the parameter ``pack``.
contract_option = click.option(
    "--contract",
    "pack",
    metavar="PACK",
    default=DEFAULT_PACK,
    help="The contract pack: its name, or its folder, whose code is run.",
)


def load_pack(pack: str) -> Contract:
    """Return a contract pack.

    Raises:
        click.UsageError: the pack cannot be used.
    """
    try:
        return Contract.load(pack)
    except ContractError as error:
        raise click.UsageError(str(error)) from error


@click.group()
def contract() -> None:
    """The contract that a conforming robot keeps."""


@contract.command(name="list")
@contract_option
@click.option("--class", "class_", metavar="NAME", help="Only those of one conformance class.")
@click.option("--level", type=click.Choice([str(level) for level in Level]), help="Only those of one level.")
@click.option("--json", "as_json", is_flag=True, help="As JSON, for other programs.")
def list_(pack: str, class_: str | None, level: str | None, *, as_json: bool) -> None:
    """List the requirements: id, level, text, source and origin."""
    contract = load_pack(pack)
    if class_ not in {None, *contract.classes}:
        raise click.UsageError(f"--class {class_!r}: {contract.name} has {', '.join(contract.classes)}")
    found = [
        item for item in contract.ledger.values() if class_ in {None, *item.classes} and level in {None, item.level}
    ]
    if as_json:
        click.echo(json.dumps([_as_json(item) for item in found], indent=2))
        return
    for item in found:
        click.echo(f"{item.id}\n    {item.level}: {item.text} [{item.origin}: {item.source}]")
    click.echo(f"{count_of(len(found), 'requirement')} of contract {contract.label}", err=True)


def _as_json(requirement: Requirement) -> dict[str, Any]:
    """Return a requirement with its public key names."""
    members = asdict(requirement)
    return {"id": members.pop("id"), "class": members.pop("class_"), **members}


@contract.command()
@click.argument("directory", metavar="DIR", type=click.Path(file_okay=False, path_type=Path))
@contract_option
@click.option("--force", is_flag=True, help="Overwrite files that are there.")
def export(directory: Path, pack: str, *, force: bool) -> None:
    """Write the contract's files to DIR: its text, OpenAPI, WSDLs and XSDs, WADL and the ledger."""
    contract = load_pack(pack)
    there = [path.name for path in contract.files if (directory / path.name).exists()]
    if there and not force:
        raise click.UsageError(f"{directory / there[0]} exists already; --force overwrites it")
    try:
        directory.mkdir(parents=True, exist_ok=True)
        for path in contract.files:
            shutil.copyfile(path, directory / path.name)
    except OSError as error:
        raise click.UsageError(f"the contract cannot be written to {directory}: {error}") from error
    click.echo(f"wrote {count_of(len(contract.files), 'file')} of contract {contract.label} to {directory}")


@contract.command()
@contract_option
@click.option("--out", type=click.Path(dir_okay=False, path_type=Path), help="Write the page there.  [default: stdout]")
@click.pass_obj
def coverage(door: Any, /, pack: str, out: Path | None) -> None:
    """Show which checks judge each requirement, and which mutants break it.

    Exit code 1 when ledger, checks and mutants disagree.
    """
    contract = load_pack(pack)
    try:
        text, problems = door.coverage(contract)
    except ContractError as error:
        raise click.UsageError(str(error)) from error
    if out is None:
        click.echo(text, nl=False)
    else:
        out.parent.mkdir(parents=True, exist_ok=True)
        out.write_text(text, encoding="utf-8")
        click.echo(f"wrote {out}")
    for problem in problems:
        click.echo(problem, err=True)
    sys.exit(ExitCode.FAILED if problems else ExitCode.PASSED)
