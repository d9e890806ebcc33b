"""The front door renders the result that a command says it wrote, whatever the command's exit code."""

import os
import signal
import subprocess
import sys

import click
import psutil
import pytest
from click.testing import CliRunner

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
