"""Workers on other machines: clocks of their own, a slow network, one that dies, one that comes late, no master."""

import json
import re
import subprocess
import sys
from contextlib import ExitStack, contextmanager
from pathlib import Path

import psutil
import pytest
from network import Network

HERE = Path(__file__).parent
#: Comes up while the master does, and waits for its options; {0}: for how many seconds its master may be silent.
NODE = """
import sys
from loadtests import node
from loadtests.measuring import worker
worker.MASTER_SILENT_S = {0}
node.main(sys.stdin.readline().split())
"""


@pytest.fixture
def network():
    with ExitStack() as stack:
        yield Network(stack)


@contextmanager
def running(*command, **options):
    """A process that ends with the block, and what it started too."""
    process = subprocess.Popen([str(word) for word in command], text=True, **options)
    try:
        yield process
    finally:
        for child in psutil.Process(process.pid).children(recursive=True) if process.poll() is None else []:
            child.kill()
        process.kill()
        process.communicate()


@pytest.fixture
def worker(network):
    """Start workers on the workers' machine; they join when they are told where, see `join`."""
    with ExitStack() as stack:

        def start(*, own_clock=False, silent_s=60):
            command = (*network.on("workers", own_clock=own_clock), sys.executable, "-c", NODE.format(silent_s))
            return stack.enter_context(running(*command, stdin=subprocess.PIPE, stderr=subprocess.PIPE))

        yield start


@pytest.fixture
def device(network, started):
    """Start a device with a description in the middle; returns the description's URL."""

    def start(*options):
        host = network.address("middle")
        port = started("toy_api.py", "--host", host, *options, on=network.on("middle"))[1]
        return f"http://{host}:{port}/openapi.json"

    return start


@pytest.fixture
def begin(network, toy, load, wait_for, tmp_path):
    """Begin a run on the master's machine, with a robot and a relay in the middle.

    Gives the run's process, what waits for it, and what has a worker join, with the options that it shares with the
    master. Without a target, the robot is a toy.
    """
    with ExitStack() as stack:

        def run(*options, target=None, shared=""):
            robot = target or toy(host=network.address("middle"), on=network.on("middle")).both()
            process, finish = load.begin(
                *robot,
                *options,
                f"--client wire --master-host {network.address('master')}",
                shared,
                on=network.on("master"),
            )
            port = wait_for(process, r"master on [\d.]+:(\d+)")[1]
            near = network.address("middle", seen_from="workers")
            command = (sys.executable, HERE / "relay.py", near, network.address("master"), port)
            relay = stack.enter_context(running(*network.on("middle"), *command, stdout=subprocess.PIPE))
            told = (
                f"--worker --master-host {near} --master-port {relay.stdout.readline().strip()} --out {tmp_path}/left"
            )

            def join(*workers, options=shared):
                for one in workers:
                    one.stdin.write(f"{told} {options}\n")
                    one.stdin.flush()

            return process, finish, join

        yield run


def python_of(process):
    """The Python process that a command with words before it has become."""
    family = [psutil.Process(process.pid), *psutil.Process(process.pid).children(recursive=True)]
    return next(one for one in reversed(family) if "loadtests" in " ".join(one.cmdline()))


def test_nothing_is_lost_in_silence_over_a_slow_network(network, worker, begin, wait_for):
    other, doomed, late = worker(own_clock=True), worker(), worker()
    options = "--rate 80 --duration 4 --warmup 0.4 --processes 0 --expect-workers 2"
    process, finish, join = begin(options + " --progress lines")
    join(other, doomed)
    for _ in range(2):
        wait_for(process, r"[1-9]\d* requests answered")
    join(late)
    wait_for(process, r"too late to take part")
    doomed_pid = python_of(doomed).pid
    python_of(doomed).kill()
    run = finish()
    assert [other.wait(60), late.wait(60)] == [0, 0]
    assert "takes no part in it" in late.stderr.read()
    result = run.result
    workers = {entry["state"]: entry for entry in result["workers"]}
    assert set(workers) == {"finished", "lost", "late"}, result["notes"]
    kept, lost, idle = workers["finished"], workers["lost"], workers["late"]
    assert (lost["pid"], idle["requests"]) == (doomed_pid, 0)
    assert idle["joined_at_s"] > 0
    assert lost["requests"] > 0
    # Of a block's odd number of arrivals one has one more.
    assert abs(lost["requests"] + lost["arrivals_lost"] - kept["requests"]) <= 4, "lost and reported make up a share"
    assert {f"worker {entry['id']} ({entry['host']})" for entry in (lost, idle)} == {
        note.split(" was lost")[0].split(" joined")[0] for note in result["notes"] if note.startswith("worker ")
    }
    for entry, ahead_s in ((kept, network.clock_ahead_s), (lost, 0)):
        clock = entry["clock"]
        assert clock["round_trip_ms"] >= 10, "5 ms on each way"
        assert abs(clock["offset_ms"] - ahead_s * 1e3) <= clock["uncertainty_ms"] + 0.001
        assert clock["shared"] == (ahead_s == 0)
    assert result["generator"]["lag_ms"]["p50"] < 1000, "all began when they were to, by their own clocks"
    assert run.code == 4
    assert any("neither sent nor given up" in reason for reason in result["invalid_because"])


