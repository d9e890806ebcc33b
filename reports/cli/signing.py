"""`roaas sign`."""

from pathlib import Path

import click

from reports.attestation.signing import Notary
from reports.cli.refusal import refuse
from reports.errors import ReportError
from reports.rendering import render


@click.command()
@click.argument("directory", metavar="DIR", type=click.Path(file_okay=False, path_type=Path))
@click.option(
    "--key",
    required=True,
    type=click.Path(dir_okay=False, path_type=Path),
    help="Private key, as `roaas keygen` makes it.",
)
def sign(directory: Path, key: Path) -> None:
    """Sign DIR/result.json: write DIR/certificate.intoto.json, and the pages again.

    Exit code 2 where there is no result, it contradicts itself, or the key cannot be used.
    """
    try:
        written = render(directory, Notary(key))
    except ReportError as error:
        refuse(error)
    for path in written:
        click.echo(path)
