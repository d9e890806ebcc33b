"""Rules on drives: the robot accepts and reaches velocities, and its pose follows them."""

from collections.abc import Iterator
from typing import Final

from conformance.measures.samples import FARTHEST
from conformance.packs.table1.robot.drive_rules import Driven, outcomes, rule_on
from conformance.packs.table1.robot.geometry import pose_of, wrapped
from conformance.packs.table1.robot.message_shapes import ODOMETRY, read_as
from conformance.packs.table1.robot.motion_map import velocity_of
from conformance.packs.table1.robot.robot import STILL, is_near
from conformance.packs.table1.scenarios.turn import further_axes, straight, turn
from conformance.packs.table1.scenarios.walks import velocity_walk
from conformance.packs.table1.statement import said_of
from conformance.scenarios.rule import NotClaimed, Outcome, rule
from conformance.verdict.evidence import Case
from conformance.verdict.run import Run

_OFF: Final = 1.5  # error that the velocity of a robot at rest may have, in tolerances
_PLACE_M: Final = 0.05  # error that the pose of a robot at rest may have, m and rad
_HEADING_RAD: Final = 0.1
# Least length of a pause without any request, s.
_PAUSE_S: Final = 0.25

velocity_put = rule_on("rest-resources/velocity-put", straight, velocity_walk)
velocity_integers = rule_on("rest-resources/velocity-integers", turn)
velocity_converges = rule_on("rest-resources/velocity-converges", straight, turn, further_axes, velocity_walk)
velocity_range = rule_on("rest-resources/velocity-range", straight, turn, further_axes)


@rule("rest-resources/velocity-both", on=(turn,))
def velocity_both(trace: Driven, run: Run) -> Iterator[Outcome]:
    """Judge that the robot reaches both limits at once, unless its statement excludes that."""
    statement = said_of(run)
    found = list(outcomes("rest-resources/velocity-both", trace.drive, statement.limits))
    if not found:
        # The statement declares how both velocities depend on each other, or lacks one of the two limits.
        yield NotClaimed("does not apply: by its statement the robot need not, or velocity-range judges it")
    yield from found


velocity_odometry = rule_on("rest-resources/velocity-odometry", straight, turn, velocity_walk)


@rule("rest-resources/velocity-odometry", on=(turn,))
def velocity_after_pause(trace: Driven, run: Run) -> Iterator[Outcome]:
    """Judge that the first velocity read after a pause is not an old one; a single old one may be chance."""
    limits = said_of(run).limits
    stale = [
        first
        for first, then in trace.paused
        if all(one.odometry and is_near(limits, one.odometry.velocity, STILL) for one in (first, then))
        and first.velocity is not None
        and not is_near(limits, first.velocity, STILL, _OFF)
    ]
    if len(stale) > 1:
        expected = "the odometry's velocity, rest, in the first GET after a pause"
        seen = f"{stale[-1].velocity}; another velocity than the odometry's after {len(stale)} pauses"
        yield Case(False, stale[-1].velocity_exchange, expected, seen, "after a pause")


@rule("rest-resources/pose-motion", on=(turn,))
def pose_after_pause(trace: Driven, run: Run) -> Iterator[Outcome]:
    """Judge that the first pose read after a pause equals the next, as the robot rests."""
    limits = said_of(run).limits
    room_m, room_rad = _PLACE_M + FARTHEST * limits.noise.position_m, _HEADING_RAD + FARTHEST * limits.noise.heading_rad
    stale = []
    for drive in trace.let_go:
        for before, one, then in zip(drive.after, drive.after[1:], drive.after[2:], strict=False):
            first, second = (read_as(each.exchange.response, ODOMETRY)[0] for each in (one, then))
            rests = all(is_near(limits, velocity_of(each.speeds), STILL) for each in (one, then))
            if one.sent - before.received < _PAUSE_S or first is None or second is None or not rests:
                continue
            pose, later = pose_of(first["pose"]["pose"]), pose_of(second["pose"]["pose"])
            if pose.distance(later) > room_m or abs(wrapped(pose.yaw - later.yaw)) > room_rad:
                stale.append((one, pose))
    if len(stale) > 1:
        expected = "the pose at which the robot rests, in the first GET after a pause"
        seen = f"{stale[-1][1]}; another pose than the next GET's after {len(stale)} pauses"
        yield Case(False, stale[-1][0].exchange, expected, seen, "after a pause")


linear_put = rule_on("rest-resources/linear-put", turn, velocity_walk)
linear_keeps_angular = rule_on("rest-resources/linear-keeps-angular", turn, velocity_walk)
linear_agrees = rule_on("rest-resources/linear-agrees", straight, turn, velocity_walk)
pose_motion = rule_on("rest-resources/pose-motion", straight, turn, further_axes, velocity_walk)
pose_rotation = rule_on("rest-resources/pose-rotation", turn, velocity_walk)
