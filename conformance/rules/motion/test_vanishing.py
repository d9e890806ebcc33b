"""Whether a device stops when its client vanishes, in whatever way (motion map)."""

from __future__ import annotations

from collections.abc import Iterator

from conformance.rules.motion import test_velocities
from conformance.scenarios.motion.trace import Drive
from conformance.scenarios.motion.vanishing import vanishing
from conformance.scenarios.rule import Outcome, rule
from conformance.statement.motion_map import MotionMap


@rule("motion/watchdog", on=(vanishing,))
def watchdog_however(trace: tuple[Drive, ...], motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether a device rests after its hold time, however its client has vanished."""
    yield from test_velocities.watchdog.judge(trace, motion)
