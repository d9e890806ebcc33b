"""A disk that fills up while a robot moves: the robot is stopped, the folder is named, and nothing passes."""

import contextlib
import errno
import os
import resource
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from moving_device import DESCRIPTION, MAP, Mover
from processes import ended
from small_device import small_device

pytestmark = pytest.mark.side_by_side
_MOUNTED = 'mount -t tmpfs -o size=4m none "$0" && exec "$@"'
_CERTIFY = ("certify", "--effort", "quick", "--class", "motion")
_LOAD = ("load", "--operation", "PUT /velocity", "--call", "PUT /velocity", "--rate=50", "--duration=10", "--warmup=0")


def _fill(pid: int, folder: Path) -> None:
    """Take the last octet of the file system that only the process sees."""
    with contextlib.suppress(OSError), Path(f"/proc/{pid}/root{folder}/other").open("wb", buffering=0) as file:
        while file.write(bytes(1 << 12)):
            pass


def _forbid(pid: int, _: Path) -> None:
    """Let the process and its children write no octet to any file: EFBIG, as Python ignores SIGXFSZ."""
    children = (path.read_text() for path in Path(f"/proc/{pid}/task").glob("*/children"))
    for of in (pid, *(int(child) for told in children for child in told.split())):
        resource.prlimit(of, resource.RLIMIT_FSIZE, (0, resource.RLIM_INFINITY))


# A file system of its own where the system allows one, and everywhere a limit that also holds for temporary files.
_MAY_MOUNT = ended("unshare", "-m", "true").returncode == 0
_WAYS = {_forbid: ()} | ({_fill: ("unshare", "-m", "sh", "-c", _MOUNTED)} if _MAY_MOUNT else {})
_FILL = _fill if _MAY_MOUNT else _forbid


@pytest.mark.parametrize(
    ("fill", "words", "written"), [(_FILL, _CERTIFY, "result.json"), (_forbid, _LOAD, "latency.json")]
)
def test_a_disk_that_fills_up_while_a_robot_moves_leaves_it_at_rest(
    fill: Callable[[int, Path], None], words: tuple[str, ...], written: str, tmp_path: Path
) -> None:
    device, out, statement = Mover(), tmp_path / "out", tmp_path / "device.toml"
    out.mkdir()
    mounting = _WAYS[fill] and (*_WAYS[fill], out)
    with small_device(DESCRIPTION, device.routes) as url:
        statement.write_text(f'[api]\nopenapi = "{url}/openapi.json"\n{MAP}', encoding="utf-8")
        command = (*mounting, sys.executable, "-m", "roaas", *words, statement, "--allow-motion", "--out", out)
        with subprocess.Popen(
            list(map(str, command)), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        ) as run:
            assert device.await_that(lambda mover: mover.commands >= 1, run), run.communicate()
            fill(run.pid, out)
            said, _ = run.communicate(timeout=180)
        assert device.velocity == 0, said
    assert run.returncode == 4, said
    assert "Traceback" not in said
    (line,) = (line for line in said.splitlines() if line.startswith(("error: ", "roaas load: ")))
    assert str(out) in line
    assert os.strerror(errno.ENOSPC) in line or os.strerror(errno.EFBIG) in line
    assert f"written: {out / written}" not in said