def test_workers_outlive_no_master_and_leave_what_they_recorded(worker, begin, wait_for, tmp_path):
    remote = worker(own_clock=True, silent_s=8)
    process, finish, join = begin(
        "--rate 80 --duration 60 --warmup 0.2 --processes 1 --expect-workers 2 --progress lines"
    )
    join(remote)
    for _ in range(2):
        wait_for(process, r"[1-9]\d* requests answered")
    family = psutil.Process(process.pid).children(recursive=True)
    master = next(one for one in family if one.cmdline()[-2:] == ["-m", "loadtests"])
    local = next(one for one in family if "loadtests.measuring.worker" in one.cmdline())
    master.kill()
    run = finish()
    assert run.code == 4
    assert remote.wait(60) == 4
    psutil.wait_procs([local], timeout=60)
    assert not local.is_running()
    for told, why, folder in (
        (run.err, "has ended", run.folder),
        (remote.stderr.read(), "has been silent for", tmp_path / "left"),
    ):
        path = Path(re.search(r"recorded is in (.+\.json)", told)[1])
        assert path.parent == folder
        assert why in told
        left = json.loads(path.read_text())
        assert left["why"] in told
        assert left["workers"] == 2
        assert left["requests"] >= sum(entry["count"] + entry["errors"] for entry in left["series"]) > 20


def test_four_workers_measure_a_described_device_together(network, device, worker, begin, tmp_path):
    token = tmp_path / "token"
    token.write_text("t0ken-of-robot")
    _, finish, join = begin(
        "--operation 'GET /state=2' --operation 'GET /items/{item_id}' --rate 30 --duration 3 --warmup 0",
        "--processes 0 --expect-workers 4",
        target=[device("--auth", "bearer", "--slow", "0.15")],
        shared=f"--token-file {token} --trust-host {network.address('middle')}",
    )
    join(*(worker(own_clock=place % 2 == 1) for place in range(4)))
    run = finish()
    told = run.result["counts"]
    requests = [entry["requests"] for entry in run.result["workers"]]
    missing = told["not_sent"] + sum(entry["arrivals_lost"] for entry in run.result["workers"])
    assert (len(requests), sum(requests)) == (4, told["sent"])
    assert told["asked"] == told["sent"] + missing, run.err
    assert max(requests) - min(requests) <= 4 + missing, "each has its share"
    assert (told["asked_rate"], told["failed"]) == (pytest.approx(30, rel=0.03), {})
    # A machine that is busy with other work delays responses by as much as requests.
    median = run.series("GET /state", "rest")["service_ms"]["p50"]
    assert 150 <= median < 300 + 3 * run.result["generator"]["lag_ms"]["max"], run.err
    state, item = (run.series(name, "rest")["count"] for name in ("GET /state", "GET /items/{item_id}"))
    assert state == pytest.approx(2 * item, abs=4 + missing)


SCENARIO = """
from locust import constant_pacing, task
from loadtests.scenario import RobotUser

class Display(RobotUser):
    wait_time = constant_pacing(0.1)

    @task
    def refresh(self):
        self.client.get("/state")
"""


def test_workers_run_their_own_copy_of_a_scenario(device, worker, begin, tmp_path):
    mine = tmp_path / "display.py"
    mine.write_text(SCENARIO)
    _, finish, join = begin(
        "--users 3 --duration 2 --warmup 0.2 --processes 0 --expect-workers 2",
        target=[device()],
        shared=f"--scenario {mine}",
    )
    join(worker(own_clock=True), worker())
    run = finish()
    assert [entry["state"] for entry in run.result["workers"]] == ["finished"] * 2
    assert run.result["counts"]["achieved_rate"] == pytest.approx(30, rel=0.35)
    assert run.result["counts"]["failed"] == {}


@pytest.mark.parametrize(
    ("theirs", "options", "told"),
    [
        (None, "", "start this worker with --scenario"),
        ("# other", "", "differs from the master's"),
        ("", "--token-file", "credentials that this worker lacks"),
    ],
)
def test_a_worker_that_cannot_do_as_its_master_is_refused(device, worker, begin, tmp_path, theirs, options, told):
    mine, other, token = tmp_path / "display.py", tmp_path / "other.py", tmp_path / "token"
    mine.write_text(SCENARIO)
    other.write_text(SCENARIO + (theirs or ""))
    token.write_text("t0ken-of-robot")
    _, finish, join = begin(
        f"--scenario {mine} --users 3 --duration 2 --processes 0 --expect-workers 1 {options and f'{options} {token}'}",
        target=[device()],
    )
    join(worker(), options="" if theirs is None else f"--scenario {other}")
    run = finish()
    assert (run.code, told in run.err) == (2, True), run.err


def test_the_age_of_data_from_another_machine_has_the_error_of_its_clock(network, device, load):
    _, finish = load.begin(
        device("--ahead", "100", "--age", "0.5"),
        "--operation 'GET /state' --rate 30 --duration 2 --warmup 0.1 --clock-field /now --stamp-field /stamp",
        "--stream 'GET /events'",
        on=network.on("master"),
    )
    run = finish()
    heard, polled = run.result["streams"]
    if network.clock_ahead_s:
        assert (heard["clock"], polled["clock"]) == ("estimated", "estimated")
        assert polled["clock_offset_ms"] == pytest.approx(100_000, abs=polled["age_error_ms"] + 0.01)
        assert 0 < polled["age_error_ms"] < 250
        assert polled["age_ms"]["p50"] >= 500 - polled["age_error_ms"]
        assert heard["age_ms"]["p50"] < polled["age_ms"]["p50"]
        assert "the robot's clock)" in run.out
    else:
        assert polled["clock"] == "shared"
