"""docs/cli.md has a section for each command, and with what the site adds to it, every option."""

import importlib.util
import re
from pathlib import Path

import click
import pytest

from conformance.commandline.exit_codes import ExitCode

_ROOT = Path(__file__).parents[1]
_SPEC = importlib.util.spec_from_file_location("site_commands", _ROOT / "docs" / "site" / "commands.py")
site_commands = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(site_commands)

_PAGE = (_ROOT / "docs" / "cli.md").read_text(encoding="utf-8")
_COMMANDS = dict(site_commands.commands())


def _sections(page):
    return dict(re.findall(r"^## (.+?)\n(.*?)(?=^## |\Z)", page, re.MULTILINE | re.DOTALL))


_SECTIONS = _sections(_PAGE)
_COMPLETED = _sections(site_commands.completed(_PAGE))


def _in_help(command):
    options = [
        parameter for parameter in command.params if isinstance(parameter, click.Option) and not parameter.hidden
    ]
    return {name for option in options for name in (*option.opts, *option.secondary_opts)}


def test_the_page_has_every_command_and_no_other():
    assert {title for title in _SECTIONS if title.partition(" ")[0] == "roaas"} == set(_COMMANDS)


@pytest.mark.parametrize("name", sorted(_COMMANDS))
def test_the_site_lists_the_options_of_each_command(name):
    rows = re.findall(r"^\| `(-.+?)` \|", _COMPLETED[name], re.MULTILINE)
    assert {option for row in rows for option in re.findall(r"(?<!\w)--?[\w-]+", row)} >= _in_help(_COMMANDS[name])


def test_options_that_the_page_explains_exist():
    there = {"--help", "--ros-args"}.union(*map(_in_help, _COMMANDS.values()))
    assert set(re.findall(r"`(--[\w-]+)", _PAGE)) <= there


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
