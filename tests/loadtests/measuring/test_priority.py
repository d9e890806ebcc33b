"""Who comes first on a processor, and when."""

import os
import subprocess
import sys
from dataclasses import replace

import pytest

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
