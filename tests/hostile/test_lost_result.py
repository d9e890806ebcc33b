"""A result is never lost or written elsewhere, and no exit code but that of a verdict is 1."""

import datetime as dt
import errno
import json
import resource
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path

import click
import pytest
from aiohttp import web
from click.testing import CliRunner
from processes import Begun, ended
from small_device import Handle, constant, described, reading, small_device

import roaas
from conformance.commandline import endings
from conformance.commandline.out_folder import LOCK_NAME
from conformance.contract.pack import Contract
from proof.cli.selftest import _finish
from proof.selftest.report import Report

_OBJECT = {"type": "object"}
_DESCRIPTION = described({"/state": reading(_OBJECT)})


def _command(url: str, out: Path, *more: object) -> list[str]:
    words = [sys.executable, "-m", "roaas", "certify", f"{url}/openapi.json", "--effort=quick", "--out", out, *more]
    return [str(word) for word in words]


def _result(folder: Path) -> dict[str, object]:
    found: dict[str, object] = json.loads((folder / "result.json").read_text(encoding="utf-8"))
    return found


def _first(action: Callable[[], object]) -> dict[str, Handle]:
    """Return the handlers of a resource; the first request does something in a thread of its own."""
    done = threading.Event()

    async def handle(_: web.Request) -> web.Response:
        if not done.is_set():
            done.set()
            action()
        return web.json_response({})

    return {"GET": handle}


def _all(out: Path) -> None:
    # In one step: while files are removed one by one, the run may write another.
    out.rename(out.with_name("lost"))
    out.touch()


def _place(out: Path) -> None:
    (out / "result.json").unlink()
    (out / "result.json" / "folder").mkdir(parents=True)


@pytest.mark.parametrize("lose", [_all, _place])
def test_a_folder_that_is_lost_during_the_run_does_not_lose_the_result(lose, tmp_path, monkeypatch):
    out, elsewhere = tmp_path / "out", tmp_path / "tmp"
    elsewhere.mkdir()
    monkeypatch.setenv("TMPDIR", str(elsewhere))

    with small_device(_DESCRIPTION, {"/state": _first(lambda: lose(out))}) as url:
        done = ended(*_command(url, out, "--class", "description"))
    assert done.returncode == 4, done.stderr
    (kept,) = elsewhere.glob("roaas-result-*/result.json")
    (said,) = (line for line in done.stderr.splitlines() if line.startswith("error: "))
    assert f"the result could not be written to {out}: " in said
    assert str(kept) in said
    assert _result(kept.parent)["interrupted"] is False


def test_a_self_test_whose_folder_takes_nothing_names_the_folder_and_prints_what_it_found(tmp_path, capsys):
    (tmp_path / "file").touch()
    out, report = tmp_path / "file/out", Report(Contract.load(), "plain")
    with pytest.raises(SystemExit) as ended_with:
        _finish(report, lambda: None, {"out": out})
    said = capsys.readouterr()
    assert ended_with.value.code == 4
    assert report.summary() in said.out
    assert said.err.startswith(f"error: the result could not be written to {out}: ")


def _no_room() -> None:
    resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, 10_000))


@pytest.mark.parametrize(
    ("out", "limit"),
    [("file/out", None), ("out", _no_room), ("/proc/roaas", None)],
    ids=["below a file", "no room", "of the system"],
)
def test_a_folder_that_takes_no_result_is_found_before_the_first_request(tmp_path, out, limit):
    (tmp_path / "file").touch()
    requests = []
    with small_device(_DESCRIPTION, {"/state": _first(lambda: requests.append(1))}) as url:
        done = ended(*_command(url, tmp_path / out), preexec_fn=limit)
    assert (done.returncode, requests) == (2, [])
    assert f"--out {tmp_path / out}: nothing can be written to this folder" in done.stderr


def test_a_run_keeps_others_out_of_its_folder_until_it_ends_or_is_killed(tmp_path):
    reached = threading.Event()

    async def handle(_: web.Request) -> web.Response:
        reached.set()
        return web.json_response({})

    with small_device(_DESCRIPTION, {"/state": {"GET": handle}}) as url:
        command = _command(url, tmp_path, "--class", "description")
        with Begun(*command[3:], "--request-rate", "1", stderr=subprocess.DEVNULL) as first:
            assert reached.wait(100)
            second = ended(*command)
            assert second.returncode == 2
            assert f"another run uses this folder: process {first.command_pid} on" in second.stderr
            first.send_signal(signal.SIGKILL)
            first.wait(30)
        assert (tmp_path / LOCK_NAME).exists()
        third = ended(*command)
    assert third.returncode == 0, third.stderr
    assert not (tmp_path / LOCK_NAME).exists()


