import math
import random
from dataclasses import replace

import pytest
from toy_messages import exchange

from conformance.packs.table1.limits import Noise
from conformance.packs.table1.robot.drive_rules import way_and_turn
from conformance.packs.table1.robot.geometry import Pose, length_of, quaternion_of, wrapped, yaw_of
from conformance.packs.table1.robot.robot import Odometry, Velocity

_NONE = Noise()
_START = Pose(1.0, 2.0, 0.3)
_EVIDENCE = exchange()


def drive(v: float, w: float, start: Pose, change=lambda pose: pose, seconds: float = 1.0) -> tuple[list, list]:
    """The odometry of an arc, read fifty times a second."""
    trace, velocity, pose = [], Velocity(linear_x=v, angular_z=w), start
    for step in range(int(seconds * 50)):
        at = step / 50
        trace.append(Odometry(at, at + 0.001, 1000.0 + at, change(pose), velocity, _EVIDENCE))
        heading = pose.yaw + w / 100
        pose = Pose(
            pose.x + v / 50 * math.cos(heading), pose.y + v / 50 * math.sin(heading), wrapped(pose.yaw + w / 50)
        )
    return trace, [velocity] * len(trace)


def later(one: Odometry, by_s: float, **changes) -> Odometry:
    times = {name: getattr(one, name) + by_s for name in ("sent", "received", "stamp")}
    return replace(one, **times | changes)


def still(one: Odometry, count: int) -> list[Odometry]:
    """A robot that was at rest before a reading, for so many readings."""
    return [later(one, -i / 50) for i in range(count, 0, -1)]


def judged(trace, measured, noise=_NONE) -> dict[str, bool]:
    """Whether each requirement holds that the readings show something of."""
    names = ("pose-motion", "pose-rotation")
    cases = zip(names, way_and_turn(trace, measured, noise), strict=True)
    return {name: case.holds for name, case in cases if case is not None}


def refuted(v: float, w: float, change=lambda pose: pose, start: Pose = _START) -> set[str]:
    found = judged(*drive(v, w, start, change))
    assert found
    return {name for name, holds in found.items() if not holds}


@pytest.mark.parametrize("v", [0.3, -0.3, 0.0])
@pytest.mark.parametrize("w", [1.0, -2.5, 0.0])
def test_a_robot_that_does_what_its_velocity_says_is_not_refuted(v, w):
    if v or w:
        assert refuted(v, w, start=Pose(-3.0, 5.0, 3.0)) == set()


@pytest.mark.parametrize(
    ("change", "v", "w", "found"),
    [
        (lambda pose: pose._replace(x=100 * pose.x, y=100 * pose.y), 0.3, 0.0, "pose-motion"),
        (lambda pose: pose._replace(x=pose.y, y=pose.x), 0.3, 0.0, "pose-motion"),
        (lambda pose: pose._replace(x=-pose.x, y=-pose.y), 0.3, 0.0, "pose-motion"),
        (lambda pose: pose._replace(x=pose.x / 2, y=pose.y / 2), 0.5, 0.0, "pose-motion"),
        (lambda pose: pose._replace(x=0.0, y=0.0), 0.3, 0.0, "pose-motion"),
        (lambda pose: pose._replace(yaw=-pose.yaw), 0.0, 1.0, "pose-rotation"),
        (lambda pose: pose._replace(yaw=0.0), 0.0, 1.0, "pose-rotation"),
        (lambda pose: pose._replace(yaw=pose.yaw / 2), 0.0, 1.0, "pose-rotation"),
        (lambda pose: pose._replace(yaw=math.nan), 0.0, 1.0, "pose-rotation"),
    ],
)
def test_a_pose_that_moves_otherwise_is_refuted(change, v, w, found):
    assert found in refuted(v, w, change)


def test_what_nobody_saw_is_not_judged():
    """A robot that stood still while its answers were held up for two seconds, and drove on."""
    first, measured = drive(0.5, 0.5, _START)
    then, more = drive(0.5, 0.5, first[-1].pose)
    found = judged(first + [later(one, 1 + 2.0) for one in then], measured + more)
    assert "pose-motion" in found
    assert False not in found.values()


def _held_up(w, at, lost, change=lambda pose: pose, rest=0):
    """A robot at rest for so many readings, then on a turn; its own process stands still for 0.4 s, ``at`` in the turn.

    Its clock goes on meanwhile, readings go on showing the last sample, and ``lost`` of the way is not made.
    """
    trace, measured = drive(0.0, w, _START, seconds=1.5)
    before, after = trace[:at], trace[at:]
    same = [later(before[-1], i / 50, stamp=before[-1].stamp) for i in range(1, 20)]
    unmade = 0.4 * w * (1 - lost)
    after = [later(one, 0.4, pose=one.pose._replace(yaw=wrapped(one.pose.yaw + unmade))) for one in after]
    found = [replace(one, pose=change(one.pose)) for one in (*still(trace[0], rest), *before, *same, *after)]
    return found, [Velocity()] * rest + measured[:at] + [measured[0]] * len(same) + measured[at:]


@pytest.mark.parametrize("at", [5, 20, 37, 50, 70])
@pytest.mark.parametrize("lost", [0.0, 0.75, 1.0])
@pytest.mark.parametrize("rest", [0, 100])
def test_odometry_that_was_held_up_once_fails_nobody(at, lost, rest):
    found = judged(*_held_up(2.5, at, lost, rest=rest))
    assert "pose-rotation" in found
    assert False not in found.values()


