"""What a command that leaves a result file comes to."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import click

if TYPE_CHECKING:
    from pathlib import Path


class CommandResult(NamedTuple):
    """What the callback of such a command returns.

    Attributes:
        exit_code: of the process.
        file: the result file that it wrote, or None where it wrote none.
    """

    exit_code: int
    file: Path | None = None


class ResultCommand(click.Command):
    """A command whose callback returns a CommandResult, and which ends with its exit code.

    The context's object, where there is one, is called with the file that was written.
    """

    def invoke(self, ctx: click.Context) -> Any:
        """Run the callback.

        Raises:
            click.exceptions.Exit: always, with the exit code.
        """
        result: CommandResult = super().invoke(ctx)
        if result.file is not None and ctx.obj is not None:
            ctx.obj(result.file)
        ctx.exit(result.exit_code)
