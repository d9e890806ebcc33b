"""How the room's commands end where a file cannot be used."""

from typing import NoReturn

import click

from reports.errors import ReportError

EXIT_UNREADABLE = 2


def refuse(error: ReportError) -> NoReturn:
    """Tell what is wrong and end with exit code 2."""
    click.echo(f"Error: {error}", err=True)
    raise SystemExit(EXIT_UNREADABLE)
