"""Whether a device drives at commanded velocities, and stops by command or when commands cease (motion map)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence

from conformance.measures.samples import SEVERAL, longest_s
from conformance.rules.motion.judging import at, follows, is_each_late, must_rest_from, off, slowest, tries_of, went_on
from conformance.scenarios.motion.measuring import end_of_travel, noise_of, speed_in
from conformance.scenarios.motion.resting import crept, fastest
from conformance.scenarios.motion.trace import Command, Drive, Reading
from conformance.scenarios.motion.velocities import HELD, let_go, velocities
from conformance.scenarios.rule import NotClaimed, NotTested, Outcome, rule
from conformance.statement.motion_map import MotionMap
from conformance.verdict.evidence import Case

# Least share of its velocity at which the device must still drive within its hold time.
_STILL_DRIVES = 0.5
# A velocity may continue after its hold time for this share of it, plus this time, s.
_LONGER, _LONGER_S = 0.4, 0.25
_NO_HOLD = NotClaimed("the map declares no hold_s: the device goes on until it is told otherwise")
# Time after which a device that a refusal stops is seen to be slower, s.
_SLOWS_S = 0.1


@rule("motion/velocity", on=(velocities,))
def velocity(trace: tuple[Drive, ...], motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether the device drives at a velocity within its limits."""
    yield from follows(trace, motion)


def _at_rest(readings: list[Reading], drive: Drive, motion: MotionMap) -> str | None:
    """Return the axes that still move in some readings, as text; empty if none, None if it cannot be told."""
    seen = tuple(reading for reading in readings if reading.values or (reading.speeds and not motion.state.axes))
    if len(seen) < 2 * SEVERAL:
        return None
    moved = off(at(seen[-SEVERAL:], motion), at(seen[:SEVERAL], motion), motion)
    return moved or fastest(readings, motion) or crept(readings, motion, drive.resting)