def test_links_in_the_folder_are_replaced_and_not_followed(tmp_path):
    out, outside = tmp_path / "out", tmp_path / "outside"
    out.mkdir()
    (outside / "folder").mkdir(parents=True)
    pages = ("certificate.html", "certificate.md", "junit.xml")
    names = ("result.json", *pages, "traces.json.gz", "history.jsonl.gz", LOCK_NAME)
    for name in names:
        (outside / name).write_text("precious", encoding="utf-8")
        (out / name).symlink_to(outside / name)
    (out / "description").symlink_to(outside / "folder")
    with small_device(_DESCRIPTION, {"/state": constant({})}) as url:
        done = ended(*_command(url, out, "--class", "description"))
    assert done.returncode == 0, done.stderr
    assert {(outside / name).read_text(encoding="utf-8") for name in names} == {"precious"}
    assert list((outside / "folder").iterdir()) == []
    assert not [path for path in out.iterdir() if path.is_symlink()]
    assert _result(out)["verdict"] == "conformant"


def test_a_clock_that_is_set_back_makes_no_run_end_before_it_began(monkeypatch):
    begun = endings.Started()

    class SetBack(dt.datetime):
        @classmethod
        def now(cls, tz: dt.tzinfo | None = None) -> dt.datetime:
            return super().now(tz) - dt.timedelta(days=2)

    monkeypatch.setattr(dt, "datetime", SetBack)
    assert dt.timedelta(0) <= begun.now - begun.at < dt.timedelta(hours=1)


_RAISED = [
    (click.Abort(), 130),
    (KeyboardInterrupt(), 130),
    (click.ClickException("no"), 2),
    (click.FileError("robot.toml"), 2),
    (MemoryError(), 4),
    (ImportError("no module"), 4),
    (BrokenPipeError(errno.EPIPE, "closed"), 4),
    (OSError(errno.ENOSPC, "full"), 4),
    (AssertionError(), 4),
    (RuntimeError("odd"), 4),
    (RecursionError("deep"), 4),
    (EOFError(), 4),
]


@pytest.mark.parametrize("command", ["explain", "diff", "certify", "report"])
@pytest.mark.parametrize(("raised", "code"), _RAISED, ids=lambda value: type(value).__name__)
def test_what_a_command_does_not_expect_never_ends_with_1(raised, code, command, monkeypatch, tmp_path):
    def broken(**_: object) -> None:
        raise raised

    monkeypatch.setenv("TMPDIR", str(tmp_path))
    found = roaas.main.get_command(click.Context(roaas.main), command)
    monkeypatch.setattr(found, "callback", broken)
    monkeypatch.setattr(found, "params", [])
    monkeypatch.setattr(found, "_start", "", raising=False)  # without arguments, certify says what to try
    done = CliRunner().invoke(roaas.main, [command])
    assert done.exit_code == code
    assert "Traceback" not in done.output
    assert code != 4 or len(done.output.strip().splitlines()) == 1


#: Limits of addresses (ulimit -v), MB: from where `roaas --version` works to where a run does.
_LIMITS = {"explain": (90,), "certify": (30, 110, 390), "load": (600, 1_190), "diff": (60,)}


@pytest.mark.parametrize(("command", "limit"), [(name, limit) for name, each in _LIMITS.items() for limit in each])
def test_a_limit_of_memory_is_told_in_one_line(command: str, limit: int, tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text(json.dumps(_DESCRIPTION), encoding="utf-8")
    more = {"explain": ["http/date"], "diff": [tmp_path / "a.json"]}.get(command, ["--out", tmp_path / "out"])
    words = (command, *([] if command == "explain" else [tmp_path / "a.json"]), *more)
    within = f'ulimit -v {limit * 1024}; exec "$@"'

    done = ended("bash", "-c", within, "bash", sys.executable, "-m", "roaas", *words)

    assert "Traceback" not in done.stderr
    assert done.returncode == 4 or (done.returncode == 0 and command in {"explain", "diff"}), done.stderr
    assert done.returncode == 0 or len(done.stderr.splitlines()) == 1, done.stderr


def test_a_run_within_the_least_memory_has_a_result(tmp_path: Path) -> None:
    with small_device(_DESCRIPTION, {"/state": constant({})}) as url:
        within = f'ulimit -v {400 * 1024}; exec "$@"'
        done = ended("bash", "-c", within, "bash", *_command(url, tmp_path, "--class", "description"))
    assert done.returncode == 0, done.stderr
    assert _result(tmp_path)["verdict"] == "conformant"


@pytest.mark.parametrize("streams", [">/dev/full", ">&-", "| true", "<&- >&- 2>&-"])
def test_output_that_nobody_takes_is_no_failure(streams):
    words = "--help" if streams.endswith("&-") else "explain http/date"
    command = f"set -o pipefail; {sys.executable} -m roaas {words} {streams}"
    assert ended("bash", "-c", command).returncode == 0


def test_a_run_that_cannot_be_signed_as_it_was_asked_to_does_not_pass(tmp_path: Path) -> None:
    assert ended(sys.executable, "-m", "roaas", "keygen", tmp_path / "keys").returncode == 0
    (tmp_path / "out/certificate.md/folder").mkdir(parents=True)
    with small_device(_DESCRIPTION, {"/state": constant({})}) as url:
        unsigned = ended(*_command(url, tmp_path / "out"))
        signed = ended(*_command(url, tmp_path / "out", "--sign", tmp_path / "keys/signing-key.pem"))
    assert unsigned.returncode == 0, unsigned.stderr
    assert (signed.returncode, "could not be written or signed" in signed.stderr) == (4, True), signed.stderr
