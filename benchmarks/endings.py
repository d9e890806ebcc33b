"""Whether a robot rests and a result is there, however and whenever a run ends.

``python benchmarks/endings.py --robot reference --moments 30`` certifies the robot again and again with --allow-motion,
and interrupts each run at a moment inside it: by SIGINT, SIGTERM, SIGHUP, its parent's death, or kill -9. After each
five of these, stdout and stderr of one more run are closed, which must not end it. For every second moment it waits
until it has seen the robot moving a random number of times (``SEEN_S`` apart), for the others until the run has sent a
random number of requests. Three runs of five are whole, the others claim only the class whose checks move the robot.
Exit code 0: at rest with a readable result after all of them, and no closed run interrupted; 1 otherwise.
"""

import argparse
import asyncio
import contextlib
import json
import logging
import os
import random
import signal
import subprocess
import sys
import tempfile
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import urlsplit

from programs import machine, started

from conformance.selftest.robots import own_domain
from reports.errors import ReportError
from reports.reading import read_result

sys.path[:0] = [str(Path(__file__).parents[1] / "tests" / folder) for folder in ("", "hostile")]
from moving_device import DESCRIPTION, MAP, Mover  # noqa: E402 - found by the path above
from small_device import small_device  # noqa: E402 - as above

CLOSED = "closed pipes"
HOWS = ("SIGINT", "SIGTERM", "SIGHUP", "parent killed", "kill -9", CLOSED)
SEEN_S = 0.02
_CERTIFY = (sys.executable, "-m", "roaas", "certify", "--allow-motion", "--effort", "quick", "--out")
_PARENT = "import subprocess, sys; p = subprocess.Popen(sys.argv[1:]); print(p.pid, flush=True); p.wait()"
_RESTS_WITHIN_S, _STAYS_S = 10.0, 1.0


