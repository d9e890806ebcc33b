import os
import stat

import pytest

from conformance.commandline.out_folder import write_atomically


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
