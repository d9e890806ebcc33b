"""However a command ends, the robot that it moved is at rest, and from the first request on there is a result."""

import asyncio
import base64
import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest
from aiohttp import web
from echoing_device import authenticated
from moving_device import DESCRIPTION, MAP, Mover
from processes import Begun, ended
from small_device import REFUSED, answers, described, error, reading, small_device

import conformance.api.rest.guard
from conformance.contract.pack import Contract
from conformance.engine.resending import as_json
from conformance.transport.exchange import Request
from conformance.verdict.finding import Sent
from proof.selftest.controls import certificate
from reports.reading import read_latency

_GUARD = Path(conformance.api.rest.guard.__file__).with_name("guard_process.py")
_OPTIONS = ("--allow-motion", "--effort", "quick", "--class", "motion", "--timeout", "5")
# A process that starts a command, writes its pid, and waits for its end.
_PARENT = "import subprocess, sys; p = subprocess.Popen(sys.argv[1:]); print(p.pid, flush=True); p.wait()"


def _send(*numbers: signal.Signals) -> Callable[[subprocess.Popen[str]], object]:
    def end(process: subprocess.Popen[str]) -> None:
        for number in numbers:
            process.send_signal(number)

    return end


@dataclass(frozen=True)
class Ending:
    """How a command is ended.

    Attributes:
        name: of the case.
        moment: of the device.
        end: ends the command.
        said: is in a note of the result.
        code: the exit code; None: any.
    """

    name: str
    moment: Callable[[Mover], bool]
    end: Callable[[subprocess.Popen[str]], object]
    said: str
    code: int | None = 130


def _drives(times: int) -> Callable[[Mover], bool]:
    return lambda device: device.commands >= times and device.velocity != 0


ENDINGS = (
    Ending("Ctrl-C at the first request", lambda device: device.received >= 1, _send(signal.SIGINT), "SIGINT"),
    Ending("a closed terminal while it drives", _drives(1), _send(signal.SIGHUP), "SIGHUP"),
    Ending("a CI job that is cancelled", _drives(2), _send(signal.SIGTERM), "SIGTERM"),
    Ending("Ctrl-\\", _drives(2), _send(signal.SIGQUIT), "SIGQUIT"),
    Ending("a batch system's warning", _drives(1), _send(signal.SIGUSR1), "SIGUSR1"),
    Ending("an impatient user", _drives(1), _send(*[signal.SIGINT] * 20), "SIGINT"),
    Ending("all at once", _drives(2), _send(signal.SIGHUP, signal.SIGTERM, signal.SIGINT), "interrupted by SIG"),
)


def _statement(folder: Path, url: str) -> Path:
    path = folder / "device.toml"
    path.write_text(f'[api]\nopenapi = "{url}/openapi.json"\n{MAP}', encoding="utf-8")
    return path


def _result(out: Path) -> dict[str, object]:
    found: dict[str, object] = json.loads((out / "result.json").read_text(encoding="utf-8"))
    return found


@pytest.mark.parametrize("ending", ENDINGS, ids=lambda ending: ending.name)
def test_a_run_that_is_ended_leaves_the_device_at_rest_and_a_result(ending, tmp_path):
    device, out = Mover(), tmp_path / "out"
    with small_device(DESCRIPTION, device.routes) as url:
        words = ("certify", _statement(tmp_path, url), *_OPTIONS, "--out", out)
        with Begun(*words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT) as process:
            assert device.await_that(ending.moment, process), process.communicate()
            ending.end(process)
            said, _ = process.communicate(timeout=120)
        assert device.velocity == 0, said
    assert "Traceback" not in said
    assert process.returncode == ending.code, said
    result = _result(out)
    assert result["interrupted"] is True
    assert ending.said in " ".join(result["notes"])


def _found_by_driving(url: str, out: Path) -> Begun:
    words = ("certify", f"{url}/openapi.json", "--drive", "PUT /velocity", "--read", "GET /state", "--allow-motion")
    more = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE}
    return Begun(*words, "--yes", "--timeout", "2", "--out", out, **more)


