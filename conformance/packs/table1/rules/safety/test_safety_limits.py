"""Velocities that the robot must not take."""

from collections.abc import Iterator
from typing import Final

import pytest

from conformance.observe.polling import poll_for
from conformance.packs.table1.robot.drive import Drive
from conformance.packs.table1.robot.robot import LINEAR, STILL, VELOCITY, Robot, Velocity
from conformance.packs.table1.robot.standstill import Standstill
from conformance.verdict.effort import Effort
from conformance.verdict.evidence import Judge

pytestmark = [pytest.mark.phase("standstill"), pytest.mark.needs("rest"), pytest.mark.motion]
# No robot of this contract is as fast, whatever its statement leaves out: m/s and rad/s.
_BEYOND_ANY: Final = 1e3
_FARTHER: Final = (1e6, 1e308)
_KEEPS: Final = "safety/refused-keeps"
_EXPECTED: Final = "rest after refused velocities"


def _only(component: int, value: float) -> Velocity:
    return Velocity(*(value if index == component else 0.0 for index in range(6)))


def _beyond(robot: Robot) -> Iterator[Velocity]:
    """Velocities with one component just beyond its limit, far beyond it, and absurd, in both directions."""
    for component in range(6):
        if not robot.actuated(component):
            continue
        limit = robot.limit_of(component)
        sizes = [1.001 * limit, 1.5 * limit, _BEYOND_ANY] if robot.limit_declared(component) else [_BEYOND_ANY]
        for size in (*sizes, *_FARTHER):
            yield from (_only(component, size), _only(component, -size))


@pytest.mark.requirement("safety/limits-refused", "safety/unactuated-refused", _KEEPS, "safety/limits-hold")
def test_what_is_not_to_be_taken(robot: Robot, effort: Effort, standstill: Standstill) -> None:
    """What is beyond the limits or not to be actuated is refused, on both resources, and the robot stays at rest."""
    _try(robot, effort)
    standstill.expect(_KEEPS, _EXPECTED, lambda: _try_again(robot, effort), seconds=robot.limits.settle_s)


def _try_again(robot: Robot, effort: Effort) -> None:
    """The same, and a watch of what follows."""
    _try(robot, effort)
    _judge_rest(robot, robot.judge, _KEEPS)


def _try(robot: Robot, effort: Effort) -> None:
    judge = robot.judge
    for bad in effort.subsample(list(_beyond(robot)), 8):
        _judge_refused(robot, judge, bad)
    if not robot.limits_declared:
        # What is seen of a component that the statement leaves out says nothing of limits.
        _judge_rest(robot, judge, _KEEPS, "safety/limits-hold")
    components = [component for component in range(6) if not robot.actuated(component)]
    if not components:
        judge.unclaimed("safety/unactuated-refused", "the statement says that the robot actuates all components")
    for component in components:
        _judge_component(robot, judge, component)


def _judge_refused(robot: Robot, judge: Judge, bad: Velocity) -> None:
    exchanges = [robot.put_velocity(bad)]
    if any(bad[:3]):
        exchanges.append(robot.put_linear(bad))
    for exchange in exchanges:
        status = exchange.response.status
        refused = judge.check(
            "safety/limits-refused",
            400 <= status < 500,
            exchange,
            f"422 (another 4xx conforms) for a velocity beyond the limits, {bad}",
            cause=exchange.came,
        )
        if not refused:
            robot.put_velocity(STILL)
    # A robot that takes what it cannot do sends the velocity to where it is commanded; one look at it on the way, and
    # several where that one says so.
    velocity, exchange = robot.velocity()
    still: bool | None = velocity is None or robot.near(velocity, STILL, 2)
    found = ""
    if not still:
        still, found = Drive(robot).sees(STILL, 2)
    judge.check(
        _KEEPS, still is not False, exchange, "rest after a velocity that was refused", found=found, cause="moves"
    )


def _judge_rest(robot: Robot, judge: Judge, *ids: str) -> None:
    """Nothing of what was refused shows in the settle time, by which a robot that took it would move."""
    drive = Drive(robot)
    for _ in poll_for(robot.clock, 0.0, robot.limits.settle_s):
        still, found = drive.sees(STILL, 2)
        if still is False:
            break
    exchange = drive.trace.turns[-1].velocity_exchange
    for id_ in ids:
        judge.check(id_, still is not False, exchange, _EXPECTED, found=found, cause="moves")


def _judge_component(robot: Robot, judge: Judge, component: int) -> None:
    for value in (0.1, -0.1, 1e-3, _BEYOND_ANY):
        wanted = _only(component, value)
        exchanges = [(VELOCITY, robot.put_velocity(wanted))]
        if component < 3:
            exchanges.append((LINEAR, robot.put_linear(wanted)))
        for path, exchange in exchanges:
            status = exchange.response.status
            refused = 400 <= status < 500
            does = not refused and abs(value) == 0.1 and _does(robot, wanted)
            judge.check(
                "safety/unactuated-refused",
                refused or does,
                exchange,
                f"422 (another 4xx conforms) for {wanted}, which the robot cannot actuate",
                cause=f"{path} {exchange.came}",
            )
            if does:
                judge.note("safety/unactuated-refused", f"the robot does {wanted}, which its statement leaves out")
                return


def _does(robot: Robot, wanted: Velocity) -> bool:
    """Return whether the robot reaches a velocity that it took, and so can actuate it after all."""
    for _ in poll_for(robot.clock, 0.02, robot.settle_s):
        velocity, _ = robot.velocity()
        if velocity is not None and not robot.near(velocity, STILL, 2) and robot.near(velocity, wanted):
            robot.put_velocity(STILL)
            return True
    return False