class Reference:
    """The reference robot behind relays that count the requests to it."""

    moving_class = "safety"

    def __init__(self, rest: str, soap: str) -> None:
        self.requests, self._rest, loop = 0, rest, asyncio.new_event_loop()
        threading.Thread(target=loop.run_forever, daemon=True).start()
        ports = [asyncio.run_coroutine_threadsafe(self._relay(url), loop).result() for url in (rest, soap)]
        path = urlsplit(soap)
        wsdl = f"http://127.0.0.1:{ports[1]}{path.path}?{path.query}"
        self.target = ("--rest", f"http://127.0.0.1:{ports[0]}", "--publishers-wsdl", wsdl)

    async def _relay(self, url: str) -> int:
        async def forward(reader: asyncio.StreamReader, writer: asyncio.StreamWriter, counts: int) -> None:
            with contextlib.suppress(OSError), contextlib.closing(writer):
                while octets := await reader.read(1 << 16):
                    self.requests += counts * octets.count(b" HTTP/1.1\r\n")
                    writer.write(octets)

        async def accept(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            there, back = await asyncio.open_connection(urlsplit(url).hostname, urlsplit(url).port)
            await asyncio.gather(forward(reader, back, 1), forward(there, writer, 0))

        port: int = (await asyncio.start_server(accept, "127.0.0.1", 0)).sockets[0].getsockname()[1]
        return port

    def moves(self) -> bool:
        """Return whether the robot has a velocity or pursues a goal."""
        with urllib.request.urlopen(f"{self._rest}/robot/velocity/", timeout=10) as response:  # noqa: S310 - http
            twist = json.load(response)
        if any(abs(value) > 1e-3 for part in twist.values() for value in part.values()):  # noqa: PLR2004 - m/s, rad/s
            return True
        try:
            urllib.request.urlopen(f"{self._rest}/robot/navigation/action/goal/", timeout=10).close()  # noqa: S310
        except urllib.error.HTTPError as error:
            return error.code != 404  # noqa: PLR2004 - it follows no goal
        return True


class Small:
    """A small device with a motion map, which drives on until it is stopped."""

    moving_class = "motion"

    def __init__(self, device: Mover, statement: Path) -> None:
        self._device, self._before, self.target = device, 0, (str(statement),)

    requests = property(lambda self: self._device.received)

    def moves(self) -> bool:
        """Return whether the device has a velocity."""
        return self._device.velocity != 0


class Ended(NamedTuple):
    """How one run was ended and what was left: whether the robot moved then, and whether the run is incomplete."""

    inside: bool
    moved: bool
    rests: bool
    readable: bool
    interrupted: bool
    requests: int
    seen: int


def run_once(robot: Reference | Small, how: str, options: tuple[str, ...], out: Path, **until: float) -> Ended:
    """Certify the robot, and end the run after so many `requests` or when it was `seen` moving so often."""
    command = [*_CERTIFY, str(out), *robot.target, *options]
    orphan = how == "parent killed"
    streams = {"stderr": subprocess.DEVNULL} if orphan else {"stderr": subprocess.STDOUT}
    command = [sys.executable, "-c", _PARENT, *command] if orphan else command
    before, seen, moving = robot.requests, 0, False
    with subprocess.Popen(command, stdout=subprocess.PIPE, **streams) as process:
        assert process.stdout is not None  # noqa: S101 - tells mypy what PIPE means
        pid = int(process.stdout.readline()) if orphan else process.pid
        while process.poll() is None:
            moving = robot.moves()
            seen += moving
            if robot.requests - before >= max(1, until.get("requests", 1e9)) or seen >= until.get("seen", 1e9):
                break
            time.sleep(SEEN_S if seen or "seen" in until else SEEN_S / 4)
        inside = process.poll() is None
        if inside and how.startswith("SIG"):
            process.send_signal(signal.Signals[how])
        elif inside and how != CLOSED:
            process.kill()
        process.stdout.close()
        while _lives(process, pid):
            time.sleep(0.1)
    rests, result = _comes_to_rest(robot), _result(out)
    interrupted = inside and result.get("interrupted", True)
    return Ended(inside, moving, rests, bool(result), interrupted, robot.requests - before, seen)


def _lives(process: subprocess.Popen[bytes], pid: int) -> bool:
    with contextlib.suppress(ProcessLookupError):
        os.kill(pid, 0)
        return process.poll() is None or pid != process.pid
    return False


def _comes_to_rest(robot: Reference | Small) -> bool:
    """Return whether the robot comes to rest in time, and stays there."""
    until = time.monotonic() + _RESTS_WITHIN_S
    while robot.moves() and time.monotonic() < until:
        time.sleep(SEEN_S)
    until = time.monotonic() + _STAYS_S
    while not (moves := robot.moves()) and time.monotonic() < until:
        time.sleep(SEEN_S)
    return not moves


def _result(out: Path) -> dict[str, Any]:
    """Return the result; {} if there is none that can be read."""
    with contextlib.suppress(ReportError):
        return read_result(out / "result.json")
    return {}


@contextlib.contextmanager
def _robot(name: str, folder: Path) -> Iterator[Reference | Small]:
    if name == "small":
        device, statement = Mover(), folder / "device.toml"
        with small_device(DESCRIPTION, device.routes) as url:
            statement.write_text(f'[api]\nopenapi = "{url}/openapi.json"\n{MAP}', encoding="utf-8")
            yield Small(device, statement)
        return
    command = (sys.executable, "-m", "reference_robot", "--rest-port=0", "--soap-port=0")
    with own_domain(1) as domain, started(*command, f"--domain-id={domain}", stderr=subprocess.DEVNULL) as (_, line):
        yield Reference(*(word.split("=", 1)[1] for word in line.split()[1:3]))


def main() -> int:
    """End the runs; return 0 if the robot rested and a result was readable after all of them."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--robot", choices=("reference", "small"), default="reference")
    options.add_argument("--moments", type=int, default=30)
    options.add_argument("--seed", type=int, default=1)
    chosen = options.parse_args()
    chance, ends = random.Random(chosen.seed), list[Ended]()  # noqa: S311 - no secret
    logging.disable(logging.CRITICAL)
    with tempfile.TemporaryDirectory() as name, _robot(chosen.robot, Path(name)) as robot:
        kinds = {"whole run": (), robot.moving_class: ("--class", robot.moving_class)}
        usual = {kind: run_once(robot, "", more, Path(name, kind)) for kind, more in kinds.items()}
        for kind, run in usual.items():
            print(f"{kind}, not ended: {run.requests} requests, seen moving {run.seen} times, {machine()}", flush=True)
        for number in range(chosen.moments * len(HOWS) // (len(HOWS) - 1)):
            how, turn = HOWS[number % len(HOWS)], number // len(HOWS)
            kind = list(kinds)[turn // 2 % 2]
            what = "seen" if (number + turn) % 2 else "requests"
            most = getattr(usual[kind], what)
            end = Ended(*[False] * 5, 0, 0)
            while not (end.inside if how == CLOSED else end.interrupted):  # a run may be shorter than the one before
                moment = chance.randint(1, most)
                end = run_once(robot, how, kinds[kind], Path(name, f"out{number}"), **{what: moment})
            ends.append(end)
            where = f"{moment} of {most} {'requests' if what == 'requests' else 'times that it was seen moving'}"
            left = f"at rest {end.rests}, readable {end.readable}, moving when hit {end.moved}"
            left += f", interrupted {end.interrupted}" * (how == CLOSED)
            print(f"{number + 1} {how}, {kind}, after {where}: {left}", flush=True)
    names = ("rests", "readable", "moved", "interrupted")
    rests, readable, moved, interrupted = (sum(getattr(end, name) for end in ends) for name in names)
    count = len(ends)
    print(f"interrupted {interrupted} of {count}, moving when hit {moved}")
    print(f"at rest {rests} of {count}, readable {readable} of {count}")
    return int(not (rests == readable == count and interrupted == chosen.moments))


if __name__ == "__main__":
    sys.exit(main())