@pytest.mark.parametrize("numbers", [(signal.SIGINT,), [signal.SIGINT] * 20, (signal.SIGTERM, signal.SIGHUP)], ids=str)
def test_a_search_for_the_map_that_is_ended_leaves_the_device_at_rest_and_says_so(numbers, tmp_path):
    device = Mover()
    with small_device(DESCRIPTION, device.routes) as url, _found_by_driving(url, tmp_path / "out") as process:
        assert device.await_that(_drives(1), process), process.communicate()
        _send(*numbers)(process)
        said = process.communicate(timeout=120)[1]
        assert device.velocity == 0, said
    assert (process.returncode, "Traceback" in said) == (130, False), said
    assert "The device was stopped.\nInterrupted by SIG" in said
    assert "no map was found, and nothing is judged" in said


def test_a_search_for_the_map_that_is_killed_leaves_the_device_at_rest(tmp_path):
    device = Mover()
    with small_device(DESCRIPTION, device.routes) as url, _found_by_driving(url, tmp_path / "out") as process:
        assert device.await_that(_drives(2), process), process.communicate()
        process.kill()
        assert device.await_that(lambda mover: mover.velocity == 0)


class _Hangs(Mover):
    """A device that drives and answers no command any more, until it is released."""

    def __init__(self) -> None:
        super().__init__()
        self.released = threading.Event()

    @property
    def routes(self):
        drive = super().routes["/velocity"]["PUT"]

        async def hang(request):
            if self.velocity:
                await asyncio.to_thread(self.released.wait, 60)
            return await drive(request)

        return super().routes | {"/velocity": {"PUT": hang}}


def test_a_second_ctrl_c_ends_the_wait_for_a_device_that_hangs_and_the_guard_goes_on(tmp_path):
    device = _Hangs()
    with small_device(DESCRIPTION, device.routes) as url, _found_by_driving(url, tmp_path / "out") as process:
        assert device.await_that(_drives(1), process), process.communicate()
        process.send_signal(signal.SIGINT)
        said = ""
        while "The stop is tried for" not in said:
            said += (line := process.stderr.readline())
            assert line, said
        process.send_signal(signal.SIGINT)
        begun = time.monotonic()
        said += process.communicate(timeout=120)[1]
        assert time.monotonic() - begun < 12, "it would be tried for 20 s"
        assert (process.returncode, "WARNING: the stop could not be delivered" in said) == (130, True), said
        assert device.velocity != 0
        device.released.set()
        assert device.await_that(lambda mover: mover.velocity == 0)


def test_a_run_ends_with_the_process_that_started_it(tmp_path):
    device, out = Mover(), tmp_path / "out"
    with small_device(DESCRIPTION, device.routes) as url:
        command = (sys.executable, "-c", _PARENT, sys.executable, "-m", "roaas", "certify", _statement(tmp_path, url))
        command += (*_OPTIONS, "--out", out)
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, stderr=subprocess.DEVNULL) as parent:
            assert device.await_that(_drives(1), parent)
            parent.kill()
            parent.communicate(timeout=120)  # the run's stdout is the parent's: it is closed at its end
        assert device.velocity == 0
    assert "interrupted by the end of its parent process" in " ".join(_result(out)["notes"])


