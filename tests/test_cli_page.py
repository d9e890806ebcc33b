"""docs/cli.md says what `--help` says: every command, every option, every exit code, and no other."""

import re
from pathlib import Path

import click
import pytest

from conformance.commandline.exit_codes import ExitCode
from roaas import main

_PAGE = (Path(__file__).parents[1] / "docs" / "cli.md").read_text(encoding="utf-8")
_SECTIONS = dict(re.findall(r"^## (.+?)\n(.*?)(?=^## |\Z)", _PAGE, re.MULTILINE | re.DOTALL))


def _commands(group: click.Group, name: str) -> dict[str, click.Command]:
    found: dict[str, click.Command] = {}
    context = click.Context(group)
    for word in group.list_commands(context):
        command = group.get_command(context, word)
        assert command is not None
        inner = isinstance(command, click.Group)
        found |= _commands(command, f"{name} {word}") if inner else {f"{name} {word}": command}
    return found


_COMMANDS = _commands(main, "roaas")


def _in_help(command: click.Command) -> set[str]:
    options = [parameter for parameter in command.params if isinstance(parameter, click.Option)]
    return {name for option in options for name in (*option.opts, *option.secondary_opts)}


def _in_page(section: str) -> set[str]:
    rows = re.findall(r"^\| (`-.+?) \|", section, re.MULTILINE)
    return {name for row in rows for name in re.findall(r"`(-[\w-]+)", row)}


def test_the_page_has_every_command_and_no_other():
    assert {title for title in _SECTIONS if title.startswith("roaas ")} == set(_COMMANDS)


@pytest.mark.parametrize("name", sorted(_COMMANDS))
def test_a_command_has_the_options_that_its_section_lists(name):
    assert _in_page(_SECTIONS[name]) == _in_help(_COMMANDS[name])


def test_options_of_the_front_door():
    assert _in_page(_SECTIONS["roaas"]) == {*_in_help(main), "-h", "--help"}


def test_the_exit_codes_are_those_of_all_commands():
    listed = re.findall(r"^\| (\d+) \|", _SECTIONS["Exit codes"], re.MULTILINE)
    assert [int(code) for code in listed] == list(ExitCode)


@pytest.mark.parametrize("name", sorted(_COMMANDS))
def test_a_command_says_which_exit_codes_it_has(name):
    said = re.search(r"Exit codes: ([\d,\s]+)\.", _SECTIONS[name])
    assert said is not None
    on_page = {int(code) for code in said[1].split(",")}
    assert on_page <= set(ExitCode)
    in_help = (_COMMANDS[name].help or "").partition("Exit code")[2]
    assert {int(code) for code in re.findall(r"\b\d+\b", in_help)} <= on_page
