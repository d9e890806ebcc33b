"""Help pages are short and in groups; what is nearly right is suggested; roaas.toml is found."""

import os
import sys

import click
import pytest
from click.testing import CliRunner
from processes import ended

import roaas
from conformance.commandline.help_pages import Group, GroupedCommand, options_of

SHOWN = {"certify": 30, "load": 35}


def output(*words: str) -> str:
    return CliRunner().invoke(roaas.main, list(words)).output


def lines_with_options(text: str) -> list[str]:
    return [line.split()[0] for line in text.splitlines() if line.startswith("  -")]


@pytest.mark.parametrize("name", SHOWN)
def test_help_shows_few_options_in_groups_and_help_all_shows_every(name):
    short, whole = output(name, "--help"), output(name, "--help-all")
    assert len(lines_with_options(short)) <= SHOWN[name]
    command = roaas.main.get_command(None, name)
    options = [one for one in command.params if isinstance(one, click.Option) and not one.hidden]
    assert all(one.opts[0] in whole for one in options)
    heads = [line.rstrip(":") for line in whole.splitlines() if line.endswith(":") and not line.startswith(" ")]
    assert heads == [group for group in Group if group in heads]
    assert {"Device", "What may be called", "Credentials", "Effort", "Output"} <= set(heads)
    assert f"more options: main {name} --help-all" in short


def test_each_option_of_certify_and_load_has_a_group():
    for name in SHOWN:
        ungrouped = [one.name for one in roaas.main.get_command(None, name).params if "roaas_place" not in vars(one)]
        assert set(ungrouped) == {"targets", "help_all"}


def test_an_option_takes_the_group_that_it_stands_below():
    @click.command(cls=GroupedCommand)
    @options_of(Group.DEVICE)
    @click.option("--first")
    @options_of(Group.OUTPUT, rare=True)
    @click.option("--second")
    def command(**_: object) -> None: ...

    short = CliRunner().invoke(command, ["--help"]).output
    assert "Device:\n  --first" in short
    assert "--second" not in short
    assert "Output:\n  --second" in CliRunner().invoke(command, ["--help-all"]).output


@pytest.mark.parametrize("words", [(), ("certify",), ("load",)])
def test_without_arguments_three_commands_are_shown_with_the_address_first(words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    found = CliRunner().invoke(roaas.main, list(words))
    commands = [line.split() for line in found.stderr.splitlines() if line.startswith("  roaas")]
    assert found.exit_code == 2
    assert len(commands) == 3
    assert all(one[2] == "http://robot:8000/openapi.json" for one in commands if one[1] in SHOWN)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        (("certfy",), "Did you mean: roaas certify"),
        (("http://robot/openapi.json",), "Did you mean: roaas certify http://robot/openapi.json"),
        (("certify", "--calls", "x"), "'--call'"),
    ],
)
def test_what_is_nearly_right_is_suggested(words, meant):
    found = CliRunner().invoke(roaas.main, list(words))
    assert found.exit_code == 2
    assert meant in found.stderr


@pytest.mark.parametrize(("name", "value"), [("TERM", "dumb"), ("NO_COLOR", "1")])
def test_colours_are_off_where_they_are_not_wanted(name, value):
    script = "import roaas; print(roaas.main.context_settings['color'])"
    assert ended(sys.executable, "-c", script, env=os.environ | {name: value}).stdout.strip() == "False"


@pytest.mark.parametrize("width", [60, 120, 200])
def test_help_is_as_wide_as_the_terminal(width):
    told = ended(sys.executable, "-m", "roaas", "certify", "--help", env=os.environ | {"COLUMNS": str(width)}).stdout
    widest = max(map(len, told.splitlines()))
    assert width * 0.7 < widest <= width


@pytest.mark.parametrize("command", ["certify", "load"])
def test_the_usual_statement_is_found_and_said(command, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "roaas.toml").write_text("[endpoints]\nrest = 'nowhere'\n")
    found = CliRunner().invoke(roaas.main, [command, "--out", "out"])
    assert found.exit_code == 2
    assert "statement: roaas.toml" in found.stderr
    assert "nowhere" in found.stderr
    # What names a device goes before it.
    assert "roaas.toml" not in CliRunner().invoke(roaas.main, [command, "--rest", "elsewhere"]).stderr
