import pytest

from conformance.commandline.out_folder import command_without_folders, without_folders


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
