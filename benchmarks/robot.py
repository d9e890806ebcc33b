"""How fast the reference robot answers, as ratios to a bare application, and what it uses.

``python benchmarks/robot.py`` starts the robot with its simulation, and a bare uvicorn application that answers the
same bytes, and measures both in turn with the load from another process: so the machine's speed and other load cancel.
It ends with exit code 1 if a target is missed. ``--seconds`` sets the length of each of the measurements.
"""

import argparse
import http.client
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from urllib.parse import urlsplit

from loader import Call, load

DELIVERY = (
    "/robot/app/delivery/4/depot_x/68.269/depot_y/38.718/dest_x/60.633/dest_y/37.51/source_x/76.02/source_y/41.35"
)
ENVELOPE = (
    '<soap:Envelope xmlns:soap="http://schemas.xmlsoap.org/soap/envelope/"><soap:Body>'
    '<tns:ExecuteDeliveryRequest xmlns:tns="http://soap.turtlebot.mybot.org/"><arg0>'
    "<depot_x>68.269</depot_x><depot_y>38.718</depot_y><destination_x>60.633</destination_x>"
    "<destination_y>37.51</destination_y><message_code>4</message_code><source_x>76.02</source_x>"
    "<source_y>41.35</source_y></arg0></tns:ExecuteDeliveryRequest></soap:Body></soap:Envelope>"
)
ROUNDS = 5
MOST_TAIL = 2.5  # of the bare application's p99
# On one connection, server and loader take turns; whether they share a processor decides the time more than what they
# do, and the scheduler changes its mind. So both servers' event loops run on one and the loader on another.
SERVER_CPUS, LOADER_CPUS = ({0}, {1}) if {0, 1} <= os.sched_getaffinity(0) else (None, None)
MANY_CONNECTIONS = 32
LEAST_RATE = 20_000  # PUT deliveries a second on 32 connections
REQUESTS_FOR_GROWTH = 200_000
MOST_GROWTH = 0.05
MOST_IDLE_CORE = 0.05
MOST_MEGABYTES = 250


@dataclass(frozen=True)
class Robot:
    """The running robot: its REST and SOAP addresses, and its processes."""

    rest: Call
    soap: Call
    pids: tuple[int, ...]


def main() -> int:
    """Measure everything; return 0 when all targets are met."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--seconds", type=float, default=2.0, help="length of each measurement")
    options.add_argument("--domain-id", default=os.environ.get("ROS_DOMAIN_ID", "0"))
    chosen = options.parse_args()
    met = []
    with ExitStack() as stack:
        robot = stack.enter_context(running_robot(chosen.domain_id))
        met += idle(robot)
        before = megabytes(robot)
        calls = {
            "GET pose": (replace(robot.rest, method="GET", target="/robot/pose/"), 1.1),
            "PUT delivery": (replace(robot.rest, method="PUT", target=DELIVERY), 1.1),
            "SOAP ExecuteDeliveryRequest": (
                replace(robot.soap, method="POST", body=ENVELOPE, content_type="text/xml"),
                1.4,
            ),
        }
        port = stack.enter_context(running_bare([call for call, _ in calls.values()]))
        with pinned(robot.pids[0]):
            for name, (call, most) in calls.items():
                met.append(ratio(name, call, replace(call, port=port), most, chosen.seconds))
        met += many_connections(robot, chosen.seconds)
        met.append(growth(robot, before))
    print("all targets met" if all(met) else "targets missed")
    return 0 if all(met) else 1


def ratio(name: str, call: Call, bare: Call, most: float, seconds: float) -> bool:
    """Measure robot and bare application in turn; the ratios, of median and p99, are the median of the rounds'."""
    load(call, 1, 1)
    load(bare, 1, 1)
    rounds = [(load(call, 1, seconds, LOADER_CPUS), load(bare, 1, seconds, LOADER_CPUS)) for _ in range(ROUNDS)]
    found, tail = (
        statistics.median(getattr(robot, what) / getattr(yardstick, what) for robot, yardstick in rounds)
        for what in ("median_us", "p99_us")
    )
    errors = sum(robot.errors for robot, _ in rounds)
    told = [
        "/".join(
            f"{statistics.median(values):.0f}" for values in zip(*((s.median_us, s.p99_us) for s in side), strict=True)
        )
        for side in zip(*rounds, strict=True)
    ]
    return report(
        f"{name}: p50/p99 {told[0]} us, bare {told[1]} us, ratios {found:.2f} (at most {most}) and {tail:.2f} (at most "
        f"{MOST_TAIL}), {errors} errors",
        met=found <= most and tail <= MOST_TAIL and not errors,
    )


