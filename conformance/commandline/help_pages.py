"""Help of a command with many options: in groups, rare options only under --help-all, and a first example."""

import os
import re
import shutil
import sys
import textwrap
from collections.abc import Callable
from enum import StrEnum
from pathlib import Path
from typing import Any, Final, NamedTuple, TextIO, TypeVar

import click

_Command = TypeVar("_Command", bound=Callable[..., Any])
_PLACE, _EVERYTHING = "roaas_place", "roaas.help_all"
#: Statement that is used if the command line names no device.
USUAL_STATEMENT: Final = Path("roaas.toml")


class Group(StrEnum):
    """The groups of options in the help of a command, in their order."""

    DEVICE = "Device"
    CALLS = "What may be called"
    CREDENTIALS = "Credentials"
    MEASURED = "What is measured"
    EFFORT = "Effort"
    COMPARED = "Comparison"
    MACHINES = "Several machines"
    OUTPUT = "Output"
    HELP = "Help"


class _Place(NamedTuple):
    group: Group
    rare: bool


def options_of(group: Group, *, rare: bool = False) -> Callable[[_Command], _Command]:
    """Put the options declared below this decorator, down to the next one, into a group of the help.

    Args:
        group: heading of the group; several decorators may name the same.
        rare: whether only --help-all shows these options.
    """

    def mark(command: _Command) -> _Command:
        # Decorators run from last to first: an option without a group gets the group of the decorator above it.
        for parameter in getattr(command, "__click_params__", ()):
            vars(parameter).setdefault(_PLACE, _Place(group, rare))
        return command

    return mark


class GroupedCommand(click.Command):
    """A click command whose help has groups of options, and which prints an example if called without arguments.

    Args:
        start: what to print in place of an error if there is no argument and no roaas.toml; empty: run the command.
    """

    def __init__(self, *args: Any, start: str = "", **options: Any) -> None:
        super().__init__(*args, **options)
        self._start = start
        if any(_place(parameter).rare for parameter in self.params):
            everything = click.Option(
                ["--help-all"], is_flag=True, is_eager=True, expose_value=False, callback=_show_everything,
                help="Show all options.",
            )  # fmt: skip
            self.params.append(everything)

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse the arguments; without any, print an example and exit."""
        if self._start and not args and not ctx.resilient_parsing and not USUAL_STATEMENT.is_file():
            click.echo(f"{self._start}\n\nAll options: {ctx.command_path} --help", err=True)
            ctx.exit(2)
        return super().parse_args(ctx, args)

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the options group by group."""
        groups, left_out = {group: list[tuple[str, str]]() for group in Group}, 0
        for parameter in self.get_params(ctx):
            place, record = _place(parameter), parameter.get_help_record(ctx)
            if record is None or isinstance(parameter, click.Argument):
                continue
            if place.rare and _EVERYTHING not in ctx.meta:
                left_out += 1
                continue
            groups[place.group].append(record)
        filled = {group: records for group, records in groups.items() if records}
        for group, records in filled.items():
            # A command without groups has "Options" alone, as click writes it.
            with formatter.section(group if len(filled) > 1 else "Options"):
                formatter.write_dl(records)
        if left_out:
            formatter.write_paragraph()
            formatter.write_text(f"{left_out} more options: {ctx.command_path} --help-all")


def _place(parameter: click.Parameter) -> _Place:
    place: _Place = vars(parameter).get(_PLACE, _Place(Group.HELP, rare=False))
    return place


def _show_everything(ctx: click.Context, _: click.Parameter, given: bool) -> None:  # noqa: FBT001 - click's signature
    if given:
        ctx.meta[_EVERYTHING] = True
        click.echo(ctx.get_help(), color=ctx.color)
        ctx.exit()


_NARROWEST, _WIDEST = 60, 200
# CI systems execute these in a job's output: GitHub's `::` at a line's start; `##[` and `##vso[` of others anywhere.
_COMMAND = re.compile(r"^(?=\s*::)|(?<=#)#(?=\w*\[)")


def inert(text: str) -> str:
    r"""Return a text on one line that controls neither a terminal nor a CI job.

    Unprintable characters are escaped (`\x1b`). A text that a CI system would run as a command, such as
    `::error::` or `##[group]`, gets a backslash before it.
    """
    line = text if text.isprintable() else "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)
    return _COMMAND.sub(lambda found: f"\\{found[0]}", line)


def columns(stream: TextIO | None = None) -> int | None:
    """Return the width of a stream (stdout), 60 to 200 columns; None if it is no terminal: then no line is wrapped."""
    stream = stream or sys.stdout
    if not stream.isatty():
        return None
    return min(max(shutil.get_terminal_size(os.get_terminal_size(stream.fileno())).columns, _NARROWEST), _WIDEST)


def wrap(text: str, stream: TextIO | None = None) -> str:
    """Return a text in lines as wide as the terminal, all with its indent. Not for commands that users copy."""
    width, indent = columns(stream), text[: len(text) - len(text.lstrip(" "))]
    if width is None:
        return text
    return textwrap.fill(text, width, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)


def say(text: str, stream: TextIO | None = None) -> None:
    """Print lines of words to a stream (stdout)."""
    click.echo("\n".join(wrap(line, stream) for line in text.split("\n")), file=stream)
