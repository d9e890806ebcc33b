"""Real-time priority for the load generator while it sends requests, where the system allows it.

On a shared machine a woken process waits for the end of another process's time slice, sometimes for milliseconds: the
request starts late, and its response is read late. A process of the lowest real-time class does not wait (sched(7)).
That needs CAP_SYS_NICE, and is used only where the generator needs a small part of one of several processors: the
generator must not take the robot's processor time.
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

    It assumes that all workers are on this machine.
    """
    moderate = plan.load.rate is not None and plan.load.rate / plan.workers <= MOST_RATE
    return moderate and plan.open_model and plan.step_rate is None and plan.workers < processors


@contextmanager
def first_in_line(*, wanted: bool) -> Iterator[bool]:
    """Give this thread real-time priority while the context lasts; yield whether the system allowed that.

    Child processes do not inherit the priority.
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
