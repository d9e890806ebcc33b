"""First in line for a processor while requests are sent, where the system allows it.

On a machine that others use too a woken process waits for the end of another's time slice, milliseconds at times: the
request starts late, and its answer is read late. A process of the lowest real-time class does not wait (sched(7)). It
takes CAP_SYS_NICE, and is done only where the generator needs a small part of one processor of several: it must not
take the robot's.
"""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from loadtests.schedule.plan import Plan

#: Requests a second, of one process, up to which it is idle most of the time.
MOST_RATE = 1000.0


def leaves_the_robot_room(plan: Plan, processors: int) -> bool:
    """Return whether the workers may run first: open model, moderate rate, and a processor left for the robot.

    The workers are taken to be all on this machine: of those elsewhere they do not know.
    """
    moderate = plan.load.rate is not None and plan.load.rate / plan.workers <= MOST_RATE
    return moderate and plan.open_model and plan.step_rate is None and plan.workers < processors


@contextmanager
def first_in_line(*, wanted: bool) -> Iterator[bool]:
    """Run this thread before all ordinary ones while the context lasts; yields whether that was allowed.

    Processes that are started meanwhile do not inherit it.
    """
    if not wanted or sys.platform != "linux":
        yield False
        return
    policy, parameters = os.sched_getscheduler(0), os.sched_getparam(0)
    lowest = os.sched_param(os.sched_get_priority_min(os.SCHED_RR))
    try:
        os.sched_setscheduler(0, os.SCHED_RR | os.SCHED_RESET_ON_FORK, lowest)
    except OSError:  # not allowed to us, or unknown to this kernel
        yield False
        return
    try:
        yield True
    finally:
        os.sched_setscheduler(0, policy, parameters)
