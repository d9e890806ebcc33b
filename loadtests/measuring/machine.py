"""The generator's machine: time stolen by its host, quota, governor, load; and real-time priority on it."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import psutil

from loadtests.schedule.plan import Plan

_GOVERNOR = Path("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor")
_GROUPS = Path("/sys/fs/cgroup")
#: From these shares on there is a remark.
_NOTED_STEAL = 0.02
_NOTED_THROTTLED = 0.01
_STEADY = frozenset({"performance"})


@dataclass(frozen=True)
class Moment:
    """The machine's processor time counters at one time, in s since boot; `at_s` is the sum over all processors."""

    at_s: float
    steal_s: float
    throttled_s: float
    load: tuple[float, float, float] | None

    @classmethod
    def now(cls) -> Self:
        """Read the counters."""
        times = psutil.cpu_times()
        return cls(sum(times), getattr(times, "steal", 0.0), _throttled_s(), psutil.getloadavg())


def conditions(before: Moment, after: Moment) -> tuple[dict[str, Any], list[str]]:
    """Return the `machine` of latency.json's environment between two moments, and remarks on disturbances."""
    passed = max(after.at_s - before.at_s, 1e-9)
    cpus = os.cpu_count() or 1
    steal = (after.steal_s - before.steal_s) / passed
    throttled = (after.throttled_s - before.throttled_s) / (passed / cpus)
    quota, governor = cpu_quota(), _read(_GOVERNOR)
    remarks = []
    if steal > _NOTED_STEAL:
        remarks.append(
            f"the machine's host took {steal:.1%} of its time (steal), so that the figures depend on the host"
        )
    if throttled > _NOTED_THROTTLED:
        remarks.append(
            f"the generator's control group was throttled for {throttled:.1%} of the run: its quota is {quota:g} CPUs"
            if quota
            else f"the generator's control group was throttled for {throttled:.1%} of the run"
        )
    if governor and governor not in _STEADY:
        remarks.append(f"the processor's governor is {governor!r}: its clock rate follows the load")
    found = {
        "steal_share": round(steal, 6),
        "throttled_share": round(throttled, 6),
        "cpu_quota": quota,
        "governor": governor,
        "load_average_before": round(before.load[0], 2) if before.load else None,
        "load_average_after": round(after.load[0], 2) if after.load else None,
    }
    if said := busy_text(found, cpus):
        remarks.append(f"the machine was busy: {said}, so that requests waited for a processor too")
    return found, remarks


def busy_text(machine: dict[str, Any], cpus: int) -> str:
    """Return how busy a machine was, by its load averages; empty if it had processors to spare."""
    before, after = machine["load_average_before"], machine["load_average_after"]
    if before is None or after is None or max(before, after) <= cpus:
        return ""
    return f"load average {before:.1f} before the run and {after:.1f} after it on {cpus} CPUs"


def _read(path: Path) -> str | None:
    try:
        return path.read_text("ascii").strip() or None
    except (OSError, UnicodeDecodeError):
        return None


def _groups() -> list[Path]:
    """Return the folders of this process's control group (cgroup v2) and of its parents."""
    text = _read(Path("/proc/self/cgroup")) or ""
    own = next((line[3:] for line in text.splitlines() if line.startswith("0::")), None)
    if own is None:
        return []
    folder = _GROUPS / own.strip("/")
    return [folder, *(above for above in folder.parents if above.is_relative_to(_GROUPS))]


def cpu_quota() -> float | None:
    """Return the lowest CPU quota of our control groups (cpu.max); None without one."""
    found = []
    for folder in _groups():
        words = (_read(folder / "cpu.max") or "").split()
        if len(words) == 2 and words[0].isdigit() and words[1].isdigit():  # noqa: PLR2004 -- quota and period
            found.append(int(words[0]) / int(words[1]))
    return min(found, default=None)


def _throttled_s() -> float:
    """Return for how long our control groups have been throttled, at most."""
    found = [0.0]
    for folder in _groups():
        for line in (_read(folder / "cpu.stat") or "").splitlines():
            name, _, value = line.partition(" ")
            if name == "throttled_usec" and value.isdigit():
                found.append(int(value) / 1e6)
    return max(found)


def leaves_the_robot_room(plan: Plan, processors: int) -> bool:
    """Return whether the workers may run first: they are mostly idle, and a processor is left for the robot.

    It assumes that all workers are on this machine.
    """
    return plan.mostly_idle and plan.workers < processors


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
