"""What is said of drives that nobody drove: traces made by hand, and no robot."""

import json

import pytest
import toy_messages

from conformance.packs.table1.limits import DeclaredLimits
from conformance.packs.table1.robot.drive_rules import agreement, answer_of, arrival, every_outcome, speed
from conformance.packs.table1.robot.drive_trace import Command, Reach, Trace, Turn
from conformance.packs.table1.robot.geometry import Pose
from conformance.packs.table1.robot.robot import STILL, Odometry, Velocity
from conformance.transport.exchange import Exchange

_AHEAD = Velocity(linear_x=0.3, angular_z=0.5)
_LIMITS = DeclaredLimits(settle_s=1.0, tolerance=0.05, tolerance_abs=0.02).resolve()


def exchange(status: int = 200, value: object = None) -> Exchange:
    body = b"" if value is None else json.dumps(value).encode()
    return toy_messages.exchange(status, body, "PUT")


def command(velocity: Velocity = _AHEAD, at: float = 0.0, **how) -> Command:
    return Command(velocity, at, at + 0.01, how.pop("exchange", exchange(204)), **how)


def turn(at: float, odometry: Velocity | None, velocity: Velocity | None, linear: Velocity | None) -> Turn:
    read = None if odometry is None else Odometry(at, at + 0.001, at, Pose(0.0, 0.0, 0.0), odometry, exchange())
    return Turn(read, at + 0.002, velocity, exchange(), linear, exchange())


def driven(velocity: Velocity | None = _AHEAD, linear: Velocity | None = None, turns: int = 40, odd: int = 20) -> Trace:
    """Four fifths of a second of going ahead, with what two resources say of it in the last turns, so many."""
    trace = Trace(0.0).with_command(command())
    straight = Velocity(*_AHEAD[:3])
    for index in range(turns):
        is_odd = index >= turns - odd
        trace = trace.with_look(
            turn(0.02 * index, _AHEAD, velocity if is_odd else _AHEAD, linear if is_odd and linear else straight)
        )
    return trace


def refuted(trace: Trace) -> set[str]:
    return {id_.split("/")[1] for id_, one in agreement(trace, _LIMITS) if not one.holds}


def test_readings_that_agree_are_judged_and_hold():
    assert [one.holds for _, one in agreement(driven(), _LIMITS)] == [True, True]


def test_where_answers_take_long_three_turns_without_a_command_are_judged():
    trace, straight = Trace(0.0).with_command(command()), Velocity(*_AHEAD[:3])
    for index in range(3):
        assert list(agreement(trace, _LIMITS)) == []
        trace = trace.with_look(turn(0.1 + 0.2 * index, _AHEAD, _AHEAD, straight))
    assert [one.holds for _, one in agreement(trace, _LIMITS)] == [True, True]
    assert list(agreement(trace.with_command(command(at=0.2)), _LIMITS)) == []


def test_a_robot_that_moves_between_two_readings_is_not_judged_by_what_else_was_read():
    trace, straight = Trace(0.0), Velocity(*_AHEAD[:3])
    for index, turning in enumerate((0.5, 0.9, 0.9)):
        trace = trace.with_look(turn(0.2 * index, _AHEAD, _AHEAD._replace(angular_z=turning), straight))
    assert list(agreement(trace, _LIMITS)) == []


@pytest.mark.parametrize(
    ("velocity", "linear", "found"),
    [
        (Velocity(linear_x=0.3), None, {"velocity-odometry"}),
        (_AHEAD, Velocity(linear_x=0.5), {"linear-agrees"}),
        (STILL, None, {"velocity-odometry", "linear-agrees"}),
        (None, Velocity(linear_x=9.0), set()),
    ],
)
def test_readings_that_differ_are_refuted(velocity, linear, found):
    assert refuted(driven(velocity, linear)) == found


def test_one_reading_that_differs_refutes_nothing():
    assert refuted(driven(STILL, Velocity(linear_x=9.0), odd=1)) == set()


@pytest.mark.parametrize(
    "trace",
    [
        Trace(0.0),
        driven(STILL, turns=8),
        driven(STILL).with_command(command(at=0.79)).with_look(turn(0.8, _AHEAD, _AHEAD, None)),
        driven(STILL).with_look(turn(0.8, STILL, _AHEAD, None)),
        driven(STILL).with_look(turn(0.8, None, _AHEAD, None)),
    ],
    ids=["nothing", "too short", "a command between", "not steady", "no odometry after it"],
)
def test_what_cannot_be_compared_is_not_judged(trace):
    assert refuted(trace) == set()


