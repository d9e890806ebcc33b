"""Drives: straight ahead and back, turning, along an arc, renewed also after rejected commands, and not renewed."""

import random
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Final

from conformance.api.soap.callable_services import SoapServices
from conformance.api.soap.service import SoapService
from conformance.packs.table1.robot.drive import (
    Drive,
    along_arc,
    both,
    direction,
    fastest,
    handy,
    reach,
    slow,
    slowest,
    slowest_along,
    unrenewed_velocities,
)
from conformance.packs.table1.robot.drive_rules import Driven, longer_s
from conformance.packs.table1.robot.drive_trace import ANGULAR_PART, JUDGED, LINEAR_PART, Turn, certain_s
from conformance.packs.table1.robot.goal import make_room
from conformance.packs.table1.robot.motion_map import COMMANDS, By, speeds_of, way_of
from conformance.packs.table1.robot.refused_requests import (
    Refused,
    RefusedRequests,
    is_refused,
    no_commands,
    refuse_goal,
    send_known,
)
from conformance.packs.table1.robot.robot import ABOUT, AHEAD, STILL, Robot, Velocity
from conformance.packs.table1.robot.soap_services import ask
from conformance.rules.motion.test_velocities import fails, judge_hold
from conformance.scenarios.motion import trace as generic
from conformance.scenarios.motion.mapped import MappedDevice
from conformance.scenarios.motion.trace import Command
from conformance.scenarios.motion.velocities import SILENT, Part, left_alone
from conformance.scenarios.scenario import NotPossibleError, partial_trace, scenario
from conformance.scenarios.stage import Need, Stage
from conformance.transport.exchange import Exchange
from conformance.verdict.run import Run

_WAYS: Final[tuple[By, ...]] = ("velocity", "linear", "xml")


@scenario(needs={Need.REST, Need.MOTION})
def straight(robot: Robot, run: Run) -> Driven:
    """Drive ahead for less than a second, back to the start, and stop."""
    if not robot.can_move(0):
        raise NotPossibleError("the statement says that the robot cannot drive straight ahead")
    make_room(robot)
    drive = Drive(robot)
    with partial_trace(lambda: Driven(drive.whole)):
        _play(robot, drive, run)
    return Driven(drive.whole)


def _play(robot: Robot, drive: Drive, run: Run) -> None:
    drive.look()
    reach(drive, slowest(robot))
    sign = direction(robot)
    ahead = Velocity(linear_x=fastest(robot, AHEAD, sign))
    reached = reach(drive, ahead)
    drive.keep(0.2 if reached else 0.0)
    back = Velocity(linear_x=fastest(robot, AHEAD, -sign))
    if not any(back):
        # a robot without a reverse gear stops where it is
        back = ahead
    elif reached := reach(drive, back):
        drive.keep(0.2)
    # Forth and back with each path that commands a velocity; at quick, the seed chooses one.
    ways = [random.Random(f"{run.seed}/stop").choice(_WAYS)] if run.effort.name == "quick" else _WAYS  # noqa: S311
    for by in ways if reached else ():
        if by != ways[0]:
            back = Velocity(*(-part for part in back))
            drive.refresh(back)
        if not drive.stop(back, by) or not robot.reverses:
            return


# Share of the hold time after which a command is repeated.
_AGAIN: Final = 0.25
# Share of the hold time in which requests that command nothing are sent, at its beginning and just before its end.
_MEANWHILE: Final = 0.08
# Pause after the last velocity of longer runs, s: the robot must not return an older state then.
_PAUSE_S: Final = 1.1
# Multiple of the hold time for which a linear part is renewed.
_RENEWED: Final = 1.4
# How often the suite measures how long a velocity holds beside requests that the robot accepted after it had refused
# them.
_ATTEMPTS: Final = 3
# Velocities beyond any limit, or in a direction without a drive.
_BAD: Final = (Velocity(linear_x=-1e3), Velocity(linear_x=1e308, angular_z=-1e308), Velocity(angular_z=1e4))
_SHOWS_S: Final = 0.2  # time in which a robot that drops its angular velocity shows that, s
_TRIES: Final = 3  # tries of a late observation
# The only whole number of rad/s below most robots' limits.
_WHOLE: Final = 1.0
# Share of the limit at which the robot drives along an arc.
_ASIDE: Final = 0.3
_BESIDE: Final = 4  # every fourth look also reads the state over SOAP, if that takes less than _QUICK_S
_QUICK_S: Final = 0.02
_STATES: Final = ("GetPose", "GetVelocity")