@rule("motion/velocity-stop", on=(velocities,))
def stopped(trace: tuple[Drive, ...], motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether velocity 0 brings the device to rest in time."""
    if motion.velocity is not None:
        yield from judge_ends(trace, motion.velocity.settle_s, "velocity 0", motion)


def judge_ends(trace: Sequence[Drive], settle_s: float, what: str, motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether the command that ends a drive brings the device to rest in time: "velocity 0", or "the stop"."""
    for tries in tries_of(trace):
        ends = [(drive, drive.end) for drive in tries if drive.end is not None]
        ended = [(drive, end) for drive, end in ends if bool(end.targets) == (what == "velocity 0")]
        excused = not is_each_late([(end, drive.readings) for drive, end in ended])
        for drive, end in ended:
            yield from _judge_end(drive, end, settle_s, what, motion, excused=excused)


def _judge_end(
    drive: Drive, end: Command, settle_s: float, what: str, motion: MotionMap, *, excused: bool
) -> Iterator[Outcome]:
    if not end.is_ok:
        yield Case(holds=False, exchange=end.exchange, expected=f"a 2xx for {what} after {drive.name}")
        return
    due = must_rest_from(end, drive.readings, excused=excused) + settle_s
    moved = _at_rest([reading for reading in drive.after if reading.sent >= due], drive, motion)
    if not excused and not moved:
        axes = motion.velocity.axes if motion.velocity else {}
        speeds = {axes[name].of: speed * axes[name].scale for name, speed in drive.wanted.items() if axes[name].of}
        moved = went_on(end, drive.readings, speeds, settle_s, motion) or moved
    yield from _rests(moved, drive, f"rest {settle_s:g} s after {what} ({drive.name})")


def _rests(moved: str | None, drive: Drive, expected: str) -> Iterator[Outcome]:
    if moved is None:
        yield NotTested("the state could not be read after the drive")
    else:
        last = drive.end or drive.commands[-1]
        yield Case(not moved, last.exchange, expected, observed=moved, cause="moves")


@rule("motion/watchdog", on=(let_go,))
def watchdog(trace: tuple[Drive, ...], motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether a device that gets no command any more rests after its hold time, however its client vanishes."""
    if motion.velocity is None or motion.velocity.hold_s is None:
        yield _NO_HOLD
        return
    for drive in trace:
        last, within_s = drive.commands[-1], motion.velocity.hold_s + motion.velocity.settle_s
        due = last.answered + within_s + longest_s(drive.readings)
        seen_from = due if drive.rested is None else min(due, drive.rested)
        moved = _at_rest([reading for reading in drive.after if reading.sent >= seen_from], drive, motion)
        moved = moved or _still_driven(drive, due, motion.velocity.hold_s, motion) or moved
        yield from _rests(moved, drive, f"rest {within_s:g} s after the last command ({drive.name})")


def _still_driven(drive: Drive, due: float, hold_s: float, motion: MotionMap) -> str:
    """Return the axes still driven at the commanded velocity long after the hold time; empty if none.

    A device that is coming to rest by then is slower: commands and readings are delayed by part of the settle time.
    """
    settle_s = motion.velocity.settle_s if motion.velocity else 0.0
    late = due - settle_s + max(_LONGER * hold_s, settle_s / 2, _LONGER_S)
    seen = [reading for reading in drive.after if late <= reading.sent and reading.received <= due]
    for name, wanted in drive.wanted.items():
        found = speed_in(seen, name, motion) if wanted else None
        if found is not None and abs(found - wanted) <= motion.speed_tolerance(name) < abs(wanted) / 2:
            return f"{name} at {found:.4g} per second, {seen[0].sent - drive.commands[-1].answered:.2f} s after it"
    return ""


def _hold_window(drive: Drive, hold_s: float, share: float, motion: MotionMap) -> tuple[float, float]:
    """Return from when to when a device that was let go must still drive, also if it refused something meanwhile."""
    last, refused = drive.commands[-1], drive.refused
    # A last command of some velocities alone need not renew the others.
    names = motion.velocity.axes.keys() if motion.velocity else set()
    in_part = motion.velocity is not None and any(way.axes < names for way in motion.velocity.ways)
    sent = drive.commands[-2].sent if in_part and len(drive.commands) > 1 else last.sent
    if refused is None:
        return last.answered + HELD[0] * hold_s, sent + share * hold_s
    return refused.answered + _SLOWS_S, sent + hold_s


@rule("motion/hold", on=(let_go,))
def hold(trace: tuple[Drive, ...], motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether a device that gets no command any more still drives within its hold time."""
    return judge_hold(trace, motion, HELD[1])


def fails(outcomes: Iterable[Outcome]) -> bool:
    """Return whether any outcome is a failure."""
    return any(isinstance(case, Case) and not case.holds for case in outcomes)


def judge_hold(trace: tuple[Drive, ...], motion: MotionMap, share: float) -> Iterator[Outcome]:
    """Judge whether a device still drives for a share of its hold time.

    On a slow machine a drive may show too little of it; another one of the same axis is enough.
    """
    if motion.velocity is None or motion.velocity.hold_s is None:
        yield _NO_HOLD
        return
    unseen, seen = set[str](), set[str]()
    so_far = [reading for drive in trace for reading in drive.readings]
    for drive in trace:
        last, (begin, end) = drive.commands[-1], _hold_window(drive, motion.velocity.hold_s, share, motion)
        within = [reading for reading in drive.after if begin <= reading.sent and reading.received <= end]
        for name, wanted in drive.wanted.items():
            found = speed_in(within, name, motion) if wanted else None
            if end_of_travel(within, name, wanted, motion, so_far) is not None:
                continue
            if found is not None:
                seen.add(name)
                room = noise_of(within, name, motion, drive.resting)
                slow = slowest(within, name, wanted)
                found = found if slow is None else math.copysign(1, wanted) * slow
                yield Case(
                    math.copysign(1, wanted) * found >= _STILL_DRIVES * abs(wanted) - room,
                    last.exchange,
                    f"{name} still driven {end - last.sent:.2g} s after the last command ({drive.name})",
                    observed=f"{found:.4g} in place of {wanted:.4g} per second",
                    cause=name,
                )
            elif wanted:
                unseen.add(name)
    if unseen - seen:
        yield NotTested("the hold time is too short to see whether the device still drives")