class _MovesById:
    """A device whose moves have ids: only the newest is stopped, by its id and with the token."""

    description = described(
        {
            "/state": reading({"type": "object", "properties": {"moves": {"type": "boolean"}}}),
            "/moves": {"post": {"responses": {"201": answers({"type": "object"}), "4XX": REFUSED}}},
            "/moves/{move_id}": {
                "delete": {
                    "x-roaas-stop": True,
                    "parameters": [{"name": "move_id", "in": "path", "required": True, "schema": {"type": "string"}}],
                    "responses": {"200": answers({"type": "object"}), "4XX": REFUSED},
                }
            },
        }
    )

    def __init__(self) -> None:
        self.moves, self.number, self.is_known = False, 0, threading.Event()
        self.stopped = threading.Event()

    @property
    def routes(self):
        return {
            "/state": {"GET": self._state},
            "/moves": {"POST": self._move},
            "/moves/{move_id}": {"DELETE": self._stop},
        }

    async def _state(self, _):
        if self.number >= 2:
            self.is_known.set()  # the response to the move has arrived before
        return web.json_response({"moves": self.moves})

    async def _move(self, _):
        if self.is_known.is_set():
            return error(409, "no further move")  # the run, which is being killed, would not learn its id
        self.moves, self.number = True, self.number + 1
        self.stopped.clear()
        return web.json_response({"move_id": f"m{self.number}"}, status=201)

    async def _stop(self, request):
        if (
            request.match_info["move_id"] != f"m{self.number}"
            or request.headers.get("Authorization") != "Bearer s3same"
        ):
            return error(404, "no such move")
        self.moves = False
        self.stopped.set()
        return web.json_response({})


def _guards() -> set[str]:
    """Return command and environment of each process that guards a device."""
    shown = ended("ps", "axeww", "-o", "pid=,command=").stdout.splitlines()
    return {line for line in shown if str(_GUARD) in line}


def test_a_run_that_is_killed_leaves_the_device_at_rest(tmp_path):
    device, out = Mover(), tmp_path / "out"
    with small_device(DESCRIPTION, device.routes) as url:
        words = ("certify", _statement(tmp_path, url), *_OPTIONS, "--out", out)
        with Begun(*words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
            assert device.await_that(_drives(2), process)
            process.kill()
        assert device.await_that(lambda mover: mover.velocity == 0)
    assert "it was killed" in " ".join(_result(out)["notes"])


def test_a_killed_run_stops_the_newest_move_and_shows_the_token_to_nobody(tmp_path):
    device, token = _MovesById(), tmp_path / "token"
    token.write_text("s3same", encoding="utf-8")
    token.chmod(0o600)
    with small_device(device.description, device.routes) as url:
        words = ("certify", url, "--call", "POST /moves", "--token-file", token, "--out", tmp_path / "out")
        before = _guards()
        with Begun(*words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
            assert device.is_known.wait(120)
            shown = _guards() - before
            process.kill()
        assert device.stopped.wait(60)
    assert shown
    assert not any("s3same" in one for one in shown)


@dataclass(frozen=True)
class Told:
    """What a guard gets from the process that it outlives.

    Attributes:
        name: of the case.
        last: what follows the stop on its standard input.
        statuses: how the device responds to one stop after another; the last one stays; 0: it closes the connection.
        stops: how many stops the device gets at least; 0: none at all.
        tls: whether the device speaks TLS.
    """

    name: str
    last: bytes
    statuses: tuple[int, ...] = (200,)
    stops: int = 3
    tls: bool = False


TOLD = (
    Told("the run is killed", b""),
    Told("the run is done", b"done\n", stops=0),
    Told("the run is killed while it writes", b'{"stops": ['),
    Told("the run is killed while it ends", b"do"),
    Told("the device is busy", b"", (503, 0, 429, 500, 0, 408, 200), 7),
    Told("the device speaks TLS", b"", tls=True),
)


class _Stopped(BaseHTTPRequestHandler):
    def do_PUT(self):
        octets = self.rfile.read(int(self.headers["Content-Length"]))
        statuses = self.server.statuses
        status = statuses.pop(0) if len(statuses) > 1 else statuses[0]
        self.server.stops.append((self.path, octets))
        self.server.first.set()
        if status:
            self.send_response(status)
            self.send_header("Content-Length", "0")
            self.end_headers()

    def log_message(self, *_):
        pass


@pytest.mark.parametrize("told", TOLD, ids=lambda told: told.name)
def test_a_guard_stops_the_device_unless_that_is_done(told, tmp_path):
    server = ThreadingHTTPServer(("127.0.0.1", 0), _Stopped)
    server.statuses, server.stops, files = list(told.statuses), [], None
    server.first = threading.Event()
    if told.tls:
        context, ca_file = certificate(tmp_path)
        server.socket = context.wrap_socket(server.socket, server_side=True)
        files = json.dumps([str(ca_file)])
    request = b"PUT /v HTTP/1.1\r\nHost: robot\r\nContent-Length: 1\r\nConnection: close\r\n\r\n0"
    stop = {
        "host": "localhost" if told.tls else "127.0.0.1",
        "port": server.server_port,
        "tls": files,
        "request": base64.b64encode(request).decode(),
    }
    given = json.dumps({"stops": [stop], "for_s": 60, "deadline_s": 10}).encode() + b"\n"
    threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True).start()
    with subprocess.Popen((sys.executable, "-I", "-S", _GUARD), stdin=subprocess.PIPE) as guard:
        guard.stdin.write(given + told.last)
        guard.stdin.close()
        if told.stops:
            assert server.first.wait(120)
            for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT):
                guard.send_signal(number)
        assert guard.wait(120) == 0
    server.shutdown()
    server.server_close()
    assert len(server.stops) >= told.stops
    assert {*server.stops} == ({("/v", b"0")} if told.stops else set())


