"""Define the command `roaas sign`."""

from pathlib import Path

import click

from reports.attestation.files import DESCRIPTION
from reports.attestation.signing import Notary
from reports.cli.options import CONTRACT, FILE, FOLDER, FrontDoor
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
    result = read_result(directory / RESULT_NAME) if pack is None else {}
    described = str(directory / DESCRIPTION)
    by = pack or (described if "api" in result else result.get("pack", {}).get("name"))
    for path in render(directory, Notary(key, lambda: door.known(by))):
        click.echo(path)
