"""Commands that tests run to their end."""

import os
import secrets
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import psutil
import warm_commands

# A process inherits the peak memory of the one that starts it, here of pytest. This small one stands between the two.
_WEIGHED = """
import resource, subprocess, sys
code = subprocess.call(sys.argv[2:])
peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss >> (20 if sys.platform == "darwin" else 10)
open(sys.argv[1], "w").write(str(peak))
sys.exit(code)
"""


#: The words of `roaas load` without the front door, which would draw its pages.
LOAD = (sys.executable, "-c", "from loadtests.cli import load; load(prog_name='roaas load')")
_WARM = ((sys.executable, "-m", "roaas"), LOAD)
# Below the ports that systems give to connections: one of these may take a port before a server listens on it.
_PORTS = range(10_000, 32_000)


def free_port() -> int:
    """Return a TCP port that nothing listens on."""
    for _ in _PORTS:
        port = secrets.choice(_PORTS)
        try:
            with socket.create_server(("127.0.0.1", port)):
                return port
        except OSError:
            continue
    raise OSError("no port is free")


def ended(
    *command: object, check: bool = False, peak_mb: Path | None = None, fresh: bool = False, **options: Any
) -> subprocess.CompletedProcess[str]:
    """Run a command to its end; return what it wrote, as text.

    Args:
        command: its words. `python -m roaas` and `LOAD` run in a process that imported their modules before, and so
            does the process that measures.
        check: raise an error if the exit code is not 0.
        peak_mb: the file for its peak memory.
        fresh: start Python anew for them as well, as an environment of its own (`env`) always does.
        options: of `subprocess.run`.
    """
    given = {"capture_output": True, "text": True, "timeout": 240} | options
    anew = fresh or not {"env", "preexec_fn"}.isdisjoint(options) or sys.platform != "linux"
    if command[:3] in _WARM and not anew:
        if command[:3] == LOAD or "load" in command:
            os.environ[warm_commands.MEASURING] = warm_commands.beginning("measuring")[-1]
        command = (*warm_commands.beginning(), *command[1:])
        given |= {"env": os.environ | {warm_commands.PEAK: str(peak_mb)}} if peak_mb else {}
    elif peak_mb:
        command = (sys.executable, "-I", "-S", "-c", _WEIGHED, peak_mb, *command)
    return subprocess.run([str(word) for word in command], check=check, **given)


class Begun(subprocess.Popen[str]):
    """A command of roaas in a process that imported its modules before: `command_pid`, which gets all signals."""

    def __init__(self, *words: object, **options: Any) -> None:
        command = [*warm_commands.beginning(), "-m", "roaas", *map(str, words)]
        reading, writing = os.pipe()
        is_warm = sys.platform == "linux"
        environment = os.environ | ({warm_commands.PID: str(writing)} if is_warm else {})
        super().__init__(command, text=True, env=environment, pass_fds=[writing] if is_warm else [], **options)
        os.close(writing)
        with os.fdopen(reading) as pipe:
            self.command_pid = int(pipe.readline() or self.pid)

    def send_signal(self, sig: int) -> None:
        if self.poll() is None:
            os.kill(self.command_pid, sig)


@contextmanager
def independent_robot(name: str) -> Iterator[tuple[subprocess.Popen[str], str, str]]:
    """Start an independent robot of the pack table1; yield its process, its REST address and its publishers' WSDL."""
    command = [sys.executable, "-m", "proof.table1.independent_robots", name]
    command += ["--rest-port=0", "--soap-port=0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            words = process.stdout.readline().split()
            assert words[0] == "ready"
            yield process, *(word.split("=", 1)[1] for word in words[1:3])
        finally:
            process.kill()


def shown_of(command: list[str]) -> tuple[str, dict[int, str]]:
    """Run a command; return what it said, and what a list of processes shows of it and of those below it."""
    seen = dict[int, str]()
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as process:
        while process.poll() is None:
            for child in [psutil.Process(process.pid), *psutil.Process(process.pid).children(recursive=True)]:
                try:
                    seen[child.pid] = f"{child.cmdline()} {child.environ()}"
                except psutil.Error:
                    continue
            try:
                process.wait(0.1)
            except subprocess.TimeoutExpired:
                continue
        said = process.stdout.read()
    return said, seen