def test_a_guard_answers_the_challenges_of_a_device_that_takes_each_once():
    stops, nonces = [], []

    async def stop(request):
        if authenticated(request, "operator", "s3cret") and nonces and nonces[-1] in request.headers["Authorization"]:
            stops.append(await request.read())
        else:
            nonces.append(f"n{len(nonces)}x")
            challenge = f'Digest realm="lab", nonce="{nonces[-1]}", qop="auth,auth-int", opaque="o"'
            return web.Response(status=401, headers={"WWW-Authenticate": challenge})
        nonces.append("used")
        return web.Response(status=204)

    with small_device({}, {"/stop": {"POST": stop}}) as url:
        request = b"POST /stop HTTP/1.1\r\nHost: x\r\nAuthorization: Digest old\r\nContent-Length: 1\r\n\r\n0"
        told = {
            "host": "127.0.0.1",
            "port": int(url.rpartition(":")[2]),
            "tls": None,
            "request": base64.b64encode(request).decode(),
            "digest": ["operator:s3cret", sys.path],
        }
        given = json.dumps({"stops": [told], "login": None, "for_s": 60, "deadline_s": 10}) + "\n"
        ended(sys.executable, "-I", "-S", _GUARD, input=given, check=True)
    assert stops == [b"0"] * 3