def test_a_robot_on_a_machine_with_too_much_to_do_is_not_blamed():
    """Of its samples two in three are delayed; of each delay it makes no more than 0.1 s of the way."""
    heading, at, trace = 0.0, 0.0, []
    for number in range(60):
        lapse = (0.02, 0.1, 0.28)[number % 3]
        at += lapse
        heading += 0.8 * min(lapse, 0.1)
        trace.append(Odometry(at, at, at, Pose(0.0, 0.0, heading), Velocity(angular_z=0.8), _EVIDENCE))
    assert False not in judged(trace, [one.velocity for one in trace]).values()


@pytest.mark.parametrize("at", [5, 37, 70])
def test_odometry_that_was_held_up_once_excuses_nobody(at):
    found = judged(*_held_up(1.2, at, 0.0, lambda pose: pose._replace(yaw=0.7 * pose.yaw), rest=100))
    assert False in found.values()


def test_one_jump_while_many_readings_show_a_robot_at_rest_fails_nobody():
    trace, measured = drive(0.5, 0.0, _START)
    moved = [one if i < 5 else replace(one, pose=one.pose._replace(y=one.pose.y + 0.2)) for i, one in enumerate(trace)]
    found = judged(still(trace[0], 200) + moved, [Velocity()] * 200 + measured)
    assert "pose-motion" in found
    assert False not in found.values()


def test_a_robot_that_did_not_move_is_not_judged():
    assert judged(*drive(0.0, 0.0, Pose(0, 0, 0))) == {}


def test_a_simulation_at_half_speed_goes_by_its_stamps():
    trace, measured = drive(0.3, 0.0, Pose(0, 0, 0))
    slow = [Odometry(2 * o.sent, 2 * o.received, o.stamp, o.pose, o.velocity, o.exchange) for o in trace]
    assert False not in judged(slow, measured).values()


@pytest.mark.parametrize("yaw", [0.0, 1.0, -3.0, math.pi / 2])
@pytest.mark.parametrize("length", [1.0, 2.0, 1e-3])
def test_a_quaternion_of_any_length_has_its_heading(yaw, length):
    quaternion = quaternion_of(yaw, length)
    assert yaw_of(quaternion) == pytest.approx(yaw)
    assert length_of(quaternion) == pytest.approx(length)


def test_a_pose_is_seen_from_a_frame():
    assert Pose(1.0, 0.0, 0.0).seen_from(Pose(2.0, -1.0, math.pi / 2)) == pytest.approx((2.0, 0.0, math.pi / 2))
    assert Pose(0, 0, 0).ahead(2.0, math.pi / 2) == pytest.approx((0.0, 2.0, math.pi / 2))


def _to_and_fro(v: float, w: float, scale: float, noise: float = 0.0) -> tuple[list, list]:
    """One second one way, one second at rest, one second the other way; poses are ``scale`` times as far as driven."""
    by = random.Random(7)  # noqa: S311 - no secret
    trace, measured, pose, shown = [], [], _START, _START
    for second, sign in enumerate((1, 0, -1)):
        part, velocities = drive(sign * v, sign * w, pose)
        for one in part:
            turned = wrapped(one.pose.yaw - pose.yaw)
            there = Pose(
                shown.x + scale * (one.pose.x - pose.x) + by.gauss(0, noise),
                shown.y + scale * (one.pose.y - pose.y) + by.gauss(0, noise),
                wrapped(shown.yaw + scale * turned + by.gauss(0, noise)),
            )
            velocity = one.velocity._replace(
                linear_x=one.velocity.linear_x + by.gauss(0, noise),
                angular_z=one.velocity.angular_z + by.gauss(0, noise),
            )
            trace.append(later(one, second, pose=there, velocity=velocity))
            measured.append(velocity)
        ends = velocities[0]
        shown = shown.ahead(scale * ends.linear_x)._replace(yaw=wrapped(shown.yaw + scale * ends.angular_z))
        pose = pose.ahead(ends.linear_x)._replace(yaw=wrapped(pose.yaw + ends.angular_z))
    return trace, measured


@pytest.mark.parametrize(("v", "w"), [(0.7, 0.0), (0.0, 1.5)])
def test_driving_back_makes_up_for_no_scale(v, w):
    assert False in judged(*_to_and_fro(v, w, 1.3)).values()


@pytest.mark.parametrize(("v", "w"), [(0.7, 0.0), (0.0, 1.5)])
@pytest.mark.parametrize("noise", [0.0, 0.02, 0.05])
def test_noise_on_the_way_there_at_rest_and_back_fails_nobody(v, w, noise):
    assert False not in judged(*_to_and_fro(v, w, 1.0, noise), Noise(noise, noise, noise, noise)).values()


@pytest.mark.parametrize(("v", "w"), [(0.7, 0.0), (0.0, 1.5)])
def test_what_readings_far_apart_do_not_show_is_held_against_nobody(v, w):
    # Over a slow link: the velocity had ended in between for half of the time, there and back.
    trace, measured = _to_and_fro(v, w, 0.5)
    assert False not in judged(trace[::20], measured[::20]).values()
