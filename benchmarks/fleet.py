"""How long a fleet of 20 robots takes beside its slowest member, and whether each has the right outcome.

``python benchmarks/fleet.py --parallel 4`` starts 4 reference robots, each on its own ROS domain, 8 independent ones, 6
faulty ones (mutants before independent robots), one that accepts connections and never responds, and one that is down.
``roaas certify --fleet`` judges them. The benchmark prints each robot's time, the total, the slowest, the sum divided
by the number at once (no schedule is faster than either), and the processor time of the runs. The exit code is 1 where
a good robot does not pass, a faulty one does, or one without a response is neither unreachable nor given up. Robots
whose language (Node, Go) is not installed are left out and named.
"""

import argparse
import contextlib
import json
import os
import resource
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

from conformance.contract.pack import Contract
from conformance.mutation.programs import NotInstalledError
from conformance.packs.table1.mutants import MUTANTS
from conformance.packs.table1.selftest import BAROQUE, LEGACY, ON_SERVERS, PLAIN, REFERENCE
from conformance.selftest.proxy import Proxy
from conformance.selftest.robots import Robot, running

REFERENCES = 4
FAULTS = (
    "http-406-as-400", "http-405-without-allow", "bp-fault-200", "soap-response-namespace", "delivery-text-is-zero",
    "pose-without-child-frame",
)  # fmt: skip
FIRST_DOMAIN = 20
TARGET = 1.2  # of the slowest member, or of what so many members take with so many at once, whichever is longer
HANGING_LIMIT_S = 60
_GOOD, _FAULTY, _ABSENT = ({"conformant"}, {"not-conformant"}, {"unreachable", "given-up"})


@dataclass(frozen=True)
class Entry:
    """A robot of the fleet: its table in the file, and its right outcomes."""

    table: str
    right: set[str]


def main() -> int:
    """Judge the fleet; return 0 when each robot has a right end."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--parallel", type=int, default=4)
    options.add_argument("--effort", choices=("quick", "standard"), default="quick")
    options.add_argument("--out", type=Path, help="keeps the results there")
    given = options.parse_args()
    with ExitStack() as stack:
        out = given.out or Path(stack.enter_context(tempfile.TemporaryDirectory()))
        out.mkdir(parents=True, exist_ok=True)
        fleet = dict(_fleet(stack, out))
        (out / "fleet.toml").write_text("\n".join(entry.table for entry in fleet.values()), encoding="utf-8")
        print(f"{len(fleet)} robots run; load {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors", flush=True)
        command = [sys.executable, "-m", "roaas", "certify", "--fleet", str(out / "fleet.toml"), "--allow-motion"]
        command += ["--effort", given.effort, "--parallel", str(given.parallel), "--out", str(out)]
        before, started = _child_cpu_s(), time.monotonic()
        subprocess.run(command, check=False)
        wall_s, cpu_s = time.monotonic() - started, _child_cpu_s() - before
        robots = json.loads((out / "fleet.json").read_text(encoding="utf-8"))["robots"]
    return _tell(robots, {name: entry.right for name, entry in fleet.items()}, given.parallel, wall_s, cpu_s)


def _tell(
    robots: list[dict[str, object]], right: dict[str, set[str]], parallel: int, wall_s: float, cpu_s: float
) -> int:
    seconds = {str(robot["name"]): float(str(robot["seconds"])) for robot in robots}
    wrong = [robot for robot in robots if robot["outcome"] not in right[str(robot["name"])]]
    for robot in robots:
        mark = "WRONG" if robot in wrong else "right"
        print(f"{seconds[str(robot['name'])]:7.1f} s  {robot['name']:28} {robot['outcome']:16} {mark}")
    slowest = max(seconds, key=seconds.__getitem__)
    in_all, floor_s = sum(seconds.values()), cpu_s / (os.cpu_count() or 1)
    bound_s = max(seconds[slowest], in_all / parallel)
    print(f"whole fleet {wall_s:.1f} s; slowest member {seconds[slowest]:.1f} s ({slowest}): ratio", end=" ")
    print(f"{wall_s / seconds[slowest]:.2f}; one after the other {in_all:.1f} s")
    print(f"with {parallel} at once no less than {bound_s:.1f} s: ratio {wall_s / bound_s:.2f} (target {TARGET})")
    print(f"processor time of the runs {cpu_s:.1f} s: no less than {floor_s:.1f} s on {os.cpu_count()} processors")
    print(f"{len(robots) - len(wrong)} of {len(robots)} ends are right; load {os.getloadavg()[0]:.1f} in the end")
    return bool(wrong)


def _fleet(stack: ExitStack, folder: Path) -> Iterator[tuple[str, Entry]]:
    """Start the robots; yields each with its name."""
    for number in range(REFERENCES):
        robot = stack.enter_context(running(Contract.load(), REFERENCE, FIRST_DOMAIN + number))
        yield _entry(folder, f"reference-{number + 1}", robot, _GOOD)
    for device in (PLAIN, BAROQUE, LEGACY, *ON_SERVERS):
        try:
            robot = stack.enter_context(running(Contract.load(), device))
        except NotInstalledError as error:
            print(f"{device.name} is left out: {error}")
            continue
        yield _entry(folder, device.name, robot, _GOOD)
    for mutant in (one for one in MUTANTS if one.name in FAULTS):
        robot = stack.enter_context(running(Contract.load(), BAROQUE))
        proxy = Proxy(robot.rest, robot.publishers)
        stack.callback(proxy.close)
        proxy.change = mutant.make()
        yield _entry(folder, f"faulty-{mutant.name}", proxy.before(robot), _FAULTY)
    hanging = stack.enter_context(_never_answering())
    limit = f"time_limit_s = {HANGING_LIMIT_S}\n"
    yield "hanging", Entry(f'[[robot]]\nname = "hanging"\n{limit}endpoints = {{ rest = "{hanging}" }}\n', _ABSENT)
    with socket.create_server(("127.0.0.1", 0)) as closed:
        down = f"http://127.0.0.1:{closed.getsockname()[1]}"
    yield "down", Entry(f'[[robot]]\nname = "down"\nendpoints = {{ rest = "{down}" }}\n', _ABSENT)


def _entry(folder: Path, name: str, robot: Robot, right: set[str]) -> tuple[str, Entry]:
    """Return a robot with a statement of its own: its kind's, with its addresses."""
    endpoints = f'\n[endpoints]\nrest = "{robot.rest}"\n'
    wsdls = {"publishers_wsdl": robot.publishers, "subscribers_wsdl": robot.subscribers}
    endpoints += "".join(f'{key} = "{url}"\n' for key, url in wsdls.items() if url)
    statement = folder / f"{name}.toml"
    declared = robot.device.statement.read_text(encoding="utf-8") if robot.device.statement else ""
    statement.write_text(declared + endpoints, encoding="utf-8")
    return name, Entry(f'[[robot]]\nstatement = "{statement.name}"\n', right)


@contextmanager
def _never_answering() -> Iterator[str]:
    """Run a server that accepts connections and never responds; yields its URL."""
    server = socket.create_server(("127.0.0.1", 0))
    taken: list[socket.socket] = []

    def take() -> None:
        with contextlib.suppress(OSError):
            while True:
                taken.append(server.accept()[0])

    threading.Thread(target=take, daemon=True).start()
    try:
        yield f"http://127.0.0.1:{server.getsockname()[1]}"
    finally:
        server.close()
        for connection in taken:
            connection.close()


def _child_cpu_s() -> float:
    """Return the processor time of child processes that have ended, and of their children."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


if __name__ == "__main__":
    sys.exit(main())
