"""Which side is at its end, on devices of known capacity: the robot or the generator; and counts that add up."""

import re
import threading
from contextlib import contextmanager

import psutil
import pytest

from reports.latency.page import latency_html, latency_markdown


@pytest.fixture
def bucket(started):
    """Start a device that answers so many requests a second; gives its description."""
    return lambda *numbers: f"http://127.0.0.1:{started('bucket.py', *map(str, numbers))[1]}/openapi.json"


@contextmanager
def limited(command, share, period_s=0.1):
    """Give the process that measures only a share of a processor, as a quota does, whatever else runs here."""
    (process,) = [child for child in psutil.Process(command.pid).children() if "loadtests" in child.cmdline()]
    over = threading.Event()

    def stop_and_go():
        try:
            while not over.wait(period_s * share):
                process.suspend()
                over.wait(period_s * (1 - share))
                process.resume()
        except psutil.NoSuchProcess:
            return

    thread = threading.Thread(target=stop_and_go)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


def adds_up(counts):
    sent, failed = counts["sent"], sum(counts["failed"].values())
    assert counts["asked"] == sent + counts["not_sent"] + counts["lost"]
    assert sent == counts["answered"] + failed
    assert sent + counts["not_sent"] == counts["in_series"] + counts["control_only"] + counts["other_robot"]
    assert counts["waiting_at_end"] <= counts["answered"]
    return counts


def test_an_overloaded_robot_is_told_as_such(bucket, load):
    run = load(bucket(200), "--operation 'GET /state' --rate 300 --duration 6 --warmup 1 --timeout 30")
    result = run.result
    assert run.code == 4, run.out + run.err
    assert result["trustworthy"], result["invalid_because"]
    assert result["headline"]["words"] == "The robot is overloaded"
    told = re.search(
        r"the robot answered (\d+)/s of 300/s offered; all 512 connections were busy from second (\d+)", run.out
    )
    assert told, run.out
    assert 180 <= int(told[1]) <= 205, "it answers 200/s"
    # Its queue grows by 100/s, so 512 connections last 5 s.
    assert 4 <= int(told[2]) <= 6
    assert "CAP_SYS_NICE" not in run.out
    counts = adds_up(result["counts"])
    assert (counts["asked"], counts["in_series"], counts["failed"]) == (1800, 1800, {})
    assert counts["achieved_rate"] == pytest.approx(200, rel=0.08)
    assert counts["waiting_at_end"] == pytest.approx(700, abs=70), "100/s for 7 s"
    page = latency_html(result)
    assert "The robot is overloaded" in page
    assert "What became of the requests" in page


def test_a_slow_generator_is_not_taken_for_a_slow_robot(bucket, load, wait_for):
    process, finish = load.begin(bucket(5000), "--operation 'GET /state' --rate 300 --duration 4 --warmup 0.5")
    wait_for(process, "measuring GET /state")
    with limited(process, 0.1):
        run = finish()
    assert run.code == 4, run.out
    assert not run.result["trustworthy"]
    assert run.result["overload"] is None
    assert run.result["headline"]["words"] == "Not valid"
    assert re.search(r"requests started .* after their time", run.out), run.out
    adds_up(run.result["counts"])


def test_one_side_alone_counts_all_its_requests(bucket, load):
    run = load(bucket(5000), "--operation 'GET /state' --rate 80 --duration 5 --warmup 0.2")
    counts = adds_up(run.result["counts"])
    assert (counts["asked"], counts["in_series"], counts["control_only"]) == (400, 400, 0)
    assert run.series("GET /state", "rest")["count"] == counts["answered"] == 400
    assert counts["achieved_rate"] == pytest.approx(80, rel=0.05)
    assert re.search(r"^asked +400  80.0/s for 5.0 s$", run.out, re.MULTILINE), run.out
    assert "p99 needs 1,000 requests, and GET /state gets 400: --duration 13 is long enough" in run.err


def test_a_device_that_gets_slower_is_told_with_its_slope(bucket, load):
    run = load(bucket(5000, 20), "--operation 'GET /state' --rate 100 --duration 6 --warmup 0.2")
    growth = run.series("GET /state", "rest")["growth"]
    low, high = growth["ci99_ms_per_hour"]
    assert low < growth["ms_per_hour"] < high
    assert growth["ms_per_hour"] == pytest.approx(20 * 3600, rel=0.2)
    assert low > 0
    assert "GET /state over REST: its median grew by" in run.out


def test_searches_for_the_knee_agree_on_a_known_capacity(bucket, load):
    capacity = 300
    run = load(
        bucket(capacity),
        "--operation 'GET /state' --rate 50 --duration 1 --warmup 0.1 --knee --knee-searches 3 --step-duration 1.5",
    )
    (search,) = run.result["knee_search"]
    assert search["rate"] == pytest.approx(capacity, rel=0.2), run.err
    estimates = [(kept * missed) ** 0.5 for kept, missed in search["brackets"]]
    assert len(estimates) == 3, run.err
    assert max(estimates) <= 1.2 * min(estimates)
    missed = [point["offered_rate"] for point in search["curve"] if not point["meets"]]
    assert all(missed.count(rate) >= 2 for _, rate in search["brackets"]), "what ends a branch was tried twice"
    over = [point["achieved_rate"] for point in search["curve"] if point["offered_rate"] > 1.3 * capacity]
    assert over == pytest.approx([capacity] * len(over), rel=0.2), "an overloaded robot goes on at its capacity"
    # It leads even where a busy machine made other requests late.
    assert run.result["headline"]["words"].startswith("REST breaks down at ")
    assert "Where it breaks" in latency_html(run.result)
    assert re.search(r"\| REST \| \d+ \|", latency_markdown(run.result))


def test_a_robot_that_answers_too_late_is_told_as_one_that_stopped(bucket, load):
    run = load(bucket(40), "--operation 'GET /state' --rate 300 --duration 12 --warmup 0.5 --timeout 1")
    assert run.code == 4
    assert run.result["headline"]["words"] == "The robot stopped answering"
    assert re.search(
        r"^The robot stopped answering: no request succeeded from \d\.\d s on; they took over 1 s: a lower --rate "
        r"shows whether \d+/s was too much\.$",
        run.out,
        re.MULTILINE,
    ), run.out
    assert "say nothing about the robot" not in run.out
    assert "No request failed" not in latency_html(run.result)
