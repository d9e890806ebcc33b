"""How fast the reference robot responds, as ratios to a bare application, and what it uses.

``python benchmarks/robot.py`` starts the robot with its simulation, a bare uvicorn application that returns the same
bytes. It loads them alternately from another process, so that the machine's speed and other load cancel out. The exit
code is 1 if a target is missed. ``--seconds`` sets the length of each measurement.
"""

import argparse
import os
import statistics
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from itertools import pairwise

from loader import Call, Load, alternately, load
from programs import Footprint, Robot, answers_to, report, running_bare, running_robot

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
RATE = 200.0  # a second
# On one connection, server and loader take turns; whether they share a processor decides the time more than what they
# do, and the scheduler changes its mind. So both servers' event loops run on one and the loader on another.
SERVER_CPUS, LOADER_CPUS = ({0}, {1}) if {0, 1} <= os.sched_getaffinity(0) else (None, None)
MANY_CONNECTIONS = 32
# Requests a second on 32 connections
LEAST_RATES = {"GET pose": 30_000, "PUT delivery": 20_000, "SOAP ExecuteDeliveryRequest": 8_000}
REQUESTS_FOR_GROWTH = 200_000
MORE_TIMES = 3
MOST_GROWTH = 0.01  # by as many again
MOST_IDLE_CORE = 0.05
MOST_MEGABYTES = 250


def main() -> int:
    """Measure everything; return 0 when all targets are met."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--seconds", type=float, default=2.0, help="length of each measurement")
    options.add_argument("--domain-id", default=os.environ.get("ROS_DOMAIN_ID", "0"))
    options.add_argument(
        "--beside",
        type=beside,
        action="append",
        default=[],
        metavar="NAME=REST,SOAP",
        help="measure another server on loopback too, by its ports, such as Jersey and JAX-WS (docs/design.md)",
    )
    chosen = options.parse_args()
    met = []
    with ExitStack() as stack:
        robot = stack.enter_context(running_robot(f"--domain-id={chosen.domain_id}"))
        met += idle(robot)
        before = megabytes(robot)
        asked = {
            "GET pose": (replace(robot.rest, method="GET", target="/robot/pose/"), 1.1),
            "PUT delivery": (replace(robot.rest, method="PUT", target=DELIVERY), 1.1),
            "SOAP ExecuteDeliveryRequest": (
                replace(robot.soap, method="POST", body=ENVELOPE, content_type="text/xml"),
                1.4,
            ),
        }
        answers = answers_to([call for call, _ in asked.values()])
        bare, server = stack.enter_context(running_bare(answers))
        servers = [("bare", bare, bare), *chosen.beside]

        def yardsticks(call: Call) -> dict[str, Call]:
            return {name: replace(call, port=soap if call.body else rest) for name, rest, soap in servers}

        with pinned(robot.pids[0]), pinned(server.pid):
            for name, (call, most) in asked.items():
                met.append(back_to_back(name, call, yardsticks(call), most, chosen.seconds))
            for name, (call, _) in asked.items():
                met.append(now_and_then(name, call, yardsticks(call), 5 * chosen.seconds))
        for name, (call, _) in asked.items():
            met.append(many_connections(name, call, yardsticks(call), LEAST_RATES[name], chosen.seconds))
        met.append(growth(robot, before))
    print("all targets met" if all(met) else "targets missed")
    return 0 if all(met) else 1


def beside(text: str) -> tuple[str, int, int]:
    """Read ``NAME=REST,SOAP``."""
    name, _, ports = text.partition("=")
    rest, _, soap = ports.partition(",")
    return name, int(rest), int(soap)


def back_to_back(name: str, call: Call, yardsticks: dict[str, Call], most: float, seconds: float) -> bool:
    """Measure robot and baselines in turn, as fast as each can; print the ratios' medians over the rounds.

    wrk counts a stall as all the requests that were not sent because of it, so its p99 shows the machine, not the
    robot.
    """
    calls = {"robot": call} | yardsticks
    for each in calls.values():
        load(each, 1, 1)
    rounds = [{who: load(each, 1, seconds, LOADER_CPUS) for who, each in calls.items()} for _ in range(ROUNDS)]
    found = statistics.median(turn["robot"].median_us / turn["bare"].median_us for turn in rounds)
    tail = statistics.median(turn["robot"].p99_us / turn["bare"].p99_us for turn in rounds)
    errors = sum(turn["robot"].errors for turn in rounds)
    return report(
        f"{name}, back to back: p50/p99 {told(rounds)} us, {found:.2f} times bare's p50 (at most {most}), {tail:.2f} "
        f"times its p99, {errors} errors",
        met=found <= most and not errors,
    )


def now_and_then(name: str, call: Call, yardsticks: dict[str, Call], seconds: float) -> bool:
    """Measure robot and yardsticks request by request, at a rate that leaves the machine idle, while a mission runs."""
    calls = {"robot": call} | yardsticks
    seen = dict(zip(calls, alternately(list(calls.values()), RATE, seconds), strict=True))
    middle, tail = (getattr(seen["robot"], of) / getattr(seen["bare"], of) for of in ("median_us", "p99_us"))
    return report(
        f"{name}, {RATE:g} a second while a mission runs: p50/p99 {told([seen])} us, {middle:.2f} times bare's p50, "
        f"{tail:.2f} times its p99 (at most {MOST_TAIL}), {seen['robot'].errors} errors",
        met=tail <= MOST_TAIL and not seen["robot"].errors,
    )


def told(rounds: list[dict[str, Load]]) -> str:
    """Return the medians of the rounds' p50 and p99, for each server."""
    return ", ".join(
        f"{who} {statistics.median(turn[who].median_us for turn in rounds):.0f}/"
        f"{statistics.median(turn[who].p99_us for turn in rounds):.0f}"
        for who in rounds[0]
    )


