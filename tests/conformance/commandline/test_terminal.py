"""What is shown of a text and of a command: nothing that controls a terminal or a CI job, and no folder of the user."""

import pytest

from conformance.commandline.guard import inert_lines
from conformance.commandline.help_pages import inert
from conformance.commandline.out_folder import command_without_folders, without_folders
from reports.pages.untrusted import on_a_line


@pytest.mark.parametrize("safe", [inert, on_a_line])
@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("GET /a is 404", "GET /a is 404"),
        ("connect to ::1 or [::]", "connect to ::1 or [::]"),
        ("## a heading", "## a heading"),
        ("\x1b[2J", "\\x1b[2J"),
        ("\u202egood", "\\u202egood"),
        ("::error::a", "\\::error::a"),
        ("  ::error::a", "::error::a"),
        ("##[error]a", "#\\#[error]a"),
        ("a ##vso[task.complete]", "a #\\#vso[task.complete]"),
    ],
)
def test_a_text_acts_on_nothing(safe, text, shown):
    done = safe(text)
    assert shown in done
    assert not done.lstrip().startswith("::")


def test_lines_stay_lines():
    assert inert_lines("a\n::error::b\x07") == "a\n\\::error::b\\x07"


@pytest.mark.parametrize(
    ("word", "shown"),
    [
        ("--out={here}/out/new", "--out=out/new"),
        ("{here}/robot.toml", "robot.toml"),
        ("file://{here}/a.wsdl", "a.wsdl"),
        ("{here}beside/robot.toml", "robot.toml"),
        ("--out=/home/me/x/out", "--out=out"),
        ("file:///home/me/a.wsdl", "a.wsdl"),
        ("sub/robot.toml", "sub/robot.toml"),
        ("http://robot:7003/base/path", "http://robot:7003/base/path"),
        ("sh ~/bin/restart /etc/robot/x", "sh restart x"),
    ],
)
def test_a_path_is_relative_to_the_working_directory_and_elsewhere_a_name(tmp_path, monkeypatch, word, shown):
    monkeypatch.chdir(tmp_path)
    assert without_folders(word.format(here=tmp_path)) == shown


def test_a_command_keeps_what_looks_like_a_file_and_is_none():
    words = ["certify", "--call", "POST /api/move/*", "--never=/api/reset", "--out", "/home/me/out"]
    shown = command_without_folders(words, ("--call", "--never"))
    assert shown == "roaas certify --call 'POST /api/move/*' --never=/api/reset --out out"
