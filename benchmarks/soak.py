"""Whether the reference robot lasts: good clients beside hostile ones, while the robot behind it dies and comes back.

``python benchmarks/soak.py`` runs for ten minutes (``--minutes``). The simulation, which is the robot and its action
servers, is killed and restarted every minute. The exit code is 1 unless

- good clients always get a response, and no 5xx but 503 (or the SOAP fault that says the same);
- hostile clients get only the expected statuses, and the robot's log has no traceback;
- memory stays within 5 % of its size after the first tenth, descriptors and threads where they were.
"""

import argparse
import contextlib
import http.client
import json
import os
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from programs import HERE, Footprint, report, running_robot, started
from robot import DELIVERY, ENVELOPE

RATE = 100.0  # good requests a second
MOST_GROWTH = 0.05
DEADLINE = 10.0  # seconds for an answer
BACK = 20.0  # seconds for the robot to be served again, and for what is left to go
SETTLED = 75.0  # seconds after which idle connections are gone
GET_POSE = (
    '<s:Envelope xmlns:s="http://schemas.xmlsoap.org/soap/envelope/"><s:Body>'
    '<t:GetPose xmlns:t="http://soap.turtlebot.mybot.org/"/></s:Body></s:Envelope>'
)
ASKED = (  # (operation, SOAP or REST, method, target, content); deliveries seldom, for the robot has to drive for each
    *(("pose", False, "GET", "/robot/pose/", ""),) * 6,
    *(("pose by SOAP", True, "POST", "/turtlesim_subscriber_ws", GET_POSE),) * 6,
    *(("sensors", False, "GET", "/robot/sensors/", ""),) * 3,
    *(("deliveries", False, "GET", "/robot/app/delivery/", ""),) * 3,
    ("delivery", False, "PUT", DELIVERY, ""),
    ("delivery by SOAP", True, "POST", "/turtlesim_publisher_ws", ENVELOPE),
)


@dataclass
class Good:
    """The responses that good clients got: statuses, and what was wrong in them."""

    statuses: Counter[str] = field(default_factory=Counter)
    wrong: Counter[str] = field(default_factory=Counter)


class Client:
    """A good client of one port, which reconnects when its connection is closed."""

    def __init__(self, port: int) -> None:
        self._connection = http.client.HTTPConnection("127.0.0.1", port, timeout=DEADLINE)

    def ask(self, method: str, target: str, body: str = "") -> tuple[int, bytes]:
        """Send a request; return status and body."""
        self._connection.request(method, target, body or None, {"Content-Type": "text/xml"} if body else {})
        answer = self._connection.getresponse()
        return answer.status, answer.read()

    def close(self) -> None:
        """Close the connection."""
        self._connection.close()