def many_connections(name: str, call: Call, yardsticks: dict[str, Call], least: int, seconds: float) -> bool:
    """Measure the rate of requests on many connections, and that of other servers."""
    measured = load(call, MANY_CONNECTIONS, seconds)
    rates = {who: load(each, MANY_CONNECTIONS, seconds).rate for who, each in yardsticks.items()}
    text = ", ".join(f"{who} {rate:,.0f}" for who, rate in {"robot": measured.rate, **rates}.items())
    return report(
        f"{name}, {MANY_CONNECTIONS} connections: {text} a second (robot at least {least:,}), {measured.errors} errors",
        met=measured.rate >= least and not measured.errors,
    )


def idle(robot: Robot) -> list[bool]:
    """Measure memory and processor time of simulation and web services together, while no client sends requests."""
    used, started = cpu_seconds(robot), time.monotonic()
    time.sleep(5)
    core = (cpu_seconds(robot) - used) / (time.monotonic() - started)
    memory = megabytes(robot)
    return [
        report(f"idle: {core:.1%} of a core (less than {MOST_IDLE_CORE:.0%})", met=core < MOST_IDLE_CORE),
        report(f"idle: {memory:.0f} MB (less than {MOST_MEGABYTES})", met=memory < MOST_MEGABYTES),
    ]


def growth(robot: Robot, idle_megabytes: float) -> bool:
    """Measure how much memory the robot gains by 200,000 requests, and how much by as many more, three times.

    The first 200,000 fill bounded buffers: DDS's histories and the reports on missions. Memory that each further
    200,000 add would be a leak; memory that only some of them add is a history that had not been full.
    """
    filled, *later = [after_requests(robot) for _ in range(1 + MORE_TIMES)]
    grown = [now / before - 1 for before, now in pairwise([filled, *later])]
    return report(
        f"memory: idle {idle_megabytes:.1f} MB, after {REQUESTS_FOR_GROWTH:,} requests {filled:.1f} "
        f"({filled / idle_megabytes - 1:+.1%}), after as many again {', '.join(f'{more:+.1%}' for more in grown)} "
        f"(median at most {MOST_GROWTH:.0%})",
        met=statistics.median(grown) <= MOST_GROWTH,
    )


def after_requests(robot: Robot) -> float:
    """Return the robot's memory after 200,000 more requests."""
    left = REQUESTS_FOR_GROWTH
    while left > 0:
        left -= load(replace(robot.rest, method="PUT", target=DELIVERY), MANY_CONNECTIONS, 3).requests
    return megabytes(robot)


@contextmanager
def pinned(pid: int) -> Iterator[None]:
    """Pin a process's main thread, which runs its event loop, to the processor of the servers."""
    before = os.sched_getaffinity(pid)
    os.sched_setaffinity(pid, SERVER_CPUS or before)
    try:
        yield
    finally:
        os.sched_setaffinity(pid, before)


def cpu_seconds(robot: Robot) -> float:
    """Return the processor time that the robot's processes have used."""
    return sum(Footprint.of(pid).processor for pid in robot.pids)


def megabytes(robot: Robot) -> float:
    """Return the robot's resident memory."""
    return sum(Footprint.of(pid).megabytes for pid in robot.pids)


if __name__ == "__main__":
    sys.exit(main())