def _load(folder: Path, url: str) -> subprocess.Popen[str]:
    command = (sys.executable, "-m", "roaas", "load", _statement(folder, url), "--operation", "PUT /velocity")
    more = (
        "--allow-motion",
        "--call=PUT /velocity",
        "--rate=50",
        "--duration=60",
        "--warmup=0",
        "--out",
        folder / "out",
    )
    return subprocess.Popen((*command, *more), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


@pytest.mark.parametrize("numbers", [(signal.SIGHUP,), (signal.SIGINT, signal.SIGTERM, signal.SIGINT)], ids=str)
def test_a_load_test_that_is_ended_leaves_the_device_at_rest_and_a_result(numbers, tmp_path):
    device = Mover()
    with small_device(DESCRIPTION, device.routes) as url, _load(tmp_path, url) as process:
        assert device.await_that(lambda mover: mover.commands >= 50, process), process.communicate()
        _send(*numbers)(process)
        said, _ = process.communicate(timeout=120)
        assert device.velocity == 0, said
    assert process.returncode == 130, said
    assert json.loads((tmp_path / "out/latency.json").read_text(encoding="utf-8"))["interrupted"] is True


def test_a_load_test_that_is_killed_leaves_the_device_at_rest(tmp_path):
    device = Mover()
    with small_device(DESCRIPTION, device.routes) as url, _load(tmp_path, url) as process:
        assert device.await_that(lambda mover: mover.commands >= 50, process), process.communicate()
        process.kill()
        process.communicate(timeout=120)  # its child has the same stdout
        assert device.await_that(lambda mover: mover.velocity == 0)
        received = device.received
        assert device.await_that(lambda mover: mover.received >= received + 2)  # the guard stops it again
        assert device.velocity == 0
    assert json.loads((tmp_path / "out/latency.json").read_text(encoding="utf-8"))["interrupted"] is True


def test_a_load_test_whose_measuring_process_is_killed_leaves_the_device_at_rest_and_says_so(tmp_path):
    device = Mover()
    with small_device(DESCRIPTION, device.routes) as url, _load(tmp_path, url) as process:
        assert device.await_that(lambda mover: mover.commands >= 50, process), process.communicate()
        running = [line.split(None, 2) for line in ended("ps", "-A", "-o", "ppid=,pid=,command=").stdout.splitlines()]
        (pid,) = (int(pid) for parent, pid, words in running if parent == str(process.pid) and "loadtests" in words)
        os.kill(pid, signal.SIGKILL)
        said, _ = process.communicate(timeout=120)
        assert device.velocity == 0, said
    assert "the process that measures was ended by SIGKILL" in said
    assert process.returncode == 4
    found = read_latency(tmp_path / "out/latency.json")
    assert (found["interrupted"], found["valid"], found["exit_code"]) == (True, False, 4)
    assert found["invalid_because"] == ["the run has not ended: it is under way, or it was killed"]


def test_a_replay_that_is_killed_leaves_the_robot_at_rest(tmp_path):
    moving, resting, seen = threading.Event(), threading.Event(), []

    async def drive(request):
        x = (await request.json())["linear"]["x"]
        seen.append(x)
        (moving if x else resting).set()
        return web.Response(status=204)

    still = {"x": 0.0, "y": 0.0, "z": 0.0}
    contract = Contract.load()
    with small_device(described({}), {"/robot/velocity/": {"PUT": drive}, "/robot/pose/": {"GET": drive}}) as url:
        body = json.dumps({"linear": still | {"x": 0.3}, "angular": still}).encode()
        put = Request("PUT", f"{url}/robot/velocity/", (("Content-Type", "application/json"),), body)
        sequence = as_json([Sent(0.0, put), Sent(9.0, Request("GET", f"{url}/robot/pose/", ()))])  # killed in the pause
        response = {"status": 500, "headers": {}, "body": None}
        found = {"number": 1, "message": "500", "response": response, "sequence": sequence}
        document = {
            "format": "roaas-result/1",
            "suite": {"contract": contract.label},
            "target": {"rest": url},
            "requirements": [{"id": "http/head", "failures": [found]}],
        }
        (tmp_path / "result.json").write_text(json.dumps(document), encoding="utf-8")
        with Begun("replay", tmp_path, "--allow-motion", stdout=subprocess.DEVNULL) as process:
            assert moving.wait(60)
            process.kill()
        assert resting.wait(60)
    assert seen[0] == pytest.approx(0.3)
    assert not any(seen[1:])


def test_the_runs_of_a_fleet_that_is_killed_end_in_order(tmp_path):
    device, out = Mover(), tmp_path / "out"
    with small_device(DESCRIPTION, device.routes) as url:
        statement = _statement(tmp_path, url)
        fleet = tmp_path / "fleet.toml"
        fleet.write_text(f'[[robot]]\nname = "cart"\nstatement = "{statement.name}"\n', encoding="utf-8")
        words = ("certify", "--fleet", fleet, *_OPTIONS[:-2], "--out", out)
        with Begun(*words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
            assert device.await_that(_drives(1), process)
            process.kill()
        path = out / "robots/cart/result.json"
        assert device.await_that(lambda _: "the end of its parent process" in path.read_text(encoding="utf-8"))
        assert device.velocity == 0
