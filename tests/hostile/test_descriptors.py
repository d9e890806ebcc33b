"""What cannot be read costs no descriptor: neither of the two readers of others' files keeps one open."""

import contextlib
import os
from pathlib import Path

import pytest
from click import ClickException

from conformance.commandline import given_files as of_results
from reports import given_files as of_reports


def large(path: Path) -> None:
    with path.open("wb") as file:
        file.truncate(1 << 30)


UNREADABLE = {
    "folder": Path.mkdir,
    "pipe": os.mkfifo,
    "device": lambda path: path.symlink_to("/dev/zero"),
    "dangling link": lambda path: path.symlink_to("nowhere"),
    "large": large,
    "nothing": lambda _: None,
}


@pytest.mark.parametrize("name", UNREADABLE)
@pytest.mark.parametrize("read", [of_results.read_octets, of_reports.read_octets], ids=["results", "reports"])
def test_a_file_that_cannot_be_read_leaves_no_descriptor_open(tmp_path, read, name):
    path = tmp_path / "given"
    UNREADABLE[name](path)
    limit = os.open("/dev/null", os.O_RDONLY)
    os.close(limit)
    for _ in range(3):
        with pytest.raises((OSError, ClickException)):
            read(path, 1000)
    with contextlib.closing(os.fdopen(os.open("/dev/null", os.O_RDONLY))) as after:
        assert after.fileno() == limit, "the lowest free descriptor is the same as before"
