"""Drive a robot by velocities of the range that it declares, and record a trace; drive_rules judges the trace."""

import math
import random
from collections.abc import Callable, Iterator
from dataclasses import replace
from http import HTTPStatus
from typing import Any, Final

from conformance.measures.samples import SEVERAL
from conformance.packs.table1.robot import drive_rules, drive_trace
from conformance.packs.table1.robot.drive_trace import ALL, COUNTED_ON_S, Command, Reach, Trace, Turn, certain_s
from conformance.packs.table1.robot.motion_map import By
from conformance.packs.table1.robot.robot import (
    ABOUT,
    ACCEPT_JSON,
    AHEAD,
    LINEAR,
    STILL,
    VELOCITY,
    Robot,
    Velocity,
    handiest,
    put_as_xml,
    turn_beside,
)
from conformance.scenarios.scenario import NotPossibleError
from conformance.transport.exchange import Exchange
from conformance.verdict.evidence import Case

# Shortest time between two rounds of readings, s: odometry comes some tens of times per second.
_PACE_S: Final = 0.02
# A velocity with too few samples is read for this much longer, s.
_LONGER_S: Final = 1.0
# Share of the hold time: a round of reads that takes longer makes a renewal late.
_LOOK_SHARE: Final = 0.25
# Requests of one round of reads.
_LOOK: Final = 3
# How often a stop is sent if its response is late.
_STOPS: Final = 3
# How often a velocity is commanded again if its renewal was late.
_LAPSES: Final = 2


