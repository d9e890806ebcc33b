"""Commands that write a result file."""

from pathlib import Path
from typing import Any, NamedTuple, Protocol

import click

from conformance.commandline.exit_codes import ExitCode
from conformance.commandline.help_pages import GroupedCommand, inert


class CommandResult(NamedTuple):
    """The return value of such a command.

    Attributes:
        exit_code: exit code of the process.
        file: the result file that was written, or None.
        notary: the signer that the front door provided, or None.
        tell: whether the names of the rendered pages are printed; not where stdout is for programs.
    """

    exit_code: int
    file: Path | None = None
    notary: Any = None
    tell: bool = True


class FrontDoor(Protocol):
    """The functions of roaas.py that such a command calls; the click context holds the object."""

    def notary(self, key: Path, pack: str | None = None) -> Any:
        """Return a signer with a private key for results by a pack; raise a usage error if the key cannot be read."""

    def prepare(self) -> None:
        """Load the modules that render() needs, while the run waits for the device anyway."""

    def render(self, written: Path, notary: Any) -> list[Path]:
        """Write the pages of a result file, sign it if there is a signer, and return their paths."""


class ResultCommand(GroupedCommand):
    """A click command whose callback returns a CommandResult.

    After the callback, the front door, if any, renders the result file, and the process exits with the exit code.
    """

    def invoke(self, ctx: click.Context) -> Any:
        """Run the callback, render its result file and exit.

        Raises:
            click.exceptions.Exit: always, with the exit code.
        """
        result: CommandResult = super().invoke(ctx)
        if result.file is not None and ctx.obj is not None:
            try:
                for path in ctx.obj.render(result.file, result.notary):
                    if result.tell:
                        click.echo(f"report: {path}")
            except ModuleNotFoundError:
                raise  # roaas.py says which extra installs the module
            except Exception as error:  # noqa: BLE001 - the verdict stands without its pages, also where memory ends
                own = error.format_message() if isinstance(error, click.ClickException) else ""
                said = own or inert(str(error)) or type(error).__name__
                click.echo(f"the pages could not be written or signed: {said}. {result.file} is kept", err=True)
                if result.notary is not None and result.exit_code == ExitCode.PASSED:
                    ctx.exit(ExitCode.INCONCLUSIVE)  # --sign was given, but nothing could be signed
        ctx.exit(result.exit_code)