@pytest.mark.parametrize(
    ("answer", "problem"),
    [
        (exchange(204), ""),
        (exchange(200, _AHEAD.twist), ""),
        (exchange(200, {"linear": {"x": 0.3, "y": 0, "z": 0}}), "angular is missing"),
        (exchange(200, _AHEAD._replace(angular_z=0.4).twist), "angular z 0.4 for 0.5"),
        (exchange(201), "status 201"),
        (exchange(200), "not JSON"),
    ],
)
def test_the_answer_to_a_command(answer, problem):
    said = answer_of(command(exchange=answer))
    assert said.holds == (not problem)
    assert problem in said.observed


def test_each_way_to_command_has_a_requirement_of_its_own():
    linear = command(exchange=exchange(200, _AHEAD.linear), linear_only=True)
    trace = Trace(0.0).with_command(command()).with_command(linear).with_command(command(integers=True))
    judged = [(id_.split("/")[1], one.holds) for id_, one in every_outcome(trace, _LIMITS, way=False)]
    assert judged == [("velocity-put", True), ("linear-put", True), ("velocity-integers", True)]


def seen(*velocities: Velocity | None) -> Trace:
    """One turn for each velocity, each of a sample of its own."""
    trace = Trace(0.0)
    for index, velocity in enumerate(velocities):
        trace = trace.with_look(turn(0.1 * index, _AHEAD, velocity, None))
    return trace


def test_a_velocity_is_reached_within_the_tolerance_in_the_parts_that_count():
    def reached(wanted: Velocity, part: slice = slice(None)) -> bool:
        reach = Reach(("safety/stop",), wanted, part, 0.0, len(trace.turns), there=False)
        return arrival(trace, reach, _LIMITS).holds

    trace = seen(*[_AHEAD._replace(linear_x=0.31)] * 3)
    assert reached(_AHEAD)
    assert not reached(_AHEAD._replace(angular_z=0.0))
    assert reached(_AHEAD._replace(angular_z=0.0), slice(0, 3))
    assert not reached(STILL)
    trace = seen(STILL, _AHEAD, _AHEAD)
    assert reached(_AHEAD)
    trace = seen(None)
    assert not reached(_AHEAD)
    assert trace.measured == (_AHEAD,)


def test_a_robot_is_not_faster_than_it_was_ever_asked_to_be():
    assert speed(seen(_AHEAD, _AHEAD, _AHEAD)) is None
    fast = _AHEAD._replace(linear_x=-0.7)
    for velocities, holds in (((_AHEAD,) * 3, True), ((fast,) * 3, False), ((_AHEAD, fast, _AHEAD), True)):
        assert speed(seen(*velocities).with_command(command()).with_command(command(STILL, at=1.0))).holds is holds


def test_times_of_commands():
    trace = Trace(5.0)
    assert (trace.last_sent_s, trace.full_sent, trace.last_answered_s) == (5.0, 5.0, 5.0)
    trace = trace.with_command(command(at=6.0)).with_command(command(at=7.0, linear_only=True))
    assert (trace.last_sent_s, trace.full_sent, trace.last_answered_s) == (7.0, 6.0, 7.01)
    trace = trace.with_command(command(at=8.0, linear_only=True, renewal=True))
    assert (trace.last_sent_s, trace.full_sent, trace.last_answered_s) == (8.0, 6.0, 7.01)


def sped_up(linear) -> Trace:
    """A second of speeding up, with what the linear velocity is at each of its steps."""
    trace = Trace(0.0).with_command(command())
    for step in range(20):
        velocity = Velocity(linear_x=0.03 * step)
        trace = trace.with_look(turn(0.02 * step, velocity, velocity, Velocity(linear_x=linear(step))))
    return trace


@pytest.mark.parametrize(
    ("linear", "differs"),
    [
        (lambda step: 0.03 * step + 0.01, False),
        (lambda step: 0.03 * (step + 1.5), False),  # from a newer sample
        (lambda step: max(0.0, 0.03 * (step - 1)), False),  # from an older one
        (lambda step: 0.57 if step % 4 else 0.03 * step, False),  # never several in a row
        (lambda _: 0.57, True),  # what was commanded
        (lambda _: 0.0, True),
    ],
)
def test_the_linear_velocity_changes_with_the_velocity(linear, differs):
    found = [one for id_, one in every_outcome(sped_up(linear), _LIMITS, way=False) if id_.endswith("linear-agrees")]
    assert [one.cause for one in found if not one.holds] == ["does not change with the velocity"] * differs
