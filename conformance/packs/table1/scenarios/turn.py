"""Turning: at the highest speed, renewed also after rejected commands, along an arc; and velocities not renewed."""

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Final

from conformance.api.soap.callable_services import SoapServices
from conformance.api.soap.service import SoapService
from conformance.measures.samples import SEVERAL
from conformance.packs.table1.robot import drive_rules
from conformance.packs.table1.robot.abilities import ABOUT, AHEAD
from conformance.packs.table1.robot.drive import Drive
from conformance.packs.table1.robot.drive_trace import ANGULAR_PART, LINEAR_PART
from conformance.packs.table1.robot.goals import make_room
from conformance.packs.table1.robot.letting_go import LetGo, Way, certain_s, ends_by
from conformance.packs.table1.robot.no_commands import no_commands
from conformance.packs.table1.robot.refused_requests import Refused, RefusedRequests, is_refused, send_known
from conformance.packs.table1.robot.robot import STILL, Robot, Velocity
from conformance.packs.table1.robot.soap_services import ask
from conformance.packs.table1.robot.undisturbed import arc, renewed
from conformance.packs.table1.robot.unrenewed import slow, unrenewed
from conformance.packs.table1.robot.velocity_range import along_arc, both, fastest, handy, reach, slowest_along
from conformance.packs.table1.robot.windows import LONGEST_SAMPLE_S
from conformance.packs.table1.scenarios.trace import Driven
from conformance.scenarios.scenario import partial_trace, scenario
from conformance.scenarios.stage import Need, Stage
from conformance.transport.exchange import Exchange
from conformance.verdict.run import Run

# Shares of the hold time: renew a command after the first; until the second a robot still has time to hold it.
_AGAIN: Final = 0.25
_SOON: Final = 0.45
# Share of the hold time after its end in which the suite does not read the robot, if it can come to rest in it.
_BRIEF: Final = 0.2
# Pause after the last velocity of longer runs, s: a robot must not show values from before a pause.
_PAUSE_S: Final = 1.1
# Multiple of the hold time for which a linear part is renewed.
_RENEWED: Final = 1.4
# Tries of a hold time's measurement that a stall of the suite or a late response spoilt.
_ATTEMPTS: Final = 3
# The only whole number of rad/s below the limits of most robots.
_WHOLE: Final = 1.0
# Share of the limit at which the robot drives along an arc.
_ASIDE: Final = 0.3
# One look in this many also reads the state over SOAP, if a response takes less than this, s.
_BESIDE: Final = 4
_QUICK_S: Final = 0.02
_STATES: Final = ("GetPose", "GetVelocity")
# Time in which any robot sends several samples, s.
_SAMPLES_S: Final = (SEVERAL + 1) * LONGEST_SAMPLE_S


@scenario(needs={Need.REST, Need.MOTION}, stage=Stage.LATE)
def turn(robot: Robot, run: Run, soap: SoapServices, refused: RefusedRequests) -> Driven:
    """Turn for about two seconds, in several ways; then let velocities end by themselves.

    Meanwhile requests are sent that were refused in the run or only read. A robot that cannot turn on the spot turns in
    its narrowest circle; one that cannot turn at all drives.
    """
    make_room(robot)
    turning = _Turning(robot, Drive(robot), no_commands(robot, soap, str(run.seed)))
    if soap.subscribers is not None and robot.usual_s <= _QUICK_S:
        turning.drive.aside = partial(turning.read_over_soap, soap.subscribers)
    with partial_trace(lambda: turning.recorded):
        turning.play()
        turning.drive.aside = lambda _turn: None
        send_known(robot, soap, refused)
        turning.refused = deque(refused.chosen(soap.there.values(), run.effort))
        turning.play_letting_go(run)
    return turning.recorded


@scenario(needs={Need.REST, Need.MOTION})
def further_axes(robot: Robot, run: Run, soap: SoapServices) -> Driven:
    """Drive along each axis that a robot on two wheels does not have; do nothing if there is none."""
    further = [axis for axis in range(len(STILL)) if axis not in {AHEAD, ABOUT} and robot.actuated(axis)]
    driving = _Turning(robot, Drive(robot), no_commands(robot, soap, str(run.seed)))
    if further:
        make_room(robot)
    with partial_trace(lambda: driving.recorded):
        for axis in further:
            driving.along(axis)
    return driving.recorded