class Drive:
    """Sends velocity commands and reads the robot's motion, and records both in one trace.

    Attributes:
        trace: the commands and readings so far.
        aside: called after each look with its number: sends what is compared with the looks.
    """

    def __init__(self, robot: Robot) -> None:
        self.robot, self.clock = robot, robot.clock
        self.trace = Trace(self.clock.now())
        self.aside: Callable[[int], object] = lambda _turn: None
        self._turn_at = 0.0

    def command(
        self,
        velocity: Velocity,
        *,
        linear: bool = False,
        integers: bool = False,
        xml: bool = False,
        fresh: bool = False,
        before: Callable[[], object] = lambda: None,
    ) -> bool:
        """PUT a velocity; return whether the response conforms to the contract.

        Args:
            velocity: a velocity within the robot's limits.
            linear: PUT its linear part alone.
            integers: write whole numbers without a fraction.
            xml: send it as XML, if the robot sends its own as XML and takes it.
            fresh: send it on a connection that is closed afterwards.
            before: called just before the PUT.

        Raises:
            NotPossibleError: the robot pursues a goal, so that it cannot be driven.
        """
        sent = self.clock.now()
        path = LINEAR if linear else VELOCITY
        value: dict[str, Any] = velocity.linear if linear else velocity.twist
        if integers:
            value = {part: {axis: int(one) for axis, one in side.items()} for part, side in velocity.twist.items()}
        exchange = put_as_xml(self.robot, path, value, before=before) if xml else None
        if exchange is None or not exchange.response.ok:
            before()
            exchange = self.robot.put(path, value, fresh=fresh)
        command = Command(velocity, sent, self.clock.now(), exchange, linear_only=linear, integers=integers)
        self.trace = self.trace.with_command(command)
        if exchange.response.status == HTTPStatus.CONFLICT and self.robot.goal()[0] is not None:
            raise NotPossibleError("the robot follows a goal of its own")
        return drive_rules.answer_of(command).holds

    def note_command(self, velocity: Velocity, sent: float, exchange: Exchange) -> None:
        """Record a command that other code sent at the time ``sent`` (s of the run's clock) as the last command."""
        self.trace = self.trace.with_command(Command(velocity, sent, self.clock.now(), exchange))

    def _renew(self) -> None:
        """Send the last command again in the same form, because another form could hide a fault of this one."""
        last = self.trace.last_command
        if last is not None:
            request, sent = last.exchange.request, self.clock.now()
            path = LINEAR if last.linear_only else VELOCITY
            headers = (("Content-Type", request.media_type), *ACCEPT_JSON)
            exchange = self.robot.rest.send("PUT", path, headers=headers, body=request.body)
            again = replace(last, sent=sent, answered=self.clock.now(), exchange=exchange, renewal=True)
            self.trace = self.trace.with_command(again)

    @property
    def holds_until(self) -> float:
        """Return the time until which the robot must hold the last full command, s of the run's clock."""
        return self.trace.full_sent + certain_s(self.robot.limits.hold_s)

    @property
    def look_s(self) -> float:
        """Return how long one look (a GET of each resource that shows the velocity) usually takes, s."""
        return _LOOK * self.robot.usual_s

    @property
    def _outlasts_hold(self) -> bool:
        """Return whether one look takes longer than the robot holds a velocity."""
        hold_s = self.robot.limits.hold_s
        return hold_s is not None and self.look_s > hold_s

    @property
    def looks_long(self) -> bool:
        """Return whether a look takes so long that a renewal after it may be late."""
        hold_s = self.robot.limits.hold_s
        return hold_s is not None and self.look_s > _LOOK_SHARE * hold_s

    def hold(self, velocity: Velocity) -> Callable[[], bool]:
        """Command a velocity; return a function that returns whether the velocity certainly still holds.

        If it has, the robot may have slowed down and sped up again between two reads.
        """
        self.command(velocity)
        if velocity == STILL or not self.looks_long:
            return lambda: True
        return lambda: self.clock.now() <= self.holds_until

    def refresh(self, velocity: Velocity) -> None:
        """Command a velocity again, and wait until the robot reaches it if it had ended in the meantime."""
        self.command(velocity)
        self.reach(velocity)

    def look(self) -> tuple[Velocity | None, Exchange]:
        """GET odometry, velocity and linear velocity; return the velocity and its exchange."""
        wait = self._turn_at + _PACE_S - self.clock.now()
        if wait > 0:
            self.clock.sleep(wait)
        self._turn_at = self.clock.now()
        odometry = self.robot.odometry()
        at = self.clock.now()
        velocity, exchange = self.robot.velocity()
        self.trace = self.trace.with_look(Turn(odometry, at, velocity, exchange, *self.robot.linear()))
        self.aside(len(self.trace.turns))
        return velocity, exchange

    def stop(self, moving: Velocity, by: By = "velocity") -> bool:
        """Renew a velocity, then command zero; return whether the command stops the robot, and not its watchdog.

        The time counts from sending. Where the response is late, the request may have been late on its way as well: so
        again.

        Args:
            moving: the velocity; without an angular part if the linear part alone is commanded.
            by: what commands zero.
        """
        hold_s, settle_s = self.robot.limits.hold_s, self.robot.limits.settle_s
        within = max(1.1 * settle_s, 0.9 * hold_s) if hold_s is not None else self.robot.settle_s
        for _ in range(_STOPS):
            if not self.command(moving):
                return False
            if not self.command(STILL, linear=by == "linear", xml=by == "xml"):
                return False
            last = self.trace.commands[-1]
            if not self.robot.is_late(last.exchange):
                break
        since = self.robot.arrived_by(last.exchange, last.answered)
        return self.reach(STILL, "safety/stop", within=within, since=since)

    def reach(
        self, wanted: Velocity, *ids: str, part: slice = ALL, within: float | None = None, since: float | None = None
    ) -> bool:
        """Look until the robot has the wanted velocity or its time to reach it is over; return whether it has it.

        A velocity that is judged must be shown by the median of several samples; one that is only awaited, by one
        sample.

        Args:
            wanted: the velocity.
            ids: requirements, of any class, that say that the robot must reach it.
            part: the components that count.
            within: time allowed, s; by default the settle time.
            since: start of that time, s of the run's clock; by default the response to the last command.
        """
        limits = self.robot.limits
        patience = min(self.robot.settle_s, within or self.robot.settle_s)
        begun = self.trace.last_answered_s if since is None else since
        first = len(self.trace.turns)
        count = SEVERAL if ids else 1
        lapses = 0
        # Without renewal, a velocity may end before it is reached, if it holds for less than the settle time.
        every = COUNTED_ON_S if limits.hold_s is None else _renewed_s(limits.hold_s, limits.settle_s)
        renews = limits.hold_s is None or limits.hold_s < patience
        while True:
            now = self.clock.now()
            lapsed = limits.hold_s is not None and now > self.trace.last_sent_s + certain_s(limits.hold_s)
            # Do not repeat a command that had no effect within the settle time: that would hide the fault.
            if not lapsed and now > begun + limits.settle_s:
                renews = renews and not drive_trace.is_stuck(self.trace.turns[first:], wanted, part)
            if renews and self.trace.commands and now > self.trace.last_sent_s + every:
                self._renew()
                if lapsed and lapses < _LAPSES:
                    # The suite was late, not the robot, which may have slowed down meanwhile: start again.
                    lapses, first = lapses + 1, len(self.trace.turns)
                    begun = self.trace.commands[-1].answered
            until = begun + patience
            self.look()
            turns = self.trace.turns[first:]
            there = drive_trace.is_shown(limits, turns, wanted, part=part, count=count)
            # Readings from before the suite was held up, while the robot still had time, are not held against it.
            settled = min(until, begun + limits.settle_s + self.robot.sample_s) if within is None else begun
            late = [turn for turn in turns if turn.at >= settled]
            decided = drive_trace.is_shown(limits, late, wanted, part=part, count=count) is not None
            if there or (now > until and decided) or now > until + _LONGER_S:
                break
        counted = settled if not there and drive_trace.newest(late) else begun
        if wanted == STILL:
            # After such a late response, the watchdog may have stopped the robot instead of the command.
            outlasted = bool(there) and within is not None and self.trace.last_answered_s > begun + patience
        else:
            outlasted = not there and (self._outlasts_hold or lapses == _LAPSES)
        reach = Reach(ids, wanted, part, counted, len(self.trace.turns), bool(there), outlasted)
        self.trace = replace(self.trace, reaches=(*self.trace.reaches, reach))
        return bool(there)

    def sees(
        self, wanted: Velocity, factor: float = 1.0, *, part: slice = ALL, until: float = math.inf
    ) -> tuple[bool | None, str]:
        """Look whether the robot has the wanted velocity: once where it has, else until several samples agree.

        Args:
            wanted: the velocity.
            factor: how many times the tolerance is allowed.
            part: the components that count.
            until: after this time a different velocity proves nothing, s of the run's clock.

        Returns:
            Whether the robot has it (None: the readings came too late), and the velocity read.
        """
        first = len(self.trace.turns)
        last = self.clock.now() + _LONGER_S
        while True:
            self.look()
            turns, now = self.trace.turns[first:], self.clock.now()
            holds = drive_trace.verdict(self.robot.limits, turns, wanted, factor, part)
            if not holds and now > until:
                holds = None
            if holds is not None or now > min(until, last):
                seen = drive_trace.velocities(drive_trace.newest(turns))
                return holds, str(drive_trace.middle(seen)) if seen else ""

    def keep(self, seconds: float) -> None:
        """Read pose and velocity repeatedly for the given time, s, without sending commands."""
        until = self.clock.now() + seconds
        while self.clock.now() < until:
            self.look()

    def saw(self, shows: str, expected: str, observed: str = "", cause: str = "", *, holds: bool | None) -> None:
        """Record the last look's evidence on a requirement, as in Case; None if it came too late to decide."""
        if holds is not None:
            self._saw(shows, Case(holds, self.trace.turns[-1].velocity_exchange, expected, observed, cause))

    def note_refusal(self, shows: str, expected: str) -> None:
        """Record that the robot rejected the last command, which a requirement forbids."""
        exchange = self.trace.commands[-1].exchange
        self._saw(shows, Case(holds=False, exchange=exchange, expected=expected, cause=exchange.came))

    def _saw(self, shows: str, seen: Case) -> None:
        self.trace = replace(self.trace, sightings=(*self.trace.sightings, (shows, seen)))

    @property
    def whole(self) -> Trace:
        """Return the trace of a finished drive in which the pose is to be judged as well."""
        return replace(self.trace, outlasted=self._outlasts_hold)


