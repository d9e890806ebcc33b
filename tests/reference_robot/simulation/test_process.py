"""The simulation as a process: its one line, its ends, and a flood of requests."""

import os
import signal
import statistics
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import pytest
from observer import Observer, pose, until
from processes import ended

from reference_robot.names import RosNames
from reference_robot.ros import RosRuntime

PATIENCE = 60.0  # seconds in which even a busy machine ends a process
FLOOD = 2.0  # seconds
BLOCKED = 0.1  # seconds that Fast DDS holds a publisher whose reader is slower
COMMAND = [sys.executable, "-m", "reference_robot.simulation"]


@contextmanager
def simulation(domain_id):
    pipes = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.PIPE)
    process = subprocess.Popen([*COMMAND, "--domain-id", str(domain_id)], **pipes, text=True)
    try:
        assert process.stdout.readline() == "ready\n"
        yield process
    finally:
        if process.poll() is None:
            process.kill()
        process.communicate()


@pytest.mark.parametrize("end", [signal.SIGTERM, signal.SIGINT, "stdin"])
def test_it_ends_cleanly(domain_id, end):
    with simulation(domain_id) as process:
        if end == "stdin":
            process.stdin.close()
            process.stdin = None  # or communicate() would flush it
        else:
            process.send_signal(end)
        assert process.wait(PATIENCE) == 0
        assert process.stdout.read() == ""
        complaints = process.stderr.read()
        assert "Traceback" not in complaints
        assert "terminate called" not in complaints


def test_it_lets_the_web_services_go_first(domain_id):
    with simulation(domain_id) as process:
        threads = [int(task.name) for task in Path(f"/proc/{process.pid}/task").iterdir()]
        # All that ROS has made are made after it gave way; the libraries that are imported may have some of their own.
        assert [os.sched_getscheduler(thread) for thread in threads].count(os.SCHED_BATCH) > len(threads) / 2
        assert os.sched_getscheduler(process.pid) == os.SCHED_BATCH
        assert os.getpriority(os.PRIO_PROCESS, process.pid) > os.getpriority(os.PRIO_PROCESS, 0)


@pytest.mark.parametrize(
    ("arguments", "named"),
    [(["--names", "missing.toml"], "missing.toml"), (["--domain-id", "102"], "102"), (["--time-scale", "0"], "0")],
)
def test_what_it_cannot_use_it_names(arguments, named):
    done = ended(*COMMAND, *arguments)
    assert (done.returncode, named in done.stderr) == (2, True), done.stderr
    assert "Traceback" not in done.stderr


def test_a_flood_of_requests_neither_blocks_the_sender_nor_stops_the_odometry(domain_id):
    with simulation(domain_id), RosRuntime(domain_id) as ros:
        robot = Observer(ros, RosNames())
        ros.start()
        until(robot.is_connected)
        begin, times = time.monotonic(), []
        until(lambda: time.monotonic() - begin > FLOOD)
        begin_of_flood = now = time.monotonic()
        while now - begin_of_flood < FLOOD:
            while len(times) < (now - begin_of_flood) * 20_000:
                robot.request((70.0, 38.7), (71.0, 38.7), (69.0, 38.7))
                times.append(time.monotonic() - now)
                now += times[-1]
            time.sleep(0.001)
            now = time.monotonic()
        before = [at for at, _ in robot.odometry if begin < at < begin + FLOOD]
        during = [at for at, _ in robot.odometry if begin_of_flood < at < begin_of_flood + FLOOD]
        assert len(during) > len(before) / 4
        assert statistics.quantiles(times, n=100)[-1] < BLOCKED
        until(lambda: "dropped" in robot.states)
        assert robot.states.count("queued") <= 20
        assert robot.plan(pose(70.0, 38.7)).poses  # it still answers
