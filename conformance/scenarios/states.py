"""A device is led through its states by its state map, and each operation is sent in each state that is reached."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from typing import Final

from conformance.api.rest.interface import RestInterface
from conformance.measures.samples import SEVERAL
from conformance.observe.clock import WALL_CLOCK, Clock, poll_for
from conformance.scenarios.motion.binding import Binding, binding_of
from conformance.scenarios.motion.mapped import MappedDevice
from conformance.scenarios.motion.templates import NoValueError, at
from conformance.scenarios.motion.trace import Reading, middle_of
from conformance.scenarios.scenario import NotPossibleError, PartialTraceError, scenario
from conformance.scenarios.stage import Leaves, Need, Stage
from conformance.statement.state_map import StateMap
from conformance.transport.exchange import Exchange, NoAnswerError

_PACE_S: Final = 0.03  # pause between reads of the state, s
_STAYS_S: Final = 0.3  # how long the state is watched after it was reached, and after a refusal, s
_KEEPS_S: Final = 0.1
_SETTLES_S: Final = 1.0  # how long a device may settle in a state of rest, s
_STILL_S: Final = 0.5  # how long the device is watched for a motion, s
# Standard deviations of a reading that are noise.
_SIGMAS: Final = 6.0
# Tries of an operation that comes too late for a state that changes by itself.
_TRIES: Final = 3
# Most operations to send on the way to each pair of operation and state.
_WAYS: Final = 4


@dataclass(frozen=True)
class Step:
    """One operation that was sent.

    Attributes:
        operation: its name in the map.
        state: the state that was read just before.
        exchange: the request and its response.
        taken: whether the device took it: a 2xx that says of no failure.
        shown: the states that were read afterwards, each once in a row.
        arrived: whether the state to which it leads was seen in time.
    """

    operation: str
    state: str
    exchange: Exchange
    taken: bool
    shown: tuple[str, ...]
    arrived: bool


@dataclass(frozen=True)
class Rest:
    """What the axes did in a state in which the device does not move.

    Attributes:
        state: the state that was read before and after.
        exchange: the request that showed it, and its response.
        ways: by axis, how far it moved after it had time to settle, and how far it may seem to; empty if none moved.
    """

    state: str
    exchange: Exchange
    ways: dict[str, tuple[float, float]]


@dataclass(frozen=True)
class Walk:
    """A walk through the states.

    Attributes:
        states: states of the map.
        operations: by name, the states in which each must be taken.
        steps: what was sent.
        first: the state at the beginning.
        last: the state at the end.
        rests: what was seen in states of rest.
    """

    states: tuple[str, ...]
    operations: dict[str, tuple[str, ...]]
    steps: tuple[Step, ...]
    first: str
    last: str
    rests: tuple[Rest, ...] = ()


class _Walker:
    """Leads one device through its states."""

    def __init__(self, api: RestInterface, states: StateMap, clock: Clock) -> None:
        self._api, self._map, self._clock = api, states, clock
        self._binding: Binding = binding_of(api)
        self._tried: Counter[tuple[str, str]] = Counter()
        # The state that followed, by state and operation: from the map or as observed; empty if none did.
        self._led: dict[tuple[str, str], str] = {}
        self.steps: list[Step] = []
        self.rests: list[Rest] = []
        motion, self._mapped = api.run.statement.motion_map, None
        if motion is not None and motion.state.axes and states.at_rest:
            self._mapped = MappedDevice(api, motion, clock, self._binding)
        self.first = self.here = self._read()

    def walk(self) -> None:
        """Send each operation in each state that can be reached, refused ones first."""
        most = _WAYS * len(self._map.states) * len(self._map.operations)
        while (chosen := self._next()) is not None and len(self.steps) < most:
            self._api.run.limit.check()
            self._go(chosen)

    def go_back(self) -> None:
        """Lead the device to its first state, if the map has a way."""
        for _ in self._map.states:
            if self.here == self.first or (way := self._way(lambda state: state == self.first)) is None:
                return
            self._go(way)

    def _next(self) -> str | None:
        """Return the operation to send now, "" to wait for a change; None if nothing is left that can be reached."""
        untried = [name for name in self._map.operations if not self._is_done(name, self.here)]
        refused = [name for name in untried if not self._map.operations[name].is_taken_in(self.here)]
        # Operations that leave the state come last.
        stays = [name for name in untried if name not in refused and not self._map.operations[name].to]
        if found := [*refused, *stays, *untried]:
            return found[0]
        return self._way(lambda state: not all(self._is_done(name, state) for name in self._map.operations))

    def _is_done(self, name: str, state: str) -> bool:
        if state in self._map.operations[name].not_in:
            return True
        return self._tried[name, state] >= (_TRIES if state in self._map.changes else 1)

    def _way(self, is_wanted: Callable[[str], bool]) -> str | None:
        """Return the first operation of the shortest way to a state, "" to wait, or None without a way."""
        seen, left = {self.here}, deque[tuple[str, str | None]]([(self.here, None)])
        while left:
            state, begun_by = left.popleft()
            if begun_by is not None and is_wanted(state):
                return begun_by
            for step, to in self._edges(state):
                if to not in seen:
                    seen.add(to)
                    left.append((to, step if begun_by is None else begun_by))
        return None

    def _edges(self, state: str) -> Iterator[tuple[str, str]]:
        for name, one in self._map.operations.items():
            is_taken = one.is_taken_in(state) and state not in one.not_in
            to = self._led.get((name, state), one.leads(state) if is_taken else "")
            if to not in {"", state}:
                yield name, to
        change = self._map.changes.get(state)
        if change is not None and change.within_s is not None:
            yield from (("", to) for to in change.to if ("", state) not in self._led)

    def _go(self, name: str) -> None:
        if not name:
            before, within_s = self.here, self._map.changes[self.here].within_s or 0.0
            for _ in poll_for(self._clock, _PACE_S, within_s):
                self.here = self._read()
                if self.here != before:
                    self._watch_rest()
                    return
            self._led["", before] = ""
            return
        one, before = self._map.operations[name], self._read()
        self._tried[name, before] += 1
        made = self._binding.make(one.send or name, one.body)
        exchange = self._api.client.send(made.method, made.target, headers=made.headers, body=made.body)
        taken = exchange.response.ok and not self._has_failed(exchange)
        wanted = self._map.following(one.leads(before) if taken else before)
        within_s = (one.within_s or self._map.within_s) if taken else _KEEPS_S
        shown, arrived = [self._read()], False
        for _ in poll_for(self._clock, _PACE_S, within_s):
            arrived = shown[-1] in wanted
            if arrived:
                break
            self._look(shown)
        for _ in poll_for(self._clock, _PACE_S, _STAYS_S if taken else _KEEPS_S):
            if taken and self._hurries(shown[-1]):
                break
            self._look(shown)
        self.steps.append(Step(name, before, exchange, taken, tuple(shown), arrived or shown[-1] in wanted))
        self.here = shown[-1]
        self._led[name, before] = self.here if self.here != before else ""
        self._watch_rest()

    def _hurries(self, state: str) -> bool:
        """Return whether an operation came, maybe too late, in a state that changes by itself: now it is at once."""
        tried = (self._tried[name, state] for name in self._map.operations)
        return state in self._map.changes and any(0 < count < _TRIES for count in tried)

    def _watch_rest(self) -> None:
        """Record whether the device moves in a state of rest, after the time in which it may settle."""
        mapped, state = self._mapped, self.here
        if mapped is None or state not in self._map.at_rest:
            return
        axes, ways = mapped.motion.state.axes, dict[str, tuple[float, float]]()
        begun = self._clock.now()

        def way_of(readings: list[Reading]) -> dict[str, float]:
            seen = [one for one in readings if one.values and one.sent > readings[-1].sent - _STILL_S]
            sides = (seen[:SEVERAL], seen[-SEVERAL:])
            return {name: abs(axis.apart(*(middle_of(side, name) for side in sides))) for name, axis in axes.items()}

        def is_still(readings: list[Reading]) -> bool:
            if self._clock.now() < begun + _STILL_S or not readings[-1].values:
                return False
            return all(way <= mapped.motion.tolerance(name) for name, way in way_of(readings).items())

        if not is_still(mapped.watch(begun + _SETTLES_S, is_still)):
            shown, seen = self._read(), mapped.watch(self._clock.now() + _STILL_S)
            self.here = self._read()
            if not shown == self.here == state or not all(reading.values for reading in seen):
                return
            for name, way in way_of(seen).items():
                most = 2 * mapped.motion.tolerance(name) + _SIGMAS * mapped.resting.axes[name].sigma
                ways[name] = way, most
        self.rests.append(Rest(state, self._shown, ways))

    def _look(self, shown: list[str]) -> None:
        state = self._read()
        if state != shown[-1]:
            shown.append(state)

    def _read(self) -> str:
        made = self._binding.make(self._map.read, None)
        exchange = self._api.client.send(made.method, made.target, headers=made.headers, body=made.body)
        self._shown = exchange
        try:
            said = str(at(self._binding.content(exchange.response.body), self._map.at))
        except NoValueError as error:
            raise NotPossibleError(f"[states] {self._map.read} got {exchange.came}: {error}") from error
        if state := self._map.state_in(said):
            return state
        raise NotPossibleError(f"[states] {self._map.read} got {exchange.came}: no state in {said[:80]!r}")

    def _has_failed(self, exchange: Exchange) -> bool:
        if self._map.failed is None:
            return False
        try:
            said = at(self._binding.content(exchange.response.body), self._map.failed.at)
        except NoValueError:
            return False
        return bool(said != self._map.failed.is_not)


@scenario(needs=(Need.REST,), leaves=Leaves.AT_REST, stage=Stage.DRIVE)
def walked(api: RestInterface, state_map: StateMap) -> Walk:
    """Send each operation of the state map in each state that can be reached, and return to the first state."""
    if not api.run.allow_motion:
        raise NotPossibleError("the operations of [states] act on the device, and --allow-motion was not given")
    walker = _Walker(api, state_map, WALL_CLOCK)
    states = state_map.states
    taken_in = {name: tuple(filter(one.is_taken_in, states)) for name, one in state_map.operations.items()}

    def walk_so_far() -> Walk:
        return Walk(states, taken_in, tuple(walker.steps), walker.first, walker.here, tuple(walker.rests))

    try:
        walker.walk()
        walker.go_back()
    except BaseException as error:
        with suppress(NoAnswerError, NotPossibleError):
            walker.go_back()
        if isinstance(error, NoAnswerError | NotPossibleError):
            raise PartialTraceError(walk_so_far()) from error
        raise
    return walk_so_far()