def _renewed_s(hold_s: float, settle_s: float) -> float:
    """Return after how many seconds a velocity that is not reached yet is commanded again.

    Where the robot holds a velocity long enough, this is not before the settle time is over.
    """
    return max(0.6 * hold_s, settle_s + _PACE_S) if settle_s + _PACE_S < 0.75 * hold_s else 0.6 * hold_s


# Share of the assumed figures that a robot may reach where it declares no limits.
_UNDECLARED: Final = 0.6
# Factor on that for a drive, which needs more room than a turn.
_SLOWER: Final = 0.5
# A robot faster than this multiple of tolerance and noise does not rest.
_MOVES: Final = 1.6


def slowest(robot: Robot) -> Velocity:
    """Return a velocity ahead and to the left that just differs from rest, at most half of the limits."""
    return robot.drivable(Velocity(linear_x=_slowest(robot, AHEAD), angular_z=_slowest(robot, ABOUT)))


def slowest_along(robot: Robot, component: int) -> Velocity:
    """Return a velocity in one component that just differs from rest, at most half of its limit."""
    return robot.only(component, _slowest(robot, component))


def _slowest(robot: Robot, component: int) -> float:
    return min(_MOVES * robot.limits.rest(component), 0.5 * fastest(robot, component))


def fastest(robot: Robot, component: int, sign: int = 1) -> float:
    """Return the extreme velocity that the suite commands in one component and direction, m/s or rad/s.

    It is 0 where the robot does not move in that direction.
    """
    least, greatest = robot.limits.range_of(component)
    return (greatest if sign > 0 else least) * (1.0 if robot.limit_declared(component) else _UNDECLARED)


def handy(robot: Robot, share: float) -> Velocity:
    """Return a velocity by which a robot moves with little room: a share of the limit of turning, or else of driving.

    A robot that cannot turn without driving turns in its narrowest circle.
    """
    component = handiest(robot.statement.motion)
    part = 1.0 if component >= len("xyz") else _SLOWER
    return robot.only(component, part * robot.share(component, share))


