"""Define the command `roaas sign`."""

from pathlib import Path

import click

from reports.attestation.signing import Notary
from reports.cli.options import FILE, FOLDER
from reports.rendering import render


@click.command()
@click.argument("directory", metavar="DIR", type=FOLDER)
@click.option("--key", required=True, type=FILE, help="Private key, as `roaas keygen` makes it.")
def sign(directory: Path, key: Path) -> None:
    """Sign DIR/result.json: write DIR/certificate.intoto.json, and write the pages again.

    Exit code 2: DIR has no result, the result contradicts itself, or the key cannot be used.
    """
    for path in render(directory, Notary(key)):
        click.echo(path)
