"""Windows over made records: one sample that is out fails nobody, and an error of a tenth fails everybody."""

import math
import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from toy_messages import exchange

from conformance.packs.table1.limits import DeclaredLimits, Limits, Noise
from conformance.packs.table1.robot import drive_trace
from conformance.packs.table1.robot.drive_rules import way_and_turn
from conformance.packs.table1.robot.drive_trace import Turn
from conformance.packs.table1.robot.geometry import Pose, wrapped
from conformance.packs.table1.robot.robot import STILL, Odometry, Velocity

_EXCHANGE = exchange()
_NOISE = Noise(position_m=0.005, heading_rad=0.005, linear_m_s=0.01, angular_rad_s=0.02)
_LIMITS = DeclaredLimits(
    linear_m_s=0.7, angular_rad_s=2.5, settle_s=0.6, hold_s=1.0, tolerance=0.05, tolerance_abs=0.01, noise=_NOISE
).resolve()
_FAST = Velocity(linear_x=0.7, angular_z=-2.5)
_ENOUGH = 9
rates = st.sampled_from((5, 10, 20, 50))
outliers = st.floats(-1e3, 1e3)
seeds = st.integers(0, 10_000)
few = settings(max_examples=20)


def turn(at: float, stamp: float, velocity: Velocity | None) -> Turn:
    read = None if velocity is None else Odometry(at, at + 0.001, stamp, Pose(0.0, 0.0, 0.0), velocity, _EXCHANGE)
    return Turn(read, at, velocity, _EXCHANGE, None, _EXCHANGE)


def noisy(velocity: Velocity, by: random.Random) -> Velocity:
    return velocity._replace(
        linear_x=velocity.linear_x + by.gauss(0, _NOISE.linear_m_s / 2),
        angular_z=velocity.angular_z + by.gauss(0, _NOISE.angular_rad_s / 2),
    )


def watched(true: list[Velocity], hz: float, seed: int | None = None) -> list[Turn]:
    """What is read every 20 ms of a robot that moves so and has an odometry so often."""
    found, sample, measured = [], -1, STILL
    by = None if seed is None else random.Random(seed)  # noqa: S311 - no secret
    for index, velocity in enumerate(true):
        at = 0.02 * index
        if int(at * hz + 1e-9) != sample:
            sample = int(at * hz + 1e-9)
            measured = noisy(velocity, by) if by else velocity
        found.append(turn(at, sample / hz, measured))
    return found


def shown(turns: list[Turn], wanted: Velocity, limits: Limits = _LIMITS) -> bool | None:
    return drive_trace.is_shown(limits, turns, wanted, count=_ENOUGH)


@given(rates, seeds)
def test_what_a_robot_does_is_seen_through_its_noise(hz, seed):
    assert shown(watched([_FAST] * 120, hz, seed), _FAST)


@given(rates, seeds, st.sampled_from((0.9, 1.1)))
def test_an_error_of_a_tenth_is_seen_through_any_noise(hz, seed, factor):
    assert shown(watched([Velocity(*(factor * value for value in _FAST))] * 120, hz, seed), _FAST) is False


@given(rates, outliers, st.integers(1, 40))
def test_one_sample_that_is_out_fails_nobody(hz, out, back):
    turns = watched([_FAST] * 200, hz)
    stamp = turns[-back].odometry.stamp
    bad = Velocity(linear_x=out, angular_z=out)
    seen = [turn(one.at, stamp, bad) if one.odometry.stamp == stamp else one for one in turns]
    assert drive_trace.is_shown(_LIMITS, seen, _FAST)
    assert drive_trace.verdict(_LIMITS, seen, _FAST)


@pytest.mark.parametrize("hz", [5, 50])
def test_one_sample_that_fits_saves_nobody_from_the_median(hz):
    turns = watched([STILL] * 100, hz)
    last = turns[-1]
    assert drive_trace.is_shown(_LIMITS, [*turns, turn(last.at + 0.02, last.odometry.stamp + 1, _FAST)], _FAST) is False


def test_samples_are_told_apart_by_their_stamps():
    turns = watched([_FAST] * 50, 10)
    assert [one.odometry.stamp for one in drive_trace.newest(turns)] == pytest.approx([0.7, 0.8, 0.9])
    assert drive_trace.newest(turns)[-1] is turns[-1]
    assert len(drive_trace.newest(turns, 99)) == 10


@pytest.mark.parametrize("readable", [True, False])
def test_without_stamps_that_advance_samples_are_told_apart_by_time(readable):
    turns = [turn(0.1 * index, 7.0, _FAST) for index in range(20)]
    if not readable:
        turns = [Turn(None, one.at, one.velocity, _EXCHANGE, None, _EXCHANGE) for one in turns]
    assert len(drive_trace.newest(turns, 99)) == 7


def test_too_few_samples_say_nothing_but_one_that_fits_does():
    turns = watched([_FAST] * 9, 5)
    assert drive_trace.is_shown(_LIMITS, turns, STILL) is None
    assert drive_trace.verdict(_LIMITS, turns, STILL) is None
    assert drive_trace.verdict(_LIMITS, turns, _FAST) is True
    assert drive_trace.verdict(_LIMITS, [turn(0.0, 0.0, None)], _FAST) is None


def way(factor: float, seed: int, *, jump: int | None = None, hz: float = 10) -> set[str]:
    """What is refuted of an arc of a metre that the pose makes by ``factor`` times what the velocity says."""
    by = random.Random(seed)  # noqa: S311 - no secret
    pose, velocity = Pose(1.0, 2.0, 0.3), Velocity(linear_x=0.4, angular_z=0.8)
    trace, every = [], round(50 / hz)
    for step in range(150):
        pose = Pose(
            pose.x + factor * 0.008 * math.cos(pose.yaw),
            pose.y + factor * 0.008 * math.sin(pose.yaw),
            wrapped(pose.yaw + factor * 0.016),
        )
        if step == jump:
            pose = pose._replace(x=pose.x + 0.5, yaw=wrapped(pose.yaw + 0.5))
        if step % every == 0:
            off = pose._replace(x=pose.x + by.gauss(0, 0.003), y=pose.y + by.gauss(0, 0.003))
            told = Odometry(0.02 * step, 0.02 * step, 0.02 * step, off, noisy(velocity, by), _EXCHANGE)
        trace.append(told)
    way, turned = way_and_turn(trace, [one.velocity for one in trace], _NOISE)
    assert way
    assert turned
    return {name for name, case in (("pose-motion", way), ("pose-rotation", turned)) if not case.holds}


@few
@given(st.integers(0, 10_000), st.sampled_from((5, 10, 50)))
def test_noise_on_the_way_fails_nobody(seed, hz):
    assert way(1.0, seed, hz=hz) == set()


@few
@given(st.integers(0, 10_000), st.integers(5, 145))
def test_one_jump_of_the_localisation_fails_nobody(seed, jump):
    assert way(1.0, seed, jump=jump) == set()


@few
@given(st.integers(0, 10_000), st.sampled_from((0.7, 1.3)))
def test_another_way_than_the_velocity_says_fails_everybody(seed, factor):
    assert way(factor, seed) == {"pose-motion", "pose-rotation"}
