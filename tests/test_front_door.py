"""The front door renders the result that a command says it wrote, whatever the command's exit code."""

import os
import signal
import subprocess
import sys

import click
import psutil
import pytest
from click.testing import CliRunner
from processes import ended

import roaas
from conformance.commandline.exit_codes import ExitCode
from conformance.commandline.result_command import CommandResult, ResultCommand
from reports import rendering


@pytest.fixture
def rendered(monkeypatch):
    folders = []
    monkeypatch.setattr(rendering, "render", lambda folder, _: folders.append(folder) or [])
    return folders


def run(callback) -> int:
    return (
        CliRunner().invoke(ResultCommand("certify", callback=callback, params=[]), [], obj=roaas.FrontDoor()).exit_code
    )


@pytest.mark.parametrize("code", list(ExitCode))
def test_a_result_is_rendered_once_whatever_the_exit_code(tmp_path, rendered, code):
    file = tmp_path / "result.json"
    file.write_text("{}")
    os.utime(file, ns=(0, 0))

    def callback() -> CommandResult:
        file.write_text("{}")
        os.utime(file, ns=(0, 0))  # on a coarse clock a new file is as old as the one before
        return CommandResult(code, file)

    assert run(callback) == code
    assert rendered == [tmp_path]


def test_a_file_that_the_command_did_not_write_is_not_rendered(tmp_path, rendered):
    def callback() -> CommandResult:
        (tmp_path / "result.json").write_text("{}")  # somebody else's
        return CommandResult(ExitCode.UNREACHABLE)

    assert run(callback) == ExitCode.UNREACHABLE
    assert rendered == []


def test_help_imports_click_and_nothing_else_that_is_installed():
    script = (
        "import sys; before = set(sys.modules); import roaas; roaas.main(['--help'], standalone_mode=False);"
        "new = {name.partition('.')[0] for name in set(sys.modules) - before};"
        "print(*new - sys.stdlib_module_names, file=sys.stderr)"
    )
    done = ended(sys.executable, "-c", script)
    assert set(done.stderr.split()) == {"roaas", "click"}


@pytest.mark.parametrize(("value", "colour"), [("", True), ("1", False)])
def test_no_color_is_kept_on_a_terminal_as_well(value, colour):
    script = (
        "import click, roaas; roaas.main.callback = None; roaas.main.add_command(click.Command('x',"
        "callback=lambda: print(click.get_current_context().color)));"
        "roaas.main.get_command = lambda _, name: roaas.main.commands[name]; roaas.main(['x'])"
    )
    done = ended(sys.executable, "-c", script, env=os.environ | {"NO_COLOR": value})
    assert done.stdout.strip() == ("None" if colour else "False")


def test_wrong_usage_renders_nothing(rendered):
    def callback() -> CommandResult:
        raise click.UsageError("no")

    assert run(callback) == ExitCode.USAGE
    assert rendered == []


def test_a_command_that_is_ended_leaves_no_process_behind(tmp_path):
    command = [sys.executable, "-m", "roaas", "selftest", "--target", "plain", "--short", "--seeds", "0"]
    process = subprocess.Popen(
        [*command, "--faults", "*-unknown", "--out", tmp_path], stderr=subprocess.PIPE, text=True
    )
    process.stderr.readline()  # a first mutant has been judged
    children = psutil.Process(process.pid).children(recursive=True)
    process.send_signal(signal.SIGTERM)
    assert process.wait(60) == ExitCode.INTERRUPTED
    process.stderr.close()
    assert children
    assert psutil.wait_procs(children, timeout=60)[1] == []
