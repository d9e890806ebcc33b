"""What commands write: texts without control of a terminal or a CI job, and files whole or not at all."""

import os
import stat

import pytest

from conformance.commandline.guard import inert_lines
from conformance.commandline.help_pages import inert
from conformance.commandline.out_folder import command_without_folders, without_folders, write_atomically
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


@pytest.fixture
def umask():
    before = os.umask(0o022)
    yield os.umask
    os.umask(before)


def test_a_file_is_replaced_and_no_draft_is_left(tmp_path):
    path = tmp_path / "result.json"
    assert write_atomically(path, "old") == path
    write_atomically(path, "new: é\n")
    assert path.read_text(encoding="utf-8") == "new: é\n"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(("mask", "mode"), [(0o022, 0o644), (0o027, 0o640), (0o077, 0o600), (0o002, 0o664)])
def test_who_may_read_it_follows_the_umask(tmp_path, umask, mask, mode):
    umask(mask)
    assert stat.S_IMODE(write_atomically(tmp_path / "latency.json", "{}").stat().st_mode) == mode


def test_what_cannot_be_written_leaves_the_old_file_and_no_draft(tmp_path):
    path = write_atomically(tmp_path / "result.json", "old")
    with pytest.raises(UnicodeEncodeError):
        write_atomically(path, "a lone surrogate: \udc80")
    assert path.read_text(encoding="utf-8") == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_folder_in_its_place_is_no_file_to_replace(tmp_path):
    (tmp_path / "result.json").mkdir()
    with pytest.raises(OSError, match=r"result\.json"):
        write_atomically(tmp_path / "result.json", "new")
    assert [path.name for path in tmp_path.iterdir()] == ["result.json"]


def test_a_missing_folder_is_an_error(tmp_path):
    with pytest.raises(FileNotFoundError):
        write_atomically(tmp_path / "gone" / "result.json", "new")
