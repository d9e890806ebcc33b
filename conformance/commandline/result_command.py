"""What a command that leaves a result file comes to."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import click

if TYPE_CHECKING:
    from pathlib import Path


class CommandResult(NamedTuple):
    """What the callback of such a command returns.

    Attributes:
        exit_code: of the process.
        file: the result file that it wrote, or None where it wrote none.
        notary: what signs it, as the front door gave it, or None.
    """

    exit_code: int
    file: Path | None = None
    notary: Any = None


class FrontDoor(Protocol):
    """What a command that leaves a result file asks of the front door, which is the context's object."""

    def notary(self, key: Path) -> Any:
        """What signs with a private key; a usage error where it cannot be read."""

    def render(self, written: Path, notary: Any) -> None:
        """Write the pages of a result file, and sign it where there is a notary."""


class ResultCommand(click.Command):
    """A command whose callback returns a CommandResult, and which ends with its exit code.

    The front door, where there is one, renders the file that was written.
    """

    def invoke(self, ctx: click.Context) -> Any:
        """Run the callback.

        Raises:
            click.exceptions.Exit: always, with the exit code.
        """
        result: CommandResult = super().invoke(ctx)
        if result.file is not None and ctx.obj is not None:
            ctx.obj.render(result.file, result.notary)
        ctx.exit(result.exit_code)
