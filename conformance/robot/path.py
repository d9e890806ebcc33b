"""Whether a pose moves by what its velocity says: the velocity is summed up and compared with the way that was made."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from conformance.robot.geometry import wrapped
from conformance.robot.robot import Odometry, Velocity
from conformance.verdict.evidence import Judge

# Less than this is no drive to judge: m and rad.
_SHORTEST: Final = 0.08
_LEAST_TURN: Final = 0.2
# Readings; a sum over one step says nothing.
_FEWEST: Final = 3
# What may be between the sum of a sampled velocity and the way: relative, and absolute in m and rad.
_SHARE: Final = 0.1
_OFF: Final = 0.03
_OFF_TURN: Final = 0.06


@dataclass(frozen=True)
class _Sum:
    """A velocity summed up by one clock.

    Attributes:
        x, y: way in the odometry frame, m; turn: change of heading, rad.
        length, turned: the same without signs.
        off, off_turn: by how much the sum may be wrong because the velocity changed between two samples.
        turn_error: turn that was made less turn that was summed up, step by step, so that whole turns do not matter.
    """

    x: float
    y: float
    turn: float
    length: float
    turned: float
    off: float
    off_turn: float
    turn_error: float


def _summed(trace: Sequence[Odometry], velocities: Sequence[Velocity], *, by_stamp: bool) -> _Sum:
    x = y = turn = length = turned = off = off_turn = turn_error = 0.0
    for (one, first), (two, last) in itertools.pairwise(zip(trace, velocities, strict=True)):
        lapse = two.stamp - one.stamp if by_stamp else (two.sent + two.received - one.sent - one.received) / 2
        rate = (first.angular_z + last.angular_z) / 2
        step_turn = rate * lapse
        heading = one.pose.yaw + step_turn / 2
        ahead, aside = (first.linear_x + last.linear_x) / 2 * lapse, (first.linear_y + last.linear_y) / 2 * lapse
        x += ahead * math.cos(heading) - aside * math.sin(heading)
        y += ahead * math.sin(heading) + aside * math.cos(heading)
        turn += step_turn
        length += math.hypot(ahead, aside)
        turned += abs(step_turn)
        off += math.hypot(last.linear_x - first.linear_x, last.linear_y - first.linear_y) * abs(lapse) / 2
        off_turn += abs(last.angular_z - first.angular_z) * abs(lapse) / 2
        made = two.pose.yaw - one.pose.yaw - step_turn
        turn_error += wrapped(made) if math.isfinite(made) else math.inf
    return _Sum(x, y, turn, length, turned, off, off_turn, turn_error)


def judge_path(judge: Judge, trace: Sequence[Odometry], measured: Sequence[Velocity]) -> None:
    """Judge pose-motion and pose-rotation by the readings along a drive, where it went far enough.

    The robot's stamps or the time of the readings has to fit, as a simulation may run slower than the clock on the
    wall; and the odometry's own velocity or the one that was measured beside it: whether these two agree is another
    requirement.

    Args:
        judge: is told.
        trace: readings of the odometry, in their order.
        measured: a reading of GET /robot/velocity/ for each of them.
    """
    if len(trace) < _FEWEST:
        return
    sources = ([one.velocity for one in trace], measured)
    sums = [_summed(trace, source, by_stamp=by_stamp) for source in sources for by_stamp in (True, False)]
    _judge_way(judge, trace, [one for one in sums if one.length >= _SHORTEST])
    _judge_turn(judge, trace, [one for one in sums if one.turned >= _LEAST_TURN])


def _judge_way(judge: Judge, trace: Sequence[Odometry], sums: Sequence[_Sum]) -> None:
    if not sums:
        return
    first, last = trace[0], trace[-1]
    made_x, made_y = last.pose.x - first.pose.x, last.pose.y - first.pose.y
    misses = [math.hypot(made_x - one.x, made_y - one.y) - (_SHARE * one.length + _OFF + one.off) for one in sums]
    judge.check(
        "rest-resources/pose-motion",
        any(miss <= 0 for miss in misses),
        last.exchange,
        f"a way of ({sums[0].x:.3f}, {sums[0].y:.3f}) m, which is what the velocity adds up to",
        found=f"the pose moved by ({made_x:.3f}, {made_y:.3f}) m",
        cause="another way",
    )


def _judge_turn(judge: Judge, trace: Sequence[Odometry], sums: Sequence[_Sum]) -> None:
    if not sums:
        return
    judge.check(
        "rest-resources/pose-rotation",
        any(abs(one.turn_error) <= _SHARE * one.turned + _OFF_TURN + one.off_turn for one in sums),
        trace[-1].exchange,
        f"a turn of {sums[0].turn:.3f} rad, which is what the angular velocity adds up to",
        found=f"the heading turned by {sums[0].turn + sums[0].turn_error:.3f} rad",
        cause="another turn",
    )
