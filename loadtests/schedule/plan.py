"""The plan of a run: segments, each of one client on one interface, in an order fixed by the seed.

A fair comparison: REST and SOAP take turns in short blocks, in quartets REST-SOAP-SOAP-REST or the reverse at random.
The machine's speed drifts within a second: the sooner one follows the other, the more they share of it. But a block has
to be long beside a response, because requests under way at its end overlap with the other interface. In two quartets of
five, one interface meets itself under two names (the A/A control): the difference that this shows is noise. It gets as
much time as the comparison, so that it is known as exactly as the effect. The library clients have quartets of their
own, because their CPU time would delay the wire client's starts.

Three interfaces take turns in the same way, in sextets; two robots over one interface in each quartet.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import accumulate, count, product
from typing import Any, Self

import msgspec
import numpy as np

from loadtests.clients.payloads import CLIENTS, INTERFACES, MOVES

GAP_S = 0.010
#: Requests a second, of one worker, up to which it is idle most of the time.
IDLE_RATE = 1000.0


@dataclass(frozen=True, slots=True)
class Segment:
    """A stretch of time in which one client calls one interface.

    Attributes:
        start_ns, end_ns: offsets from the run's start.
        phase: `warmup`, `duel`, `aa`, `against` (the comparison's blocks of the other robot) or `step`.
        label: in phase `aa` the name that the interface goes by, `a` or `b`.
        pair: neighbours that are compared with one another share a number.
        rate: arrivals per second over all workers; 0 in the closed model.
        robot: 0, or 1 for the robot that it is compared with.
        gap: whether it begins with a gap in which no request starts.
    """

    start_ns: int
    end_ns: int
    phase: str
    interface: str
    client: str
    label: str
    pair: int
    rate: float
    robot: int = 0
    gap: bool = True

    @property
    def opens_ns(self) -> int:
        """Return the offset at which its requests may start: after the quiet gap, if it has one."""
        return self.start_ns + self.gap * min(int(GAP_S * _NS), (self.end_ns - self.start_ns) // 8)

    @property
    def active_s(self) -> float:
        """Return for how long its requests may start."""
        return (self.end_ns - self.opens_ns) / _NS


#: REST and SOAP at once, in steps of the load: every other request goes over the other.
BOTH = "both"

#: The highest rate for each worker at which the library clients take part: a call costs some 1.5 ms of the
#: generator's time, and a generator that is busy for more than a fraction of it measures itself.
LIBRARY_RATE = 250.0
#: Least length of a block: SHORT_BLOCK_S if the robot responds within QUICK_ANSWER_S and arrivals are on time, else
#: BLOCK_S.
SHORT_BLOCK_S, BLOCK_S = 0.02, 0.1
QUICK_ANSWER_S = 0.01
_MAX_BLOCKS = 1200  # bounds memory: each block keeps its own histograms
_ARRIVALS_PER_BLOCK = 4  # of each operation
_TURNS, _LIBRARY_TURN = 5, 1  # the second of five rounds goes to the library clients
_AA_TURNS = {1: (2, 4), 2: (4,)}  # the third and fifth of five rounds are A/A controls; with two robots, only the fifth
_NS = 1_000_000_000
#: Names a series of the result: (operation, interface, client).
SeriesName = tuple[str, str, str]


@dataclass(frozen=True)
class Load:
    """How many requests the robot gets, and for how long.

    Attributes:
        rate: arrivals per second over all workers (open model), at most; None in the closed model.
        users: users that each wait for their response (closed model).
        arrivals: `constant` or `poisson`.
        seed: fixes schedule, payloads and intervals.
        stages: rates, and the seconds in which the rate changes to each from the one before, at first from 0; empty:
            the rate is the same throughout.
    """

    rate: float | None
    users: int | None
    duration_s: float
    warmup_s: float
    arrivals: str
    seed: int
    stages: tuple[tuple[float, float], ...] = ()

    def stage_at(self, moment_s: float) -> int:
        """Return the number of the stage, from 0, at a moment since the beginning of the measured part, in seconds."""
        ends = accumulate(seconds for _, seconds in self.stages)
        return min(sum(moment_s >= end for end in ends), max(0, len(self.stages) - 1))

    def rate_at(self, moment_s: float) -> float:
        """Return the rate at a moment since the beginning of the measured part, in seconds."""
        if not self.stages:
            return self.rate or 0.0
        number = self.stage_at(moment_s)
        target, seconds = self.stages[number]
        before = self.stages[number - 1][0] if number else 0.0
        into = moment_s - sum(seconds for _, seconds in self.stages[:number])
        return before + (target - before) * min(1.0, max(0.0, into / seconds)) if seconds else target


@dataclass(frozen=True)
class Plan:
    """Everything that fixes a run. Workers rebuild the same plan from `as_message`.

    Attributes:
        offers: operation numbers by `interface/client`, where not all are offered.
        robots: 2 where two robots are compared instead of two interfaces.
        first_segment: number of its first segment; numbers go on from plan to plan.
        step_rate: a step of the stepped load instead of a comparison: arrivals per second; 0 in the closed model.
        connections: users started in total; in the closed model as many take part as the load says.
        repeat: which repeat of the comparison this is; repeats after the first begin with new connections.
        part: which part of the repeat this is: a comparison that is not decided goes on over the same connections.
        offset_s: when it starts, in seconds of load since the first one's start.
        least_block_s: BLOCK_S, or SHORT_BLOCK_S where the robot is known to be quick.
        weights: how often each operation is called; empty means all equally often.
        scenario: users send what a scenario says, and when it says so, without gaps between blocks.
    """

    operations: tuple[str, ...]
    interfaces: tuple[str, ...]
    clients: tuple[str, ...]
    load: Load
    timeout_s: float
    workers: int
    connections: int
    offers: dict[str, list[int]] = field(default_factory=dict)
    step_rate: float | None = None
    first_segment: int = 0
    settle_s: float = field(default=0.5)
    robots: int = 1
    repeat: int = 0
    part: int = 0
    offset_s: float = 0.0
    least_block_s: float = BLOCK_S
    weights: tuple[int, ...] = ()
    scenario: bool = False

    def as_message(self) -> dict[str, Any]:
        """Return the plan in a form that msgpack carries."""
        message: dict[str, Any] = msgspec.to_builtins(self)
        return message

    @classmethod
    def from_message(cls, message: dict[str, Any]) -> Self:
        """Return the plan that `as_message` wrote."""
        return msgspec.convert(message, cls)

    def choices(self, interface: str, client: str) -> tuple[int, ...]:
        """Return the numbers of the operations that a client can call over an interface."""
        found = self.offers.get(f"{interface}/{client}")
        return tuple(range(len(self.operations))) if found is None else tuple(found)

    def series_names(self) -> list[SeriesName]:
        """Return the names of everything that is measured."""
        return [
            (self.operations[number], interface, client)
            for client in self.clients
            for interface in self.interfaces
            for number in self.choices(interface, client)
        ]

    @property
    def open_model(self) -> bool:
        """Return whether requests start on schedule, also while earlier ones wait for their responses."""
        return self.load.users is None

    @property
    def mostly_idle(self) -> bool:
        """Return whether each worker is idle most of the time: the open model at up to `IDLE_RATE`, without steps."""
        rate = self.load.rate
        return rate is not None and rate / self.workers <= IDLE_RATE and self.open_model and self.step_rate is None

    @cached_property
    def blocks(self) -> int:
        """Return how many blocks the comparison has: whole rounds, or half of one where there is no time for more."""
        return len(self._rounds)

    @cached_property
    def _rounds(self) -> list[Segment]:
        """Return the comparison's blocks in order, without their times; none where nothing can be called."""
        if not (self.clients and self.interfaces):
            return []
        arrivals = _ARRIVALS_PER_BLOCK * turns_of_all(self.weights, len(self.operations))
        least = max(self.least_block_s, self.load.duration_s / _MAX_BLOCKS, arrivals / (self.load.rate or math.inf))
        most = int(self.load.duration_s / least + 1e-9)
        rng = np.random.default_rng([self.load.seed, 1, self.repeat, self.part])
        made: list[Segment] = []
        for number in count():
            turn = self._round(number, swapped=bool(rng.integers(2)))
            if len(made) + len(turn) > most:
                return made or turn[: len(turn) // 2]
            made += turn
        raise AssertionError("rounds without end")

    @property
    def block_s(self) -> float:
        """Return the length of a block."""
        return self.load.duration_s / max(1, self.blocks)

    @cached_property
    def segments(self) -> list[Segment]:
        """Return all segments in order; their numbers begin at `first_segment`."""
        if not self._rounds:
            return []
        made = self._steps() if self.step_rate is not None else [*self._warmup(), *self._duel()]
        return [replace(segment, gap=False) for segment in made] if self.scenario or self.alone else made

    def active_s(self, elapsed_s: float, phases: tuple[str, ...]) -> float:
        """Return for how long requests of some phases could start in the segments that had ended by then."""
        return sum(
            segment.active_s
            for segment in self.segments
            if segment.phase in phases and segment.end_ns <= elapsed_s * _NS + 1
        )

    def again(self) -> Self:
        """Return the next repeat, with a new random order."""
        return replace(self._after(), repeat=self.repeat + 1)

    def more(self) -> Self:
        """Return the next part of the same repeat, without a warm-up, with a new random order."""
        return replace(self._after(), part=self.part + 1, load=replace(self.load, warmup_s=0.0))

    def _after(self) -> Self:
        """Return this plan again, after itself."""
        return replace(
            self, first_segment=self.first_segment + len(self.segments), offset_s=self.offset_s + self.length_s
        )

    @cached_property
    def length_s(self) -> float:
        """Return the time from start to end."""
        return self.segments[-1].end_ns / _NS if self.segments else 0.0

    @property
    def measured_s(self) -> tuple[float, float]:
        """Return when the measured part begins and ends, in seconds from the start."""
        warm = [segment.end_ns for segment in self.segments if segment.phase == "warmup"]
        return max(warm, default=0) / _NS, self.length_s

    @property
    def alone(self) -> bool:
        """Return whether there is one side only: blocks of one interface, client and robot need no gaps between."""
        return self.robots == len(self.interfaces) == len(self.clients) == 1

    def _warmup(self) -> list[Segment]:
        turns = [
            turn
            for turn in product(self.clients, self.interfaces, range(self.robots))
            if self.choices(turn[1], turn[0])
        ]
        if self.load.warmup_s <= 0:
            return []
        blocks = max(len(turns), round(self.load.warmup_s / BLOCK_S))
        rate = self.load.rate or 0.0
        made = []
        for index in range(blocks):
            client, interface, robot = turns[index % len(turns)]
            start, end = (int(self.load.warmup_s * edge / blocks * _NS) for edge in (index, index + 1))
            made.append(Segment(start, end, "warmup", interface, client, "", -1, rate, robot))
        return made

    def _duel(self) -> list[Segment]:
        origin = self.load.warmup_s
        placed = []
        for index, segment in enumerate(self._rounds):
            start, end = (int((origin + self.block_s * edge) * _NS) for edge in (index, index + 1))
            rate = self.load.rate_at((index + 0.5) * self.block_s)
            placed.append(replace(segment, start_ns=start, end_ns=end, rate=rate))
        return placed

    def _round(self, number: int, *, swapped: bool) -> list[Segment]:
        """Return a round's blocks: each interface (or robot) once, and then again in reverse order.

        Of five rounds the second goes to the library clients, the third and the fifth to the A/A control.
        """
        turn = number % _TURNS
        client = self.clients[-1] if turn == _LIBRARY_TURN else self.clients[0]
        itself = _AA_TURNS[self.robots]
        if turn in itself:
            interface = self.interfaces[(number // _TURNS * len(itself) + itself.index(turn)) % len(self.interfaces)]
            sides = [("aa", interface, "a", 0), ("aa", interface, "b", 0)]
        elif self.robots > 1:
            earlier = number - number // _TURNS  # duels before it: interfaces take turns
            interface = self.interfaces[earlier % len(self.interfaces)]
            sides = [("duel", interface, "", 0), ("against", interface, "", 1)]
        else:
            sides = [("duel", interface, "", 0) for interface in self.interfaces if self.choices(interface, client)]
        if swapped:
            sides.reverse()
        if len(sides) == 1:
            sides *= 2  # one interface alone gets as many blocks
        rate = self.load.rate or 0.0
        return [
            Segment(0, 0, phase, interface, client, label, 2 * number + half, rate, robot)
            for half, order in enumerate((sides, sides[::-1]))
            for phase, interface, label, robot in order
        ]

    def _steps(self) -> list[Segment]:
        """Return one step: each interface for `duration_s`, with a pause between for queues to drain."""
        made = []
        at = 0.0
        for interface in self.interfaces:
            pieces = max(1, round(self.load.duration_s / 0.5))
            for piece in range(pieces):
                start, end = (int((at + self.load.duration_s * edge / pieces) * _NS) for edge in (piece, piece + 1))
                made.append(Segment(start, end, "step", interface, "wire", "", -1, float(self.step_rate or 0.0)))
            at += self.load.duration_s + self.settle_s
        return made

    def series_of(self) -> dict[int, int]:
        """Return the series number of each segment."""
        return {
            self.first_segment + index: SERIES.index((segment.phase, segment.interface, segment.client))
            for index, segment in enumerate(self.segments)
        }


#: Every series that there can be: (phase, interface, client). Their numbers are the same in all plans and workers.
SERIES = [
    (phase, interface, client)
    for phase in ("warmup", "duel", "aa", "step", "against")
    for interface in (*INTERFACES, BOTH)
    for client in CLIENTS
]


def step_operation(operations: tuple[str, ...]) -> int:
    """Return the operation of the steps: a read where there is one, because their rates are unusually high."""
    reads = [number for number, name in enumerate(operations) if name not in MOVES]
    return reads[0] if reads else 0


#: A block waits for at most this many calls of each operation: a rare operation is not called in every block.
_MOST_TURNS = 4


def rotation(offered: Sequence[int], weights: Sequence[int]) -> tuple[int, ...]:
    """Return the numbers of the operations in the order in which they are called (nginx's smooth weighted round robin).

    Args:
        offered: the numbers of the operations.
        weights: weights of all operations, by number; empty where they are called equally often.
    """
    if not weights or not offered:
        return tuple(offered)
    own = {number: weights[number] for number in offered}
    total, credit, made = sum(own.values()), dict.fromkeys(offered, 0), []
    for _ in range(total // math.gcd(*own.values())):
        for number, weight in own.items():
            credit[number] += weight
        chosen = max(offered, key=lambda number: credit[number])
        credit[chosen] -= total
        made.append(chosen)
    return tuple(made)


def share(number: int, weights: Sequence[int], operations: int) -> float:
    """Return the share of one operation in the requests for all `operations`."""
    return weights[number] / sum(weights) if weights else 1 / operations


def turns_of_all(weights: Sequence[int], operations: int) -> int:
    """Return how many requests it takes until each operation has been called, up to four for each operation."""
    if not weights:
        return operations
    return min(sum(weights) // math.gcd(*weights), _MOST_TURNS * operations)
