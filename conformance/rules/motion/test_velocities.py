"""Whether a device drives at the velocities that it is given, and stops when it is told or let go (motion map)."""

from __future__ import annotations

from collections.abc import Iterator

from conformance.rules.motion.judging import at, driven, measured, off, usual_s
from conformance.scenarios.motion.trace import SEVERAL, Drive, Reading, fastest
from conformance.scenarios.motion.velocities import let_go, velocities
from conformance.scenarios.rule import Case, NotTested, Outcome, rule
from conformance.statement.motion_map import MotionMap

# Of the hold time: within that part the device must still drive, and at least at this part of its velocity.
_HELD = (0.2, 0.7)
_STILL_DRIVES = 0.5


@rule("motion/velocity", on=(velocities,))
def velocity(trace: tuple[Drive, ...], motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether the device drives at a velocity within its limits."""
    for drive in trace:
        yield from driven(drive, motion)


def _at_rest(readings: list[Reading], motion: MotionMap) -> str | None:
    """Return what still moves in some readings; empty if nothing does, None if they do not show it."""
    seen = tuple(one for one in readings if one.values)
    if len(seen) < 2 * SEVERAL:
        return None
    moved = off(at(seen[-SEVERAL:], motion), at(seen[:SEVERAL], motion), motion)
    return moved or fastest(readings, motion)


@rule("motion/velocity-stop", on=(velocities,))
def stopped(trace: tuple[Drive, ...], motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether velocity 0 brings the device to rest in time."""
    for drive in trace:
        if motion.velocity is None or drive.end is None:
            continue
        if not drive.end.accepted:
            yield Case(holds=False, exchange=drive.end.exchange, expected=f"a 2xx for velocity 0 after {drive.what}")
            continue
        within_s = motion.velocity.settle_s + usual_s(drive.after)
        moved = _at_rest([one for one in drive.after if one.sent >= drive.end.sent + within_s], motion)
        yield from _rests(moved, drive, f"rest {motion.velocity.settle_s:g} s after velocity 0 ({drive.what})")


def _rests(moved: str | None, drive: Drive, expected: str) -> Iterator[Outcome]:
    if moved is None:
        yield NotTested("the state could not be read after the drive")
    else:
        last = drive.end or drive.commands[-1]
        yield Case(not moved, last.exchange, expected, observed=moved, cause="moves")


@rule("motion/watchdog", on=(let_go,))
def watchdog(trace: tuple[Drive, ...], motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether a device that gets no command any more rests after its hold time; every time counts."""
    for drive in trace:
        if motion.velocity is None or motion.velocity.hold_s is None:
            continue
        last, within_s = drive.commands[-1], motion.velocity.hold_s + motion.velocity.settle_s
        due = last.answered + within_s + usual_s(drive.after)
        moved = _at_rest([one for one in drive.after if one.sent >= due], motion)
        yield from _rests(moved, drive, f"rest {within_s:g} s after the last command ({drive.what})")


@rule("motion/hold", on=(let_go,))
def hold(trace: tuple[Drive, ...], motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether a device that gets no command any more still drives within its hold time."""
    for drive in trace:
        if motion.velocity is None or motion.velocity.hold_s is None:
            continue
        last, (begin, end) = drive.commands[-1], (part * motion.velocity.hold_s for part in _HELD)
        within = [one for one in drive.after if last.answered + begin <= one.sent and one.received <= last.sent + end]
        for name, wanted in drive.wanted.items():
            found = measured(within, name, motion) if wanted else None
            if found is not None:
                yield Case(
                    found * wanted > 0 and abs(found) >= _STILL_DRIVES * abs(wanted),
                    last.exchange,
                    f"{name} still driven {_HELD[1]:.0%} of the hold time after the last command ({drive.what})",
                    observed=f"{found:.4g} in place of {wanted:.4g} per second",
                    cause=name,
                )
            elif wanted:
                yield NotTested("the hold time is too short to see whether the device still drives")
