"""Define the command `roaas sign`."""

from pathlib import Path

import click

from reports.attestation.files import DESCRIPTION
from reports.attestation.signing import Notary
from reports.cli.options import CONTRACT, FILE, FOLDER, FrontDoor
from reports.pages.untrusted import excerpt
from reports.reading import RESULT_NAME, read_result
from reports.rendering import render


@click.command()
@click.argument("directory", metavar="DIR", type=FOLDER)
@click.option("--key", required=True, type=FILE, help="Private key, as `roaas keygen` makes it.")
@CONTRACT
@click.pass_obj
def sign(door: FrontDoor, directory: Path, key: Path, pack: str | None) -> None:
    """Sign DIR/result.json: write DIR/certificate.intoto.json, and write the pages again.

    Exit code 2: DIR has no result; the result is incomplete, was edited, or lies beside files of another run; or the
    key cannot be used.
    """
    by = _pack_of(door, directory) if pack is None else pack
    suite, known = read_result(directory / RESULT_NAME)["suite"], door.known(by)
    if suite["digest"] != known["suite"]:
        click.echo(
            f"RoAAS {excerpt(suite['version'], 40)} judged the robot, with another suite or contract than the "
            "installed one: the requirements were not compared with a ledger",
            err=True,
        )
    for path in render(directory, Notary(key, lambda: known)):
        click.echo(path)


def _pack_of(door: FrontDoor, directory: Path) -> str | None:
    """Return the contract pack of a result: the description beside it, or an installed pack; None for the default."""
    result = read_result(directory / RESULT_NAME)
    if "api" in result and (directory / DESCRIPTION).is_dir():
        return str(directory / DESCRIPTION)
    name: str | None = result.get("pack", {}).get("name")
    # A result is data: a pack's name in it must not lead to a folder.
    if name is not None and not door.is_installed(name):
        raise click.UsageError(
            f"the robot was judged by the contract pack {excerpt(name, 80)!r}, which is not installed: "
            "give its folder with --contract"
        )
    return name
