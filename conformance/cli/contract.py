"""``roaas contract``: the requirements, the contract's files, and what binds each requirement."""

import json
import shutil
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

import click

from conformance.contract.classes import CLASSES, Level
from conformance.contract.exit_codes import ExitCode
from conformance.contract.files import CONTRACT_DIR, CONTRACT_FILES, CONTRACT_VERSION
from conformance.contract.ledger import Requirement, load_ledger


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
def contract() -> None:
    """The contract that a conforming robot keeps."""


@contract.command(name="list")
@click.option(
    "--class", "class_", type=click.Choice([str(name) for name in CLASSES]), help="Only those of one conformance class."
)
@click.option("--level", type=click.Choice([str(level) for level in Level]), help="Only those of one level.")
@click.option("--json", "as_json", is_flag=True, help="As JSON, for other programs.")
def list_(class_: str | None, level: str | None, *, as_json: bool) -> None:
    """List the requirements: id, level, text, source and origin."""
    found = [
        item
        for item in load_ledger(CONTRACT_DIR / "requirements.toml").values()
        if class_ in {None, item.class_} and level in {None, item.level}
    ]
    if as_json:
        click.echo(json.dumps([_as_json(item) for item in found], indent=2))
        return
    for item in found:
        click.echo(f"{item.id}\n    {item.level}: {item.text} [{item.origin}: {item.source}]")
    click.echo(f"{len(found)} requirements of contract {CONTRACT_VERSION}", err=True)


def _as_json(requirement: Requirement) -> dict[str, Any]:
    """A requirement by its public names."""
    members = asdict(requirement)
    return {"id": members.pop("id"), "class": members.pop("class_"), **members}


@contract.command()
@click.argument("directory", metavar="DIR", type=click.Path(file_okay=False, path_type=Path))
@click.option("--force", is_flag=True, help="Overwrite files that are there.")
def export(directory: Path, *, force: bool) -> None:
    """Write the contract's files to DIR: its text, OpenAPI, WSDLs and XSDs, WADL and the ledger."""
    there = [name for name in CONTRACT_FILES if (directory / name).exists()]
    if there and not force:
        raise click.UsageError(f"{directory / there[0]} exists already; --force overwrites it")
    try:
        directory.mkdir(parents=True, exist_ok=True)
        for name in CONTRACT_FILES:
            shutil.copyfile(CONTRACT_DIR / name, directory / name)
    except OSError as error:
        raise click.UsageError(f"the contract cannot be written to {directory}: {error}") from error
    click.echo(f"wrote {len(CONTRACT_FILES)} files of contract {CONTRACT_VERSION} to {directory}")


@contract.command()
@click.option("--out", type=click.Path(dir_okay=False, path_type=Path), help="Write the page there.  [default: stdout]")
def coverage(out: Path | None) -> None:
    """Show which check and which faulty robot bind each requirement.

    Exit code 1 when ledger, checks and faults disagree.
    """
    # Imported here: it imports every check, and with them Schemathesis.
    from conformance.selftest.coverage import disagreements, page  # noqa: PLC0415

    if out is None:
        click.echo(page(), nl=False)
    else:
        out.parent.mkdir(parents=True, exist_ok=True)
        out.write_text(page(), encoding="utf-8")
        click.echo(f"wrote {out}")
    problems = disagreements()
    for problem in problems:
        click.echo(problem, err=True)
    sys.exit(ExitCode.FAILED if problems else ExitCode.PASSED)
