"""Rules on stops and watchdogs, by traces made by hand."""

import math
import random
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from toy_messages import exchange

from conformance.packs.table1.limits import DeclaredLimits, Noise
from conformance.packs.table1.robot.drive_rules import Driven
from conformance.packs.table1.robot.drive_trace import Trace, Turn
from conformance.packs.table1.robot.geometry import Pose
from conformance.packs.table1.robot.goal_trace import Cancelled, GoalLife
from conformance.packs.table1.robot.robot import STILL, Odometry, Velocity
from conformance.packs.table1.rules.rest_resources import test_driving as driving
from conformance.packs.table1.rules.safety import test_driving as rules
from conformance.packs.table1.statement import Statement
from conformance.scenarios.motion.trace import Command, Drive, Reading
from conformance.transport.exchange import Exchange
from conformance.verdict.evidence import Case
from conformance.verdict.run import Run

_FAST = Velocity(linear_x=0.3)
_WANTED = {"ahead": 0.7, "turn": -2.5}
rates = st.sampled_from((5, 10, 20, 50))
seeds = st.integers(0, 10_000)
few = settings(max_examples=20)


def _took(seconds: float) -> Exchange:
    answered = exchange(204)
    return replace(answered, response=replace(answered.response, elapsed_ms=1000 * seconds))


def _outcomes(rule, trace):
    noise = Noise(position_m=0.005, heading_rad=0.005, linear_m_s=0.01, angular_rad_s=0.02)
    limits = DeclaredLimits(
        linear_m_s=0.7, angular_rad_s=2.5, settle_s=0.6, hold_s=1.0, tolerance=0.05, tolerance_abs=0.01, noise=noise
    )
    run = Run(statement=Statement(declared=limits))
    return rule.outcomes(trace, {"run": run}.__getitem__)


@pytest.mark.parametrize(
    ("took", "holds"),
    [
        ((), []),
        ((0.01,), [True]),
        ((1.5,), [True]),  # a robot that waits until it is at rest
        ((9.0,), [None]),  # a lost packet
        ((9.0, 0.01), [True]),
        ((9.0, 0.01, 9.0), [False]),
        ((9.0, 9.0, 9.0), [False]),
    ],
)
def test_a_stop_is_answered_in_time(took, holds):
    found = _outcomes(rules.cancel_answered, GoalLife(cancels=tuple(map(_took, took))))
    assert [one.holds if isinstance(one, Case) else None for one in found] == holds


def _let_go(holds: float, hz: float = 50, seed: int | None = None, silent: tuple[float, float] = (2.0, 2.0)) -> Driven:
    """A velocity that was commanded at 0, holds so long and ends within 0.2 s; in a silence nobody reads."""
    by = random.Random(seed) if seed is not None else None  # noqa: S311 - no secret
    readings, sample, speeds = [], -math.inf, dict[str, float]()
    for index in range(-30, 140):
        at = 0.02 * index
        if math.floor(at * hz + 1e-9) != sample:
            sample = math.floor(at * hz + 1e-9)
            left = max(0.0, min(1.0, 1 - (at - holds) / 0.2))
            speeds = {
                name: left * speed + (by.gauss(0, noise / 2) if by else 0.0)
                for (name, speed), noise in zip(_WANTED.items(), (0.01, 0.02), strict=True)
            }
        readings.append(Reading(at, at + 0.001, {}, sample / hz, exchange(), speeds))
    command = Command(0.0, 0.02, _WANTED, exchange(204))
    after = tuple(one for one in readings if one.sent > 0.02 and not silent[0] < one.sent < silent[1])
    return Driven(Trace(0.0), (Drive("it", _WANTED, (command,), tuple(readings[:30]), None, after),))


def _holds(trace: Driven) -> list[bool | None]:
    """Return whether a robot holds its velocity, begins to stop then, and comes to rest."""
    found = (_outcomes(one, trace) for one in (rules.hold, rules.hold_ends, rules.watchdog))
    return [all(one.holds for one in each if isinstance(one, Case)) if each else None for each in found]


@few
@given(rates, st.floats(1.0, 1.15), seeds, st.sampled_from(((2.0, 2.0), (0.95, 1.45))))
def test_a_robot_that_holds_for_its_time_is_not_blamed(hz, holds, seed, silent):
    assert _holds(_let_go(holds, hz, seed, silent)) == [True] * 3


@few
@given(rates, st.floats(0.0, 0.3), seeds)
def test_a_robot_that_does_not_hold_is_seen(hz, holds, seed):
    assert _holds(_let_go(holds, hz, seed)) == [False, True, True]


@few
@given(rates, seeds, st.sampled_from(((2.0, 2.0), (0.95, 1.45))))
def test_a_robot_that_holds_for_far_longer_is_seen(hz, seed, silent):
    assert _holds(_let_go(2.1, hz, seed, silent)) == [True, False, False]


def test_half_as_long_again_is_too_long_where_samples_are_frequent():
    assert _holds(_let_go(1.5))[:2] == [True, False]


def test_a_watchdog_that_fails_once_fails():
    stops, goes_on = _let_go(1.0), _let_go(9.0)
    found = _outcomes(rules.watchdog, Driven(Trace(0.0), (*goes_on.let_go, *stops.let_go)))
    assert [one.holds for one in found] == [False, True]


def test_a_command_that_was_refused_is_judged_by_its_response():
    (drive,) = _let_go(0.0).let_go
    refused = replace(drive, commands=(replace(drive.commands[0], exchange=exchange(422)),))
    assert _holds(Driven(Trace(0.0), (refused,))) == [None] * 3


@pytest.mark.parametrize(
    ("shown", "odometry", "stale"), [(_FAST, STILL, True), (_FAST, _FAST, False), (STILL, STILL, False)]
)
def test_a_velocity_from_before_a_pause_is_stale_if_it_is_so_twice(shown, odometry, stale):
    first, then = (
        Turn(Odometry(0, 0, 0, Pose(0, 0, 0), seen, exchange()), 0, velocity, exchange())
        for seen, velocity in ((odometry, shown), (STILL, STILL))
    )
    paused = ((first, then),) * 2
    assert bool(_outcomes(driving.velocity_after_pause, Driven(Trace(0.0), (), paused))) is stale
    assert not _outcomes(driving.velocity_after_pause, Driven(Trace(0.0), (), paused[:1]))


def test_a_cancel_whose_response_was_late_is_judged_only_where_no_other_was_in_time():
    late, in_time = (Cancelled(exchange(204), exchange(404), gone=True, drive=Trace(0.0), late=one) for one in (1, 0))
    assert rules.judged_cancels(GoalLife(cancelled=(late, in_time))) == (in_time,)
    assert rules.judged_cancels(GoalLife(cancelled=(late, late))) == (late,)
    assert rules.judged_cancels(GoalLife()) == ()