def many_connections(robot: Robot, seconds: float) -> list[bool]:
    """Measure the rate of PUT deliveries on many connections."""
    measured = load(replace(robot.rest, method="PUT", target=DELIVERY), MANY_CONNECTIONS, seconds)
    text = f"{MANY_CONNECTIONS} connections: {measured.rate:,.0f} PUT deliveries a second, {measured.errors} errors"
    return [report(f"{text} (at least {LEAST_RATE:,})", met=measured.rate >= LEAST_RATE and not measured.errors)]


def idle(robot: Robot) -> list[bool]:
    """Measure what the robot uses while nobody calls it, simulation and web services together."""
    used, started = cpu_seconds(robot), time.monotonic()
    time.sleep(5)
    core = (cpu_seconds(robot) - used) / (time.monotonic() - started)
    memory = megabytes(robot)
    return [
        report(f"idle: {core:.1%} of a core (less than {MOST_IDLE_CORE:.0%})", met=core < MOST_IDLE_CORE),
        report(f"idle: {memory:.0f} MB (less than {MOST_MEGABYTES})", met=memory < MOST_MEGABYTES),
    ]


def growth(robot: Robot, before: float) -> bool:
    """Measure how much memory the robot has gained since it idled, after 200,000 more requests."""
    left = REQUESTS_FOR_GROWTH
    while left > 0:
        left -= load(replace(robot.rest, method="PUT", target=DELIVERY), MANY_CONNECTIONS, 3).requests
    grown = megabytes(robot) / before - 1
    return report(
        f"memory after {REQUESTS_FOR_GROWTH:,} requests: {grown:+.1%} (less than {MOST_GROWTH:.0%})",
        met=grown < MOST_GROWTH,
    )


def report(text: str, *, met: bool) -> bool:
    """Print one line of the result."""
    print(f"{'ok    ' if met else 'MISSED'} {text}", flush=True)
    return met


@contextmanager
def running_robot(domain_id: str) -> Iterator[Robot]:
    """Run the robot on free ports."""
    command = [sys.executable, "-m", "reference_robot", "--rest-port=0", "--soap-port=0", f"--domain-id={domain_id}"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            words = dict(word.split("=", 1) for word in process.stdout.readline().split()[1:])
            rest, soap = urlsplit(words["rest"]), urlsplit(words["soap"])
            children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
            yield Robot(
                Call(rest.hostname, rest.port, "GET", "/"),
                Call(soap.hostname, soap.port, "POST", soap.path),
                (process.pid, *map(int, children)),
            )
        finally:
            process.terminate()


@contextmanager
def running_bare(calls: list[Call]) -> Iterator[int]:
    """Run the bare application with the robot's answers to some calls; yields its port."""
    answers = {}
    for call in calls:
        connection = http.client.HTTPConnection(call.host, call.port)
        connection.request(call.method, call.target, call.body or None, {"Content-Type": call.content_type})
        answer = connection.getresponse()
        # uvicorn adds Date by itself, in both.
        headers = [pair for pair in answer.getheaders() if pair[0].lower() != "date"]
        answers[call.target] = {"status": answer.status, "headers": headers, "body": answer.read().decode()}
        connection.close()
    with tempfile.NamedTemporaryFile("w", suffix=".json") as file:
        file.write(json.dumps(answers))
        file.flush()
        command = [sys.executable, str(Path(__file__).with_name("bare.py")), file.name]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
            try:
                port = int(process.stdout.readline())
                with pinned(process.pid):
                    yield port
            finally:
                process.terminate()


@contextmanager
def pinned(pid: int) -> Iterator[None]:
    """Keep a process's main thread, which is its event loop's, on the servers' processor."""
    before = os.sched_getaffinity(pid)
    os.sched_setaffinity(pid, SERVER_CPUS or before)
    try:
        yield
    finally:
        os.sched_setaffinity(pid, before)


def cpu_seconds(robot: Robot) -> float:
    """Return the processor time that the robot's processes have used."""
    ticks = 0
    for pid in robot.pids:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        ticks += int(fields[11]) + int(fields[12])
    return ticks / os.sysconf("SC_CLK_TCK")


def megabytes(robot: Robot) -> float:
    """Return the robot's resident memory; what its processes share is counted once in each (RSS)."""
    pages = sum(int(Path(f"/proc/{pid}/statm").read_text().split()[1]) for pid in robot.pids)
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


if __name__ == "__main__":
    sys.exit(main())