@scenario(needs={Need.REST, Need.MOTION}, stage=Stage.LATE)
def turn(robot: Robot, mapped_robot: MappedDevice, run: Run, soap: SoapServices, refused: RefusedRequests) -> Driven:
    """Turn for about two seconds, in several ways; then let velocities end by themselves.

    Meanwhile requests are sent that were refused in the run or only read. A robot that cannot turn on the spot turns in
    its narrowest circle; one that cannot turn at all drives.
    """
    make_room(robot)
    turning = _Turning(robot, mapped_robot, Drive(robot), no_commands(robot, soap, str(run.seed)))
    if soap.subscribers is not None and robot.usual_s <= _QUICK_S:
        turning.drive.aside = partial(turning.read_over_soap, soap.subscribers)
    with partial_trace(lambda: turning.record):
        turning.play()
        turning.drive.aside = lambda _turn: None
        send_known(robot, soap, refused)
        turning.refused = deque(refused.choose(soap.there.values(), run.effort))
        turning.play_letting_go(run)
    return turning.record


@scenario(needs={Need.REST, Need.MOTION})
def further_axes(robot: Robot, mapped_robot: MappedDevice, run: Run, soap: SoapServices) -> Driven:
    """Drive along each axis that a robot on two wheels lacks, if this robot has any."""
    further = [axis for axis in range(len(STILL)) if axis not in {AHEAD, ABOUT} and robot.can_move(axis)]
    driving = _Turning(robot, mapped_robot, Drive(robot), no_commands(robot, soap, str(run.seed)))
    if further:
        make_room(robot)
    with partial_trace(lambda: driving.record):
        for axis in further:
            driving.along(axis)
    return driving.record


