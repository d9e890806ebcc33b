"""Clocks read by exchanges of messages; who comes first on a processor, and when."""

import os
import subprocess
import sys
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from loadtests.measuring.clocks import Reading, WorkerClock, best
from loadtests.measuring.machine import first_in_line, leaves_the_robot_room
from loadtests.schedule.plan import Load, Plan

PLAN = Plan(("pose",), ("rest",), ("wire",), Load(200.0, None, 1.0, 0.0, "constant", 1), 1.0, 1, 1)


def test_the_usual_class_comes_back_and_no_child_inherits_the_other():
    before = os.sched_getscheduler(0)
    with first_in_line(wanted=True) as allowed:
        assert (os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK == os.SCHED_RR) is allowed
        child = subprocess.run(
            [sys.executable, "-c", "import os; print(os.sched_getscheduler(0))"], check=True, capture_output=True
        )
    assert int(child.stdout) == os.SCHED_OTHER
    assert os.sched_getscheduler(0) == before
    with first_in_line(wanted=False) as allowed:
        assert not allowed
        assert os.sched_getscheduler(0) == before


@pytest.mark.parametrize(
    ("plan", "processors", "room"),
    [
        (PLAN, 2, True),
        (PLAN, 1, False),
        (replace(PLAN, workers=2), 2, False),
        (replace(PLAN, load=replace(PLAN.load, rate=1001.0)), 2, False),
        (replace(PLAN, load=replace(PLAN.load, rate=1001.0), workers=2), 4, True),
        (replace(PLAN, load=replace(PLAN.load, rate=None, users=1)), 2, False),
        (replace(PLAN, step_rate=100.0), 2, False),
    ],
)
def test_the_robot_is_left_a_processor(plan, processors, room):
    assert leaves_the_robot_room(plan, processors) is room


ways = st.integers(0, 10**9)


@given(st.integers(-(10**18), 10**18), st.lists(st.tuples(ways, ways), min_size=1, max_size=8))
def test_an_offset_is_wrong_by_half_the_shortest_round_trip_at_most(offset, delays):
    readings = [Reading.of(5, 5 + there + offset, 5 + there + back) for there, back in delays]
    found = best(readings)
    assert found.round_trip_ns == min(there + back for there, back in delays)
    assert abs(found.offset_ns - offset) <= found.round_trip_ns / 2 + 1


def test_a_moment_of_the_masters_by_a_workers_clock():
    clock = WorkerClock()
    assert clock.of_master(7) is None
    assert clock.figures() is None
    clock.add(Reading(1_000_000, 400_000))
    clock.add(Reading(1_250_000, 200_000))
    assert clock.of_master(7) == 1_250_007
    figures = {"offset_ms": 1.25, "uncertainty_ms": 0.1, "round_trip_ms": 0.2, "change_ms": 0.25}
    assert clock.figures() == figures | {"shared": False}
    clock.shared = True
    assert clock.of_master(7) == 7, "what is one clock is not moved by the error of reading it"
    assert best([]) is None
