"""Driving a robot by its velocity, and judging what is measured meanwhile: one drive feeds many requirements."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from conformance.robot.message_shapes import TWIST, VECTOR3, read_as
from conformance.robot.path import judge_path
from conformance.robot.robot import STILL, VELOCITY, Velocity

if TYPE_CHECKING:
    from collections.abc import Callable

    from conformance.robot.robot import Odometry, Robot
    from conformance.transport.exchange import Exchange

# A turn of readings is not begun more often than this, s: the robot's odometry has tens of hertz.
_PACE_S: Final = 0.02
# What was measured for so long alike is steady: readings of two resources may be compared, s.
_STEADY_S: Final = 0.3
_ECHO: Final = 1e-9
# How long a velocity is counted on to hold where the statement does not say, s.
_COUNTED_ON_S: Final = 0.5
_BUSY: Final = 409


class BusyError(Exception):
    """The robot follows a goal of its own, and so takes no velocity."""


@dataclass(frozen=True)
class _Reading:
    """One turn's readings of the velocity resources, waiting for the odometry after them."""

    at: float
    velocity: Velocity | None
    velocity_exchange: Exchange
    linear: Velocity | None
    linear_exchange: Exchange


class Drive:
    """One drive.

    Attributes:
        trace: the odometry along the way.
        sent, answered: of the command given last, s of the monotonic clock.
        full_sent: of the last command of all components: the linear part alone need not renew the angular one.
    """

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self.trace: list[Odometry] = []
        self._measured: list[Velocity] = []
        self.sent = self.answered = self.full_sent = time.monotonic()
        self._fastest: Velocity | None = None
        self._renew: Callable[[], object] = lambda: None
        self._of_all = True
        self._pending: _Reading | None = None
        self._turn_at = 0.0

    def command(self, velocity: Velocity, *, integers: bool = False) -> bool:
        """PUT a velocity, and judge how it is answered.

        Args:
            velocity: within the limits.
            integers: write whole numbers without a fraction.

        Raises:
            BusyError: a goal of the robot's own is active.
        """
        self.sent = self.full_sent = time.monotonic()
        self._renew, self._of_all = (lambda: self.robot.put_velocity(velocity)), True
        if integers:
            whole = {part: {axis: int(value) for axis, value in side.items()} for part, side in velocity.twist.items()}
            exchange = self.robot.put(VELOCITY, whole)
        else:
            exchange = self.robot.put_velocity(velocity)
        return self._judge_put(exchange, velocity, "velocity-integers" if integers else "velocity-put")

    def command_linear(self, velocity: Velocity) -> bool:
        """PUT the linear part of a velocity, and judge how it is answered."""
        self.sent = time.monotonic()
        # Renewed as it was given: a PUT of all components would do what this one may have failed to do.
        self._renew, self._of_all = (lambda: self.robot.put_linear(velocity)), False
        return self._judge_put(self.robot.put_linear(velocity), velocity, "linear-put")

    def _judge_put(self, exchange: Exchange, velocity: Velocity, name: str) -> bool:
        self.answered = time.monotonic()
        answer = exchange.response
        if answer.status == _BUSY and self.robot.goal()[0] is not None:
            raise BusyError("the robot follows a goal of its own")
        fastest = self._fastest or Velocity()
        self._fastest = Velocity(*(max(pair) for pair in zip(fastest, map(abs, velocity), strict=True)))
        kind, shape = ("Vector3", VECTOR3) if name == "linear-put" else ("Twist", TWIST)
        expected = f"200 with the accepted {kind}, or 204"
        problem = ""
        if answer.status not in {200, 204}:
            problem = exchange.came
        elif answer.status == 200:  # noqa: PLR2004 - with content
            value, problem = read_as(answer, shape)
            if not problem:
                given = value if name == "linear-put" else value["linear"] | _prefixed(value["angular"])
                asked = (
                    velocity.linear if name == "linear-put" else velocity.linear | _prefixed(velocity.twist["angular"])
                )
                wrong = [axis for axis, number in asked.items() if abs(float(given[axis]) - number) > _ECHO]
                problem = f"{wrong[0]} {given[wrong[0]]} for {asked[wrong[0]]}" if wrong else ""
        return self.robot.judge.check(f"rest-resources/{name}", not problem, exchange, expected, found=problem)

    @property
    def holds_until(self) -> float:
        """Until when the last command of all components certainly holds, s of the monotonic clock."""
        hold_s = self.robot.limits.hold_s
        return self.full_sent + (_COUNTED_ON_S if hold_s is None else 0.9 * hold_s - 0.02)

    def refresh(self, velocity: Velocity) -> None:
        """Command a velocity again, and let it be reached where it had ended meanwhile."""
        self.command(velocity)
        self.reach(velocity)

    def look(self) -> tuple[Velocity | None, Exchange]:
        """Read odometry, velocity and its linear part, and judge whether they agree; give the velocity."""
        wait = self._turn_at + _PACE_S - time.monotonic()
        if wait > 0:
            time.sleep(wait)
        self._turn_at = time.monotonic()
        odometry = self.robot.odometry()
        if odometry is not None:
            self.trace.append(odometry)
            self._judge_pending()
        at = time.monotonic()
        velocity, exchange = self.robot.velocity()
        if odometry is not None:
            self._measured.append(odometry.velocity if velocity is None else velocity)
        linear, linear_exchange = self.robot.linear()
        self._pending = _Reading(at, velocity, exchange, linear, linear_exchange)
        if velocity is not None and self._fastest is not None and not self.robot.limits_declared:
            self._judge_speed(velocity, self._fastest, exchange)
        return velocity, exchange

    def _judge_pending(self) -> None:
        """Compare the last turn's readings with the odometry on both sides of them, where it is steady."""
        reading, self._pending = self._pending, None
        if reading is None:
            return
        around = [one for one in self.trace if one.received > reading.at - _STEADY_S]
        before = next((one for one in reversed(self.trace) if one.received <= reading.at - _STEADY_S), None)
        last = self.trace[-1].velocity
        if before is None or self.sent > reading.at - _STEADY_S:
            return
        if not all(self.robot.near(one.velocity, last, 0.5) for one in (before, *around)):
            return
        judge = self.robot.judge
        if reading.velocity is not None:
            judge.check(
                "rest-resources/velocity-odometry",
                self.robot.near(reading.velocity, last),
                reading.velocity_exchange,
                f"the velocity that the odometry has, {_rounded(last)}",
                found=str(reading.velocity),
                cause="differs",
            )
        if reading.linear is not None and reading.velocity is not None:
            linear = Velocity(*reading.velocity[:3])
            judge.check(
                "rest-resources/linear-agrees",
                self.robot.near(reading.linear, linear),
                reading.linear_exchange,
                f"the linear part of the velocity, {_rounded(linear)}",
                found=str(reading.linear),
                cause="differs",
            )

    def _judge_speed(self, velocity: Velocity, fastest: Velocity, exchange: Exchange) -> None:
        """Without declared limits: the robot is not faster than it was asked to be, however it overshoots."""
        self.robot.judge.check(
            "safety/limits-hold",
            all(abs(one) <= 1.5 * asked + 0.2 for one, asked in zip(velocity, fastest, strict=True)),
            exchange,
            f"a speed that was asked for, at most {_rounded(fastest)}",
            found=str(velocity),
        )

    def stop(self, moving: Velocity) -> bool:
        """Command a velocity once more and then zero; judge that the robot stops because of it, and not by itself."""
        if not self.command(moving) or not self.command(STILL):
            return False
        hold_s, settle_s = self.robot.limits.hold_s, self.robot.limits.settle_s
        within = max(1.1 * settle_s, 0.9 * hold_s) if hold_s is not None else self.robot.settle_s
        return self.reach(STILL, "safety/stop", within=within)

    def reach(self, wanted: Velocity, *ids: str, part: slice = slice(None), within: float | None = None) -> bool:
        """Look until the velocity is what was wanted; judge that it comes within the settle time.

        Args:
            wanted: velocity.
            ids: requirements, of any class.
            part: the components that count.
            within: another time than the settle time, s.
        """
        judge, patience = self.robot.judge, min(self.robot.settle_s, within or self.robot.settle_s)
        # A velocity may end before it is reached, where it does not hold for as long as the robot takes to settle.
        hold_s = self.robot.limits.hold_s
        every = _COUNTED_ON_S if hold_s is None else 0.6 * hold_s
        renewed = self.sent
        while True:
            asked = time.monotonic()
            if asked > renewed + every and (hold_s is None or hold_s < patience):
                self._renew()
                renewed = self.sent = asked
                self.full_sent = asked if self._of_all else self.full_sent
            velocity, exchange = self.look()
            there = velocity is not None and self.robot.near(_part(velocity, part), _part(wanted, part))
            if there or asked > self.answered + patience:
                break
        for id_ in ids:
            judge.check(
                id_,
                there,
                exchange,
                f"{_rounded(wanted)} within {self.robot.limits.settle_s:g} s of the command",
                found=str(velocity) if velocity else exchange.came,
                cause="not reached",
            )
        return there

    def keep(self, seconds: float) -> None:
        """Look for a while."""
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            self.look()

    def judge_motion(self) -> None:
        """Judge whether the pose moved by what the velocity said."""
        judge_path(self.robot.judge, self.trace, self._measured)


def _part(velocity: Velocity, part: slice) -> Velocity:
    chosen = set(range(len(velocity))[part])
    return Velocity(*(value if index in chosen else 0.0 for index, value in enumerate(velocity)))


def _prefixed(angular: dict[str, float]) -> dict[str, float]:
    return {f"angular {axis}": value for axis, value in angular.items()}


def _rounded(velocity: Velocity) -> Velocity:
    return Velocity(*(round(value, 4) for value in velocity))