@dataclass
class _Turning:
    """One play of a scenario.

    Requests that must not renew a velocity are ``idle``; those in ``refused`` were refused before.
    """

    robot: Robot
    mapped: MappedDevice
    drive: Drive
    idle: list[Callable[[], object]] = field(default_factory=list)
    refused: deque[Refused] = field(default_factory=deque)
    drives: list[generic.Drive] = field(default_factory=list)
    paused: list[tuple[Turn, Turn]] = field(default_factory=list)
    over_soap: list[Exchange] = field(default_factory=list)
    fastest: Velocity = STILL  # the fastest turn to the left that the robot has reached
    pause_s: float = 0.0  # least silence after a hold time, s
    seen: int | None = None  # readings of the odometry before the first velocity without a stop
    taken: Command | None = None  # a request that the robot accepted although it had refused it before

    @property
    def record(self) -> Driven:
        """Return the record so far."""
        # Poses after the first velocity without a stop belong to no single drive.
        whole, end = self.drive.whole, self.seen
        drive = replace(whole, odometry=whole.odometry[:end], measured=whole.measured[:end])
        recorded = Driven(drive, tuple(self.drives), tuple(self.paused))
        return replace(recorded, over_soap=tuple(self.over_soap))

    def read_over_soap(self, subscribers: SoapService, turn: int) -> None:
        """Read the state over SOAP during some looks, to compare it with the odometry at every heading."""
        if turn % _BESIDE == 0:
            self.over_soap.append(ask(subscribers, _STATES[turn // _BESIDE % len(_STATES)]))

    def play(self) -> None:
        """Turn left by whole numbers, as fast as the robot can, renewed, and along an arc."""
        robot, drive = self.robot, self.drive
        drive.look()
        left = robot.only(ABOUT, _WHOLE if fastest(robot, ABOUT) > 1.1 * _WHOLE else 0.0)
        if not all(map(float.is_integer, left)):
            left = STILL  # a robot that turns only in circles drives at no whole number
        if drive.command(left, integers=True):
            drive.reach(left, "rest-resources/velocity-integers", "rest-resources/velocity-converges")
        if left == STILL:
            left = handy(robot, 0.6)
            drive.command(left)
            drive.reach(left, "rest-resources/velocity-converges")
        if robot.can_move(ABOUT):
            self._fast()
        bent = robot.drivable(Velocity(*(-part for part in left)))
        if robot.can_move(AHEAD) and robot.can_move(ABOUT):
            # A small circle: both parts have to end. The linear part is commanded last, and ends too.
            bent, before = along_arc(robot, bent, _ASIDE)
            _arc(robot, drive, bent, before)
            drive.stop(bent)

    def play_letting_go(self, run: Run) -> None:
        """Drive along an arc, and let several velocities end by themselves; then drive straight on."""
        robot = self.robot
        make_room(robot)
        fast = both(robot) if robot.statement.motion.wheel_separation_m is not None else STILL
        self.fastest = fast if any(fast) or not robot.can_move(ABOUT) else robot.only(ABOUT, fastest(robot, ABOUT))
        bent = robot.drivable(Velocity(*(-part for part in handy(robot, 0.6))))
        if robot.can_move(AHEAD) and robot.can_move(ABOUT):
            bent, _ = along_arc(robot, bent, _ASIDE)
        ways = self._choose_unrenewed(bent, run)
        for number, (velocity, by) in enumerate(ways, 1):
            self.pause_s = _PAUSE_S if number == len(ways) and run.effort.name != "quick" else 0.0
            self.let_go(velocity, by)
        if robot.can_move(AHEAD) and robot.can_move(ABOUT):
            self._ahead_from_rest(renewed=run.effort.name != "quick")

    def _choose_unrenewed(self, bent: Velocity, run: Run) -> list[tuple[Velocity, By]]:
        """Return the velocities that are sent without renewal."""
        robot = self.robot
        ahead = robot.drivable(Velocity(*(-number for number in bent)))
        across = robot.drivable(ahead._replace(angular_z=-ahead.angular_z))
        return unrenewed_velocities(
            bent, ahead, across, (*slow(robot, run.seed), self.fastest), run.effort.name, run.seed
        )

    def along(self, component: int) -> None:
        """Drive along one more axis, slowly and at full speed, there and back, and let it go."""
        robot, drive = self.robot, self.drive
        ends = [robot.only(component, fastest(robot, component, sign)) for sign in (1, -1)]
        for velocity in (slowest_along(robot, component), *ends):
            if any(velocity):
                reach(drive, velocity)
        drive.stop(ends[0])
        self.let_go(robot.drivable(Velocity(*(_ASIDE * part for part in ends[0]))))

    def _fast(self) -> None:
        """Turn left and right, both at the highest speed.

        At first the robot also drives as fast as it can. Where the statement does not say how the two depend on each
        other, it need not reach both limits at once.
        """
        robot, drive = self.robot, self.drive
        left, right = (robot.only(ABOUT, fastest(robot, ABOUT, sign)) for sign in (1, -1))
        beside = both(robot)
        declared = robot.statement.motion.wheel_separation_m is not None
        if not (robot.can_move(AHEAD) and robot.limit_declared(AHEAD) and robot.limit_declared(ABOUT)):
            beside = left
        ids = () if declared or beside == left else ("rest-resources/velocity-both",)
        reached = reach(drive, beside, *ids)
        self.fastest = beside if reached else left
        if reached or (ids and reach(drive, left)):
            reach(drive, right)

    def _ahead_from_rest(self, *, renewed: bool) -> None:
        """Command a linear part after the angular part has ended by itself: the angular part must stay zero.

        If ``renewed``, the linear part is renewed by its own resource as well, for longer than it holds.
        """
        drive, ahead = self.drive, self.robot.share_of_limits(_ASIDE, 0.0)
        if not drive.command(ahead, linear=True):
            return
        drive.reach(ahead, "rest-resources/linear-put", part=LINEAR_PART)
        keeps, seen = drive.sees(ahead, 1.5, part=ANGULAR_PART)
        expected = f"no angular part beside {ahead}: the one before it had ended"
        drive.saw("rest-resources/linear-keeps-angular", expected, seen, "came back", holds=keeps)
        if renewed and self.robot.limits.hold_s:
            self._renew_linear(ahead, self.robot.limits.hold_s)
        drive.stop(ahead)

    def _renew_linear(self, ahead: Velocity, hold_s: float) -> None:
        """PUT a linear part again and again for longer than it holds, and record whether it lasts."""
        drive = self.drive
        until = drive.clock.now() + _RENEWED * hold_s
        in_time = True
        while drive.clock.now() < until:
            before = drive.trace.last_sent_s
            drive.command(ahead, linear=True)
            in_time = in_time and drive.trace.last_answered_s < before + certain_s(hold_s)
            drive.keep(_AGAIN * hold_s)
        lasts, seen = drive.sees(ahead, 2, part=LINEAR_PART, until=drive.trace.last_sent_s + certain_s(hold_s))
        expected = f"{ahead} as long as a PUT of the linear part renews it"
        drive.saw("safety/renewal", expected, seen, "ended", holds=lasts if in_time else None)

    def let_go(self, turning: Velocity, by: By = "velocity") -> None:
        """Command a velocity, then send nothing, and watch it end; ``by``: how it is commanded last.

        The first one is renewed for longer than it holds, and others that the robot must refuse come after it. Where it
        does not last, or the robot takes what it had refused before, the velocity is let go again.
        """
        hold_s, drive, motion = self.robot.limits.hold_s, self.drive, self.mapped.motion
        if hold_s is None:
            return
        self.seen = len(drive.trace.odometry) if self.seen is None else self.seen
        part = Part(f"{turning} by {COMMANDS[by]}", speeds_of(turning), by=way_of(motion, by))
        silent_s, first = hold_s + (self.pause_s or longer_s(self.robot.limits)), not self.drives
        for attempt in range(_ATTEMPTS):
            self.taken, disturbed, again = None, first and not attempt, first and attempt
            refused = (lambda: None) if again else partial(self._send_idle, hold_s, disturbed=disturbed)
            beside = (lambda: None) if again else self._send_refused
            more = int(disturbed or by in {"linear", "closing"})
            drives = tuple(left_alone(
                self.mapped, part, hold_s, more=more, refused=refused, gone=SILENT, brief=True, silent_s=silent_s,
                outlasts_s=hold_s if disturbed else 0.0, beside=beside,
            ))  # fmt: skip
            self.drives.extend(drives)
            if self.taken is None and drives and not (disturbed and fails(judge_hold(drives, motion, JUDGED))):
                break
        drive.look()
        drive.look()
        self.paused.append((drive.trace.turns[-2], drive.trace.turns[-1]))

    def _send_idle(self, hold_s: float, *, disturbed: bool) -> Command | None:
        """Send requests that renew nothing for a part of the hold time, at least one.

        Return what the robot took; else, if ``disturbed``, the last of the velocities that it must refuse, sent first.
        """
        clock, robot = self.drive.clock, self.robot
        sent, until = clock.now(), clock.now() + _MEANWHILE * hold_s
        if disturbed:
            robot.put_linear(_BAD[0])
            bad = [robot.put_velocity(velocity) for velocity in _BAD]
            refuse_goal(robot)
            return self.taken or Command(sent, clock.now(), {}, bad[-1])
        robot.velocity()
        for _ in range(len(self.idle)):
            send = self.idle.pop(0)
            self.idle.append(send)
            send()
            if clock.now() > until:
                break
        return self.taken

    def _send_refused(self) -> None:
        """Send the next request that was refused before; one that the robot takes now is not sent again."""
        if self.refused and self.robot.usual_s <= _QUICK_S:
            one, sent = self.refused.popleft(), self.drive.clock.now()
            exchange = one.send()
            if one.acts and exchange.response.ok and not is_refused(exchange):
                self.taken = Command(sent, self.drive.clock.now(), {}, exchange)
            else:
                self.refused.append(one)


def _arc(robot: Robot, drive: Drive, bent: Velocity, before: Velocity) -> None:
    """PUT two linear parts, one after the other, and record whether the angular part stays.

    Args:
        robot: the robot.
        drive: a drive of that robot.
        bent: the velocity at the end.
        before: the first linear part.
    """
    back = bent._replace(angular_z=0.0)
    drive.refresh(bent)
    if not drive.command(before, linear=True):
        return
    for attempt in range(_TRIES):
        if attempt or robot.usual_s > _QUICK_S:
            # A PUT of the linear part need not renew the angular one, so command both again in time.
            drive.refresh(bent)
        drive.command(back, linear=True)
        if not drive.trace.commands[-1].exchange.response.ok:
            return  # refused, so that it changes nothing
        drive.keep(min(_SHOWS_S, drive.holds_until - drive.clock.now()))
        keeps, found = drive.sees(bent, 1.5, part=ANGULAR_PART, until=drive.holds_until)
        if keeps is not None:
            break
    expected = f"the angular part as it was before the linear PUT, {bent}"
    drive.saw("rest-resources/linear-keeps-angular", expected, found, "changed", holds=keeps)
