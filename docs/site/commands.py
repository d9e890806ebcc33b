"""The command line's reference: docs/cli.md, with usage and options of each command as click knows them."""

import re
from collections.abc import Iterator

import click

from roaas import main

BAR = r"\|"
_SECTION = re.compile(r"^## (roaas[\w -]*)\n(.*?)(?=^## |\Z)", re.MULTILINE | re.DOTALL)


def commands(group: click.Group = main, name: str = "roaas") -> Iterator[tuple[str, click.Command]]:
    """Yield each command with its name, groups after their commands."""
    context = click.Context(group, info_name=name)
    for word in group.list_commands(context):
        command = group.get_command(context, word)
        if isinstance(command, click.Group):
            yield from commands(command, f"{name} {word}")
        elif command is not None:
            yield f"{name} {word}", command
    if group is main:
        yield name, group


def completed(page: str) -> str:
    """Return the page with usage and options added to the section of each command."""
    found = dict(commands())
    return _SECTION.sub(
        lambda section: f"## {section[1]}\n{section[2].rstrip()}\n\n{_reference(section[1], found[section[1]])}\n\n",
        page,
    )


def _reference(name: str, command: click.Command) -> str:
    context = click.Context(command, info_name=name, **(main.context_settings | {"obj": None}))
    usage = " ".join([name, *command.collect_usage_pieces(context)])
    rows = [record for option in command.get_params(context) if (record := option.get_help_record(context))]
    # A bar in a table ends the cell, in code as well.
    cells = (" | ".join((f"`{names.replace('|', BAR)}`", _cell(text))) for names, text in rows)
    return "\n".join([f"```text\n{usage}\n```", "", "| option | does |", "|---|---|", *(f"| {row} |" for row in cells)])


def _cell(text: str) -> str:
    """Return a help text for a table cell: options and values as code, and no Markdown by accident."""
    plain = re.sub(r"([\\*_<>|\[\]])", r"\\\1", text)
    return re.sub(r"(?<![\w-])--[\w-]+", lambda option: f"`{option[0]}`", plain)