class Soak:
    """One run: a robot, its clients, and their results."""

    def __init__(self, domain_id: int, seconds: float, log: Path) -> None:
        self.seconds, self.log, self._domain = seconds, log, f"--domain-id={domain_id}"
        self.good = Good()
        self.warm, self.left = Footprint(0, 0, 0, 0), Footprint(0, 0, 0, 0)
        self.hostile: dict[str, dict[str, int]] = {}
        self.restarts = 0

    def run(self) -> None:
        """Run all clients for the given time, and record the resources that the robot still uses afterwards."""
        with contextlib.ExitStack() as stack:
            simulation = stack.enter_context(self._simulation())
            log = stack.enter_context(self.log.open("w", encoding="utf-8"))
            robot = stack.enter_context(running_robot("--attach", self._domain, stderr=log))
            pid, rest, soap = robot.pids[0], robot.rest.port, robot.soap.port
            self._await_pose(rest)
            clients = {False: Client(rest), True: Client(soap)}
            before = Footprint.of(pid)
            command = (sys.executable, HERE / "hostile.py", rest, soap)
            hostile, _ = stack.enter_context(started(*command, stdin=subprocess.PIPE))
            began = time.monotonic()
            tenth = self.seconds / 10
            next_kill, asked = 2 * tenth, 0
            while (now := time.monotonic() - began) < self.seconds:
                if not self.warm.threads and now > tenth:
                    self.warm = Footprint.of(pid)
                if now > next_kill and now < self.seconds - 2 * tenth:
                    next_kill = now + max(tenth, 60.0)
                    self._restart(simulation)
                self._ask(clients, asked)
                asked += 1
                if asked % (10 * RATE) == 0:
                    print(f"{now:5.0f} s: {dict(self.good.statuses)}, {Footprint.of(pid)}", flush=True)
                time.sleep(max(0.0, began + asked / RATE - time.monotonic()))
            assert hostile.stdin is not None  # noqa: S101 - tells mypy what PIPE means
            hostile.stdin.close()
            assert hostile.stdout is not None  # noqa: S101 - as above
            self.hostile = json.loads(hostile.stdout.read())
            for client in clients.values():
                client.close()
            self.left = self._settled(pid, before)
            self.warm.descriptors, self.warm.threads = before.descriptors, before.threads

    def _ask(self, clients: dict[bool, Client], number: int) -> None:
        name, is_soap, method, target, body = ASKED[number * 7 % len(ASKED)]
        client = clients[is_soap]
        try:
            status, content = client.ask(method, target, body)
        except (OSError, http.client.HTTPException) as error:
            self.good.wrong[f"{name}: {type(error).__name__}: {error}"] += 1
            client.close()
            return
        refused = status == 503 or (status == 500 and is_soap and b"its log says why" not in content)  # noqa: PLR2004
        self.good.statuses[f"{status}"] += 1
        if status >= 400 and not refused:  # noqa: PLR2004 - RFC 9110 15.5
            self.good.wrong[f"{name}: {status} {content[:200]!r}"] += 1

    def _restart(self, simulation: list[subprocess.Popen[str]]) -> None:
        simulation[0].kill()
        simulation[0].wait()
        simulation[0] = self._start_simulation()
        self.restarts += 1

    @contextlib.contextmanager
    def _simulation(self) -> Iterator[list[subprocess.Popen[str]]]:
        """Run the simulation; yield a list with the process that is running, which changes with each restart."""
        running = [self._start_simulation()]
        try:
            yield running
        finally:
            running[0].terminate()
            running[0].wait(BACK)

    def _start_simulation(self) -> subprocess.Popen[str]:
        command = [sys.executable, "-m", "reference_robot.simulation", self._domain, "--time-scale=5"]
        return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, text=True)

    def _await_pose(self, port: int) -> None:
        give_up = time.monotonic() + BACK
        client = Client(port)
        while client.ask("GET", "/robot/pose/")[0] != http.client.OK:
            if time.monotonic() > give_up:
                raise SystemExit(f"no pose within {BACK:g} s; the robot's log is {self.log}")
            time.sleep(0.1)
        client.close()

    def _settled(self, pid: int, before: Footprint) -> Footprint:
        """Return the robot's footprint after its idle connections have been closed."""
        print("waiting until idle connections are closed", flush=True)
        give_up = time.monotonic() + SETTLED
        while True:
            left = Footprint.of(pid)
            if (left.descriptors, left.threads) == (before.descriptors, before.threads) or time.monotonic() > give_up:
                return left
            time.sleep(1.0)


def judged(soak: Soak) -> list[bool]:
    """Print the results, line by line; returns which are met."""
    good, warm, left = soak.good, soak.warm, soak.left
    log = soak.log.read_text(encoding="utf-8")
    grown = left.megabytes / warm.megabytes - 1
    return [
        report(
            f"good clients: {dict(good.statuses)} over {soak.restarts} restarts, wrong {dict(good.wrong)}",
            met=not good.wrong and soak.restarts > 0,
        ),
        report(
            f"hostile clients: {soak.hostile['done']}, wrong {soak.hostile['failed']}", met=not soak.hostile["failed"]
        ),
        report(f"log: {log.count('Traceback')} tracebacks in {len(log)} characters", met="Traceback" not in log),
        report(
            f"memory: {warm.megabytes:.0f} MB, then {left.megabytes:.0f} MB: {grown:+.1%} (at most {MOST_GROWTH:.0%})",
            met=grown <= MOST_GROWTH,
        ),
        report(f"descriptors: {warm.descriptors}, then {left.descriptors}", met=left.descriptors <= warm.descriptors),
        report(f"threads: {warm.threads}, then {left.threads}", met=left.threads <= warm.threads),
    ]


def main() -> int:
    """Run; returns 0 when every result is met."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--minutes", type=float, default=10.0)
    options.add_argument("--domain-id", type=int, default=int(os.environ.get("ROS_DOMAIN_ID", "0")))
    chosen = options.parse_args()
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    with tempfile.TemporaryDirectory() as folder:
        soak = Soak(chosen.domain_id, chosen.minutes * 60, Path(folder, "robot.log"))
        soak.run()
        passed = all(judged(soak))
        if not passed:
            print(soak.log.read_text(encoding="utf-8")[-3000:])
    print("the robot lasts" if passed else "the robot does not last")
    return 0 if passed else 1


if __name__ == "__main__":
    sys.exit(main())