def both(robot: Robot) -> Velocity:
    """Return the fastest left turn during the fastest drive, if the statement declares how both depend."""
    return robot.drivable(Velocity(linear_x=fastest(robot, AHEAD, direction(robot)), angular_z=fastest(robot, ABOUT)))


def along_arc(robot: Robot, turning: Velocity, share: float) -> tuple[Velocity, Velocity]:
    """Return a turn along an arc, and a second linear part that allows the same turn.

    The robot drives back and then ahead, unless it hardly drives back: then it drives ahead at two speeds. ``share``:
    of the limit, how fast it drives.
    """
    limits, motion = robot.limits, robot.statement.motion
    least, greatest = limits.range_of(AHEAD)
    aside, other = (-share, share) if -least >= greatest / 2 else (share, share / 2)
    parts = [robot.share_of_limits(number, 0.0).linear_x for number in (aside, other)]
    turn = turning.angular_z
    for part in parts:
        turn = turn_beside(limits, motion, part, turn)
    return Velocity(linear_x=parts[0], angular_z=turn), Velocity(linear_x=parts[1])


def reach(drive: Drive, velocity: Velocity, *ids: str) -> bool:
    """Command a velocity in the declared range; return whether the robot accepts and reaches it.

    ``ids`` are the requirements that say so; by default those on every velocity that the robot can drive.
    """
    if not drive.command(velocity):
        expected = f"2xx for {velocity}, which is within the declared limits"
        drive.note_refusal(ids[0] if ids else "rest-resources/velocity-range", expected)
        return False
    return drive.reach(velocity, *(ids or ("rest-resources/velocity-converges", "rest-resources/velocity-range")))


def there_and_back(drive: Drive, changes: int) -> Iterator[tuple[int, Velocity]]:
    """Yield the number of each change and a velocity that the robot has: along an arc, then rest, and back."""
    robot = drive.robot
    for change in range(changes):
        arc = robot.share_of_limits(0.3, -0.4)
        moving = robot.drivable(Velocity(*(-part if change % 2 else part for part in arc)))
        for wanted in (moving, STILL):
            drive.command(wanted)
            drive.reach(wanted)
            yield change, wanted


def direction(robot: Robot) -> int:
    """Return 1 (ahead) where the arena has room ahead or the robot has no reverse gear, else -1 (back)."""
    pose = robot.map_pose()
    return 1 if pose is None or not robot.reverses or robot.in_arena(pose.ahead(robot.limits.linear_m_s)) else -1


_SLOW: Final = 0.1  # slow velocity, as a share of its limit
_TOLD: Final = 4  # a velocity is seen if it is this many times the greatest one that counts as rest
_MOST: Final = 0.6  # greatest velocity of a drive, as a share of its limit


def unrenewed_velocities(
    bent: Velocity, ahead: Velocity, across: Velocity, others: tuple[Velocity, ...], effort: str, seed: int
) -> list[tuple[Velocity, By]]:
    """Return velocities to send without renewal, and how each is commanded last.

    A robot may keep a watchdog for each path, for each sign, for each part, and for small or large velocities. At the
    effort "quick" the seed says which one is tried.

    Args:
        bent: a velocity along an arc.
        ahead: its opposite, or as much of it as the robot can drive.
        across: the same to the other side.
        others: velocities of another size or with one part alone; the first one's connection is closed.
        effort: quick, standard or deep.
        seed: the seed of the run.
    """
    ways: list[tuple[Velocity, By]] = [
        (bent, "linear" if bent.linear_x else "velocity"),
        (bent, "velocity"),
        (ahead, "linear" if ahead.linear_x else "velocity"),
        *((one, "velocity" if number else "closing") for number, one in enumerate(others)),
        (across, "velocity"),
        (ahead, "xml"),
    ]
    if effort == "deep" or not any(velocity.linear_x * ahead.linear_x > 0 for velocity in others):
        ways.append((ahead, "velocity"))
    ways = [way for way in dict.fromkeys(ways) if any(way[0])]
    if effort == "quick":
        return random.Random(f"{seed}/ways").sample(ways, min(1, len(ways)))  # noqa: S311 - no secret
    return ways


def slow(robot: Robot, seed: int) -> list[Velocity]:
    """Return a slow drive and a slow turn that differ from rest, in directions that the seed chooses."""
    limits, chance = robot.limits, random.Random(f"{seed}/slow")  # noqa: S311 - no secret
    found: list[Velocity] = []
    for component in (AHEAD, ABOUT):
        end = chance.choice([number for number in limits.range_of(component) if number] or [0.0])
        size = min(max(_SLOW * abs(end), _TOLD * limits.rest(component)), _MOST * abs(end))
        found.append(robot.only(component, math.copysign(size, end)))
    return found