@dataclass
class _Turning:
    """One play of a scenario.

    Requests that must not renew a velocity are ``idle``; those in ``refused`` were refused before.
    """

    robot: Robot
    drive: Drive
    idle: list[Callable[[], object]] = field(default_factory=list)
    refused: deque[Refused] = field(default_factory=deque)
    tries: list[tuple[LetGo, ...]] = field(default_factory=list)
    not_tested: list[tuple[str, str]] = field(default_factory=list)
    over_soap: list[Exchange] = field(default_factory=list)
    fastest: Velocity = STILL  # the fastest turn to the left that the robot has reached
    pause_s: float = 0.0  # for so long after a hold time the suite is silent at least
    brief: bool = True  # whether the robot was at rest after each brief silence so far
    taken: bool = False  # whether the robot has taken a request that it had refused before

    @property
    def _ends_s(self) -> float:
        return ends_by(self.robot.limits, self.robot.settle_s)

    @property
    def recorded(self) -> Driven:
        """Return the record so far."""
        recorded = Driven(self.drive.whole, tuple(self.tries), tuple(self.not_tested), self._ends_s)
        return replace(recorded, over_soap=tuple(self.over_soap))

    def read_over_soap(self, subscribers: SoapService, turn: int) -> None:
        """Read the state over SOAP beside some looks, so that it is compared with the odometry at every heading."""
        if turn % _BESIDE == 0:
            self.over_soap.append(ask(subscribers, _STATES[turn // _BESIDE % len(_STATES)]))

    def play(self) -> None:
        """Turn left by whole numbers, as fast as the robot can, renewed, and along an arc."""
        robot, drive = self.robot, self.drive
        drive.look()
        left = robot.only(ABOUT, _WHOLE if fastest(robot, ABOUT) > 1.1 * _WHOLE else 0.0)
        if not all(map(float.is_integer, left)):
            left = STILL  # whoever turns in a circle drives by no whole number
        if drive.command(left, integers=True):
            drive.reach(left, "rest-resources/velocity-integers", "rest-resources/velocity-converges")
        if left == STILL:
            left = handy(robot, 0.6)
            drive.command(left)
            drive.reach(left, "rest-resources/velocity-converges")
        fast = self._fast() if robot.actuated(ABOUT) else None
        if fast is None:
            drive.refresh(left)
        if not renewed(robot, drive, fast or left):
            reason = "responses came too late to renew a velocity within its hold time"
            self.not_tested.append(("safety/renewal", reason))
        bent = robot.drivable(Velocity(*(-part for part in left)))
        if robot.actuated(AHEAD) and robot.actuated(ABOUT):
            # A small circle: either part has to end. The linear part is commanded last, and ends as well.
            bent, before = along_arc(robot, bent, _ASIDE)
            arc(robot, drive, bent, before)
            drive.stop(bent)

    def play_letting_go(self, run: Run) -> None:
        """Drive along an arc, and let several velocities end by themselves; then drive straight on."""
        robot = self.robot
        make_room(robot)
        fast = both(robot) if robot.statement.motion.wheel_separation_m is not None else STILL
        self.fastest = fast if any(fast) or not robot.actuated(ABOUT) else robot.only(ABOUT, fastest(robot, ABOUT))
        bent = robot.drivable(Velocity(*(-part for part in handy(robot, 0.6))))
        if robot.actuated(AHEAD) and robot.actuated(ABOUT):
            bent, _ = along_arc(robot, bent, _ASIDE)
        ways = self._unrenewed(bent, run)
        for number, (velocity, by) in enumerate(ways, 1):
            self.pause_s = _PAUSE_S if number == len(ways) and run.effort.name != "quick" else 0.0
            self.let_go(velocity, by)
        if robot.actuated(AHEAD) and robot.actuated(ABOUT):
            self._ahead_from_rest(renewed=run.effort.name != "quick")

    def _unrenewed(self, bent: Velocity, run: Run) -> list[tuple[Velocity, Way]]:
        """Return what unrenewed() returns; one velocity suffices without a declared hold time."""
        robot = self.robot
        if robot.limits.hold_s is None:
            return [(bent, "velocity")]
        ahead = robot.drivable(Velocity(*(-one for one in bent)))
        across = robot.drivable(ahead._replace(angular_z=-ahead.angular_z))
        return unrenewed(bent, ahead, across, (*slow(robot, run.seed), self.fastest), run.effort.name, run.seed)

    def along(self, component: int) -> None:
        """Drive along one more axis, slowly and at full speed, there and back, and let it go."""
        robot, drive = self.robot, self.drive
        ends = [robot.only(component, fastest(robot, component, sign)) for sign in (1, -1)]
        for velocity in (slowest_along(robot, component), *ends):
            if any(velocity):
                reach(drive, velocity)
        drive.stop(ends[0])
        self.let_go(robot.drivable(Velocity(*(_ASIDE * part for part in ends[0]))))

    def _fast(self) -> Velocity | None:
        """Turn left and right, both at the highest speed; return the second velocity if it is reached.

        At first the robot also drives as fast as it can. Where the statement does not say how the two depend on each
        other, it need not reach both limits at once.
        """
        robot, drive = self.robot, self.drive
        left, right = (robot.only(ABOUT, fastest(robot, ABOUT, sign)) for sign in (1, -1))
        beside = both(robot)
        declared = robot.statement.motion.wheel_separation_m is not None
        if not (robot.actuated(AHEAD) and robot.limit_declared(AHEAD) and robot.limit_declared(ABOUT)):
            beside = left
        ids = () if declared or beside == left else ("rest-resources/velocity-both",)
        reached = reach(drive, beside, *ids)
        self.fastest = beside if reached else left
        if not reached and not ids:
            return None
        if ids and not reached and not reach(drive, left):
            return None
        return right if reach(drive, right) else None

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
            before = drive.trace.sent
            drive.command(ahead, linear=True)
            in_time = in_time and drive.trace.answered < before + certain_s(hold_s)
            drive.keep(_AGAIN * hold_s)
        lasts, seen = drive.sees(ahead, 2, part=LINEAR_PART, until=drive.trace.sent + certain_s(hold_s))
        expected = f"{ahead} as long as a PUT of the linear part renews it"
        drive.saw("safety/renewal", expected, seen, "ended", holds=lasts if in_time else None)

    def let_go(self, turning: Velocity, by: Way = "velocity") -> None:
        """Stop renewing a velocity, and watch how it ends; ``by``: what commands it last.

        A measurement that a stall of the suite or a late response spoilt is made again. One that shows a robot that
        does not come to rest is never made again: a watchdog that stops most velocities is none. Where the robot still
        moved after a brief silence, so that a request may have stopped it, the measurement is made with a longer one.
        """
        limits, tries = self.robot.limits, []
        for _ in range(_ATTEMPTS if limits.hold_s else 1):
            self.taken = False
            let_go = self._watch(turning, by)
            if let_go is None:
                break
            if self.taken:
                self.robot.put_velocity(STILL)
                continue
            tries.append(let_go)
            if not let_go.rests(limits):
                self.robot.put_velocity(STILL)
                break
            if let_go.early(limits) or let_go.late(limits):
                if not let_go.is_void(limits):
                    break
            elif self.brief and not let_go.rested_alone(limits):
                self.brief = False
            elif limits.hold_s is None or (let_go.was_held(limits) and not let_go.is_stale(limits)):
                break
        if tries:
            self.tries.append(tuple(tries))

    def _send_idle(self, until: float) -> None:
        """Send requests that renew nothing while they still could, until a time, s of the run's clock; at least one."""
        for _ in range(len(self.idle)):
            send = self.idle.pop(0)
            self.idle.append(send)
            send()
            if self.drive.clock.now() > until:
                break

    def _send_refused(self) -> None:
        """Send the next request that was refused before; one that the robot takes now is not sent again."""
        if self.refused and self.robot.usual_s <= _QUICK_S:
            one = self.refused.popleft()
            exchange = one.send()
            if one.acts and exchange.response.ok and not is_refused(exchange):
                self.taken = True
            else:
                self.refused.append(one)

    def _watch(self, turning: Velocity, by: Way) -> LetGo | None:
        """Command a velocity, and look until the robot rests or its time is over; return None if it is rejected.

        With a declared hold time, the suite does not read the robot around the end of that time, because a velocity
        must end by time and not by a request. A rejected command meanwhile must not renew it.
        """
        drive, clock, limits = self.drive, self.drive.clock, self.robot.limits
        last = drive.trace.last_full
        if last is None or last.velocity != turning or clock.now() > drive.holds_until:
            drive.refresh(turning)
        # Given again once: a robot that takes that for a repetition ends it clearly too early.
        if (
            by in {"xml", "closing"}
            or limits.hold_s is None
            or not self.tries
            or clock.now() > drive.trace.full_sent + _SOON * limits.hold_s
        ):
            drive.keep(drive.trace.full_sent + _AGAIN * (limits.hold_s or 0.0) - clock.now())
            drive.command(turning, xml=by == "xml", fresh=by == "closing")
        last = drive.trace.last_full
        if last is None or not drive_rules.answer_of(last).holds:
            return None
        full = last.sent
        if by == "linear":
            drive.command(turning, linear=True)
        answered = drive.trace.commands[-1].answered
        first, resumed, due = len(drive.trace.turns), None, None
        ends = answered + self._ends_s
        silent_from = math.inf if limits.hold_s is None else full + 0.95 * limits.hold_s
        while True:
            drive.glance() if drive.looks_long and resumed is None else drive.look()
            if resumed is None:
                self._send_refused()
            let_go = LetGo(turning, full, answered, drive.trace.turns[first:], resumed, due, by)
            if let_go.is_decided(limits, ends):
                return let_go
            if resumed is None and clock.now() > silent_from:
                self._send_idle(full + (limits.hold_s or 0.0))
                hold_s = limits.hold_s or 0.0
                silent_s = (1 + _BRIEF) * hold_s if self.brief else let_go.longest(limits)
                due = max(clock.now(), answered + max(silent_s, hold_s + self.pause_s))
                clock.sleep(due - clock.now())
                resumed = len(let_go.turns)
                ends = max(ends, clock.now() + _SAMPLES_S)
