"""A device that is read, commanded and stopped by its motion map."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, Final
from urllib.parse import quote, urlsplit

from conformance.api.rest.interface import RestInterface
from conformance.measures.samples import SEVERAL
from conformance.observe.clock import WALL_CLOCK, Clock
from conformance.scenarios.motion.binding import Binding, JsonBinding
from conformance.scenarios.motion.preparing import Preparation
from conformance.scenarios.motion.resting import at_rest, fastest
from conformance.scenarios.motion.room import Room
from conformance.scenarios.motion.templates import (
    NoValueError,
    at,
    fill,
    numbers_at,
    positions_at,
    quaternion_of,
    seconds_of,
)
from conformance.scenarios.motion.trace import Command, Leg, Reading, middle_of
from conformance.scenarios.scenario import NotDeclaredError, NotPossibleError, NotSeenError
from conformance.statement.motion_map import Goto, MotionMap, Stop, Switch, Velocity, Way, names_in
from conformance.transport.client import is_drafting
from conformance.transport.exchange import Attempt, Exchange, NoAnswerError, NotPermittedError, Outgoing

#: How long a device is watched after it has arrived, s.
STAYS_S: Final = 0.3
# Pause between two readings, s.
_PACE_S: Final = 0.02
# The deadline of a stop, s.
_STOP_S: Final = 2.0
# A move that the device refuses while it finishes the one before is sent again, for _FINISHES_S, once each _AGAIN_S, s.
_FINISHES_S, _AGAIN_S = 1.0, 0.05
# How long a device gets for moves one after the other, s.
_QUEUE_S: Final = 20.0
_LINK_S = 2.0  # for how long responses are timed again, s
_SLOWER = 3.0  # an earlier response counts as at most this many times slower than those
# How long a device without positions gets to come to rest, s.
_RESTS_S: Final = 5.0

Position = dict[str, float]


class MappedDevice:
    """One device.

    Args:
        api: its REST interface.
        motion: its map.
        clock: by which it is watched.
        binding: how its calls become requests; None: JSON over HTTP.
        looks: whether to read where it is, which moves need, and its noise; else it is what the map declares.

    Attributes:
        home: where it is brought between scenarios: near where it was at first, well within its limits.
        room: how far its velocities take it.
        resting: what it shows at rest, at least what the map declares.
        rests: whether it was seen at rest since it was last commanded.

    Raises:
        NotPossibleError: where it is cannot be read.
        NoAnswerError: there is no response.
    """

    def __init__(
        self,
        api: RestInterface,
        motion: MotionMap,
        clock: Clock = WALL_CLOCK,
        binding: Binding | None = None,
        *,
        looks: bool = True,
    ) -> None:
        self.api, self.motion, self.clock = api, motion, clock
        self.binding: Binding = binding or JsonBinding(api)
        self.room = Room(motion)
        if api.preparation is None:
            api.preparation = Preparation(motion, self.binding, self._exchange, clock)
        self.ready: Preparation = api.preparation
        self._answer: Any = None
        self._read_at, self._last, self.rests = 0.0, Position(), False
        here = self.where() if looks else {}
        self.home = {name: motion.state.axes[name].well_inside(value) for name, value in here.items()}
        self.resting = at_rest(self.watch(self.clock.now() + STAYS_S) if looks else (), motion)
        self.room.noise = self.resting.axes
        api.stop_device = self.leave_at_rest

    @property
    def moves(self) -> Goto:
        """How it is sent to a position.

        Raises:
            NotDeclaredError: the map does not say it.
        """
        if self.motion.goto is None:
            raise NotDeclaredError("the map has no [motion.goto]")
        return self.motion.goto

    @property
    def drives(self) -> Velocity:
        """How it is given a velocity.

        Raises:
            NotDeclaredError: the map does not say it.
        """
        if self.motion.velocity is None:
            raise NotDeclaredError("the map has no [motion.velocity]")
        return self.motion.velocity

    @property
    def takes_s(self) -> float:
        """Time that the device has for a move, without the time to settle, s."""
        return self._lasts_s or self.moves.within_s

    @property
    def _lasts_s(self) -> float:
        """How long a move lasts, s; 0 means as long as the way takes."""
        return self.moves.seconds if "seconds" in names_in([self.moves.send, self.moves.body]) else 0.0

    def read(self, *, at_once: bool = False) -> Reading:
        """Read the state, and that of the last accepted move; unless ``at_once``, a while after the last reading."""
        state = self.motion.state
        if not at_once:
            self.clock.sleep(self._read_at + _PACE_S - self.clock.now())
        self._read_at = sent = self.clock.now()
        exchange, document = self.get(state.read)
        values = positions_at(document, {name: one.at for name, one in state.axes.items() if not one.read}, state.axes)
        for call in dict.fromkeys(axis.read for axis in state.axes.values() if axis.read):
            own = {name: one.at for name, one in state.axes.items() if one.read == call}
            values |= positions_at(self.get(call)[1], own, state.axes)
        values = values if len(values) == len(state.axes) else {}
        received = self.clock.now()
        # An axis that turns continues beyond a whole turn.
        values = {name: state.axes[name].near(one, self._last.get(name, one)) for name, one in values.items()}
        self._last = values or self._last
        speeds = numbers_at(document, self.motion.speeds)
        try:
            stamp = seconds_of(at(document, state.stamp)) if state.stamp else None
        except NoValueError:
            stamp = None
        return Reading(
            sent, received, values if exchange.response.ok else {}, stamp, exchange, speeds, self._action_state()
        )

    def get(self, call: str) -> tuple[Exchange, Any]:
        """Send a reading operation of the map; return the exchange and its value, or None."""
        exchange = self.send(self.binding.make(call, None))
        return exchange, self.binding.content(exchange.response.body)

    def send(self, made: Outgoing, **how: Any) -> Exchange:
        """Send a request; ``how``: arguments of HttpClient.send()."""
        self.ready.keep()
        exchange = self._exchange(made, **how)
        if self.ready.lost_lease(exchange):
            self.ready.keep()
            exchange = self._exchange(self.ready.with_lease(made), **how)
        return exchange

    def _exchange(self, made: Outgoing, **how: Any) -> Exchange:
        sent = self.clock.now()
        exchange = self.api.client.send(made.method, made.target, headers=made.headers, body=made.body, **how)
        self.room.slowest_s = max(self.room.slowest_s, self.clock.now() - sent)
        return exchange

    def _action_state(self) -> str:
        action = self.motion.action
        if action is None or self._answer is None:
            return ""
        try:
            word = at(self.get(fill(action.read, {}, self._answer))[1], action.at)
        except NoValueError:
            return ""
        return word if isinstance(word, str) else json.dumps(word)

    def call_of(self, given: Goto | Velocity | Way | Switch | Stop, values: Mapping[str, Any]) -> tuple[str, Any]:
        """Return call and body of a command.

        An axis without a value goes home, or stands still.
        """
        if isinstance(given, Goto):
            values = {**self.home, **values}
            here = self.where() if given.relative else {}
            ways = {
                name: value - here[name] for name, value in values.items() if isinstance(value, int | float) and here
            }
            values = {**values, **ways, "seconds": given.seconds}
            for name, axis in self.motion.state.axes.items():
                values |= quaternion_of(name, values[name], axis)
        elif isinstance(given, Velocity | Way):
            values = {**dict.fromkeys(self.drives.axes, 0.0), **values}
        held, in_path = {"lease": self.ready.lease}, {"lease": quote(self.ready.lease, safe="")}
        path = fill(given.send, {**values, **in_path}, self._answer)
        return path, fill(given.body, {**values, **held}, self._answer)

    def request_of(
        self, given: Goto | Velocity | Way | Switch | Stop, values: Mapping[str, Any], *, authorized: bool = True
    ) -> Outgoing:
        """Return the request of a command; see call_of()."""
        self.rests = False
        self.ready.keep()
        form = (given.media_type, given.root) if isinstance(given, Way) else ()
        return self.ready.with_lease(self.binding.make(*self.call_of(given, values), *form, authorized=authorized))

    def _send(self, made: Outgoing, targets: Position, **how: Any) -> Command:
        sent = self.clock.now()
        exchange = self.send(made, **how)
        return Command(sent, self.clock.now(), targets, exchange, self.has_failed(exchange))

    def goto(self, targets: Mapping[str, float], ends: Mapping[str, float] | None = None) -> Command:
        """Send a move; ``ends``: where it must end, if not at the targets."""
        axes, wanted = self.motion.state.axes, {**self.home, **(ends or targets)}
        wanted = {name: axes[name].near(one, self._last.get(name, one)) for name, one in wanted.items()}
        self.room.note_command({"a move"})
        command = self._send(self.request_of(self.moves, targets), wanted)
        if command.is_ok:
            self.note(command.exchange)
        return command

    def drive(
        self,
        speeds: Mapping[str, Any],
        *,
        way: Way | None = None,
        integers: bool = False,
        authorized: bool = True,
        fresh: bool = False,
    ) -> Command:
        """Command velocities; those without a value are 0.

        Args:
            speeds: by name.
            way: how, if not as usual: those that it does not name stay as they are.
            integers: write whole numbers without a fraction.
            authorized: send the credentials.
            fresh: send it on a connection that is closed afterwards.
        """
        written = {**dict.fromkeys(self.drives.axes, 0.0), **speeds}
        # A text that must be refused is no commanded velocity.
        wanted = {name: float(one) for name, one in written.items() if isinstance(one, int | float)}
        if integers:
            written |= {name: int(one) for name, one in wanted.items() if one == int(one)}
        made = self.request_of(way or self.drives, written, authorized=authorized)
        self.room.note_command({name for name, one in wanted.items() if one})
        return self._send(made, wanted, authorized=authorized, fresh=fresh)

    def has_failed(self, exchange: Exchange) -> bool:
        """Return whether the content of a 2xx reports a failed request, by the map's `failed`."""
        failed = self.motion.failed
        if failed is None or not exchange.response.ok:
            return False
        try:
            return bool(at(self.binding.content(exchange.response.body), failed.at) != failed.is_not)
        except NoValueError:
            return False

    def note(self, exchange: Exchange) -> None:
        """Keep the response to an accepted move, if it can be read: a stop may name its id."""
        self._answer = self.binding.content(exchange.response.body) or self._answer

    def stop(self) -> Command | None:
        """Send the stop, or velocity 0; return None if the map has neither, or names an unknown value."""
        stop = self.motion.stop
        if stop is None:
            return self.drive({}) if self.motion.velocity else None
        try:
            made = self.request_of(stop, {})
        except NoValueError:
            return None
        return self._send(made, {}, timeout_s=max(_STOP_S, stop.rests_within_s))

    def halt(self) -> Command | None:
        """Send the stop, and velocity 0 too if the device refuses the stop, or takes velocities alone.

        Returns:
            The stop; None if there is none that can be sent.
        """
        command = self.stop()
        is_enough = self.motion.goto is not None and command is not None and not command.is_refused
        if command is not None and self.motion.stop and self.motion.velocity and not is_enough:
            self.drive({})
        return command

    def saw_rest(self, readings: Sequence[Reading]) -> bool:
        """Note and return whether the last ones of some readings show the device at rest."""
        last = [reading for reading in readings[-2 * SEVERAL :] if reading.values or reading.speeds]
        stays = not self.motion.state.axes or all(self.is_near(reading.values, last[0].values) for reading in last)
        self.rests = len(last) == 2 * SEVERAL and stays and not fastest(last, self.motion)
        return self.rests

    def watch(self, until: float, is_over: Callable[[list[Reading]], object] = lambda _: False) -> list[Reading]:
        """Read until a time, s of the clock, and once more after it, or until ``is_over``."""
        readings: list[Reading] = []
        while True:
            late = self.clock.now() > until
            readings.append(self.read())
            if late or is_over(readings):
                return readings

    def measure_link(self) -> None:
        """Measure once more how slow responses are, as a busy machine may have held one back long ago."""
        slowest_s, self.room.slowest_s = self.room.slowest_s, 0.0
        self.watch(self.clock.now() + _LINK_S)
        self.room.slowest_s = min(slowest_s, _SLOWER * self.room.slowest_s)

    def is_near(self, here: Mapping[str, float], there: Mapping[str, float]) -> bool:
        """Return whether a position is another one, within the tolerances."""
        axes = self.motion.state.axes
        return bool(here) and all(
            abs(axes[name].apart(here[name], there[name])) <= self.motion.tolerance(name) for name in there
        )

    def where(self) -> Position:
        """Return where the device is by the median of several readings; empty if the map has no positions.

        Raises:
            NotPossibleError: it cannot be read. A device that nobody sees is not moved.
        """
        seen = [self.read() for _ in range(SEVERAL if self.motion.state.axes else 0)]
        if not all(reading.values for reading in seen):
            places = ", ".join(axis.at for axis in self.motion.state.axes.values())
            came = seen[-1].exchange.came
            raise NotPossibleError(f"{self.motion.state.read} got {came}, without numbers at {places}")
        return {name: middle_of(seen, name) for name in self.motion.state.axes}

    def follow(self, command: Command, others: Sequence[Position] = ()) -> list[Reading]:
        """Watch until the target of a command, or another one, is reached and kept, or the command's time is over."""
        seen, targets = list[Reading](), [command.targets, *others]

        def among(ends: Sequence[Position], readings: list[Reading]) -> list[Position]:
            last = readings[-SEVERAL:] if len(readings) >= SEVERAL else []
            return [item for item in ends if last and all(self.is_near(reading.values, item) for reading in last)]

        while True:
            seen += self.watch(self.due(command), partial(among, targets))
            if there := among(targets, seen):
                # A move with a duration lasts for it, even over a short distance. A device that only passes its target
                # has left it then.
                seen += self.watch(max(self.clock.now() + STAYS_S, command.answered + self._lasts_s))
                if among(there, seen):
                    # A move may have its end later than its place.
                    return seen + (self.watch(self.due(command), self._has_ended) if not self._has_ended(seen) else [])
            if self.clock.now() > self.due(command):
                # A single reading after the end decides nothing.
                return seen + [self.read() for _ in range(SEVERAL)]

    def _has_ended(self, seen: list[Reading]) -> bool:
        """Return whether the last move does not say that it runs, or need not say so."""
        return self.motion.action is None or seen[-1].action not in self.motion.action.running

    def follow_several(
        self, commands: Sequence[Command], others: Sequence[Position] = ()
    ) -> tuple[list[Reading], float]:
        """Watch until the last of several accepted moves is over; return the readings, and when it was due.

        Where nobody says that it displaces the others, the device may make one after the other until it rests.

        Raises:
            NotSeenError: it does not come to rest.
        """
        accepted = [command for command in commands if command.is_ok]
        last = (accepted or list(commands))[-1]
        seen, due = self.follow(last, others) if accepted else [], self.due(last)
        if len(accepted) > 1 and self.moves.while_moving is None:
            stays_until = self.clock.now() + STAYS_S
            seen += self.watch(
                max(stays_until, last.answered + min(len(accepted) * self.takes_s, _QUEUE_S)),
                lambda so_far: so_far[-1].sent > stays_until and self.saw_rest(so_far),
            )
            due = max(due, seen[-SEVERAL:][0].sent)
            if not self.rests:
                raise NotSeenError(f"it still moves {seen[-1].sent - last.answered:.1f} s after the last of its moves")
        return seen, due

    def due(self, command: Command) -> float:
        """Return when the target of a command must have been reached, s of the clock."""
        return command.answered + self.takes_s + self.moves.settle_s

    def go(self, what: str, targets: Mapping[str, float], ends: Mapping[str, float] | None = None) -> Leg:
        """Send one move and watch it; ``ends``: where it must end, if not at the targets."""
        start, until = self.where(), self.clock.now() + _FINISHES_S
        command = self.goto(targets, ends)
        while self.moves.while_moving == "refused" and command.is_refused and self.clock.now() < until:
            self.clock.sleep(_AGAIN_S)
            command = self.goto(targets, ends)
        return Leg(what, start, (command,), tuple(self.follow(command)) if command.is_ok else (), self.due(command))

    def bring_home(self) -> None:
        """Stop any motion, and bring the device home; one without positions stays where it comes to rest.

        Raises:
            NotPossibleError: it does not get there.
        """
        if self.motion.goto is None:
            self.come_to_rest()
            return
        self.halt()
        self.go("home", {})
        if not self.is_near(self.where(), self.home):
            raise NotPossibleError("the device does not come back to the position from which the suite begins")

    def leave_at_rest(self) -> str:
        """Stop the device, see that it rests, and release it; return why it may still move, or an empty text."""
        problem, ended = self._left_at_rest(), self._problem_of(self.ready.end)
        return problem or ended

    def _left_at_rest(self) -> str:
        problem = self._problem_of(self._halt_problem)
        if is_drafting() or not (self.motion.state.axes or self.motion.speeds):
            return problem
        # If a stop was not accepted, send it again soon.
        velocity = self.motion.velocity
        within_s = (velocity.settle_s if velocity else 0.0) if problem else None
        moves = self._problem_of(partial(self.come_to_rest, stop=False, within_s=within_s))
        return "; ".join(filter(None, (problem, moves))) if moves else ""

    def _halt_problem(self) -> str:
        """Stop the device; return why it may still move, or an empty text."""
        command = self.halt()
        if command is None:
            return "the motion map has no stop that can be sent"
        return "" if command.is_ok else f"{self._request_text(command.exchange)} got {command.exchange.came}"

    def _problem_of(self, act: Callable[[], str | None]) -> str:
        """Return what an action returns, or why it failed; empty if it did not."""
        try:
            return act() or ""
        except (NotPossibleError, NotPermittedError) as error:
            return str(error)
        except NoAnswerError as none:
            return f"{self._request_text(none.unanswered)}: {none}"

    @staticmethod
    def _request_text(attempt: Attempt) -> str:
        return f"{attempt.request.method} {urlsplit(attempt.request.url).path}"

    def come_to_rest(self, *, stop: bool = True, within_s: float | None = None) -> None:
        """Stop the device, unless that is done already, and wait until it rests.

        Args:
            stop: whether to stop it.
            within_s: how long to wait, s; None means as long as the map says, and at least some seconds.

        Raises:
            NotPossibleError: it does not.
        """
        if stop:
            self.halt()
        rests_s = max(_RESTS_S, self.motion.stop.rests_within_s if self.motion.stop else 0.0)
        until = self.clock.now() + (rests_s if within_s is None else within_s)
        while True:
            before = self.where()
            # Positions show slow motion only over some time; measured velocities show it in several readings.
            seen = self.watch(self.clock.now() + STAYS_S, *(() if self.motion.state.axes else (self.saw_rest,)))
            stays = self.is_near(self.where(), before) if before else any(reading.speeds for reading in seen)
            if stays and not fastest(seen, self.motion):
                self.rests = True
                return
            if self.clock.now() > until:
                break
        raise NotPossibleError(f"the device does not come to rest, as {self.motion.state.read} shows")
