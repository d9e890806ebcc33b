"""Find how a device is sent to positions, by moving it a little: the positions that a reading also contains."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import astuple, dataclass
from statistics import median
from typing import Any, Final

from conformance.engine.commanded import (
    FAST,
    Commanded,
    body_schema,
    bounds_of,
    is_axis,
    member_name,
    numbers_in,
    unit_of,
)
from conformance.engine.driven_numbers import ANGLE
from conformance.engine.finding import AT_REST, FARTHEST, READY_S, Finder
from conformance.engine.map_text import inline, key, string
from conformance.measures.samples import SEVERAL, Noise, Sample, slope
from conformance.scenarios.scenario import NotPossibleError
from conformance.transport.exchange import Exchange

_BEFORE_S = 0.25  # how long the device is watched before and after a small move
_MOVES_S = 3.0  # time for a small move, s
# After this time no further axis is tried, s.
_BUDGET_S: Final = 16.0
# Shares of a small move that are tried; a device without limits that is there sooner than in about _SEEN_S, s, goes up
# to FARTHEST of them.
_PARTS = (0.2, 1.0)
_FOLLOWS = 0.15  # share of a move by which an axis may miss its target, or move when another axis is commanded
_SEEN_S = 1.0
_SLOW_S = 2.5  # an axis whose move takes this long gets no farther target, s
_SHARES: Final = (1.0, -1.0, 0.8, -0.8, 0.6, -0.6, 0.5, -0.5)  # of axes that move at once, how far each is sent
# Names of members with the least and the greatest value of a position in the same reading.
_LIMITS: Final = (
    ("limits/0", "limits/1"),
    ("limits/min", "limits/max"),
    ("limits/lower", "limits/upper"),
    ("min", "max"),
)
# Share of the ways on which axes without limits were seen to go that is tried of several.
_TOGETHER: Final = 0.5
# How long a way may take by what a small move took, so that the limits are tried, s.
_FULL_WAY_S: Final = 5.0
_LONGEST_S = 12.0  # how long a device that still moves is watched
_PAUSES_S = 1.0  # a longer rest ends a move, s
_RAD = 7.0  # an axis with a greater limit is no angle in rad
_CONFLICT = 409  # status of a move that must wait for another one


@dataclass(frozen=True)
class Moved:
    """How an axis followed a target.

    Attributes:
        took_s: time until it was there, s.
        off: how far from its target it rested.
        sigma: the standard deviation of its noise.
        way: how far it was sent.
        ways: the ways on which it followed, with signs.
    """

    took_s: float
    off: float
    sigma: float
    way: float
    ways: tuple[float, ...] = ()


def _worst(tries: Sequence[Moved]) -> Moved:
    """Return how an axis followed at worst."""
    took_s, off, sigma, way = (max(values) for values in zip(*(astuple(one)[:4] for one in tries), strict=True))
    return Moved(took_s, off, sigma, way, tuple(way for one in tries for way in one.ways))


def _off(start: float, way: float, end: float, near: float) -> float:
    """Return how far from its target an axis rests; 0 too if it went as far the wrong way, which is judged."""
    wrong = way and min(abs(end - start + way), abs(end + start + way)) < near
    return 0.0 if wrong else abs(end - start - way)


def _spread(samples: Sequence[Sample]) -> float:
    return max(value for _, value in samples) - min(value for _, value in samples)


class PositionFinder(Finder):
    """Finds the map of a device that is sent to positions."""

    seconds = 0.5

    def _find(self) -> None:
        self._refused: list[str] = []
        self._watch_at_rest()
        self._places = self._looks.places_of(
            self._plan.numbers, self._plan.drive.template, [one.label for one in self._reads]
        )
        if not self._places:
            wanted = ", ".join(command.name for command in self._plan.numbers)
            raise NotPossibleError(
                f"{self._plan.drive.label} takes {wanted}, and {', '.join(one.label for one in self._reads)} tell no "
                "number of such a name: give --read, or write a map (docs/motion.md)"
            )
        self._reads = [one for one in self._reads if one.label in dict(self._places.values())]
        self._numbers = {command.name: command for command in self._plan.numbers if command.name in self._places}
        numbers = list(self._numbers.values())
        self._relative, self._refuses = all(command.is_relative for command in numbers), False
        schemas = {one.label: dict(numbers_in(one.shape or {})) for one in self._reads}
        self._schemas = {name: schemas[read].get(place, {}) for name, (read, place) in self._places.items()}
        # A move to where it is shows what the device wants before it moves, which may move it.
        self._command(dict.fromkeys(self._places, 0.0) if self._relative else self._ends())
        self._watch(_BEFORE_S)
        while self._used.steps and self._clock.now() < self._asked + READY_S and self._moves():
            self._watch(_BEFORE_S)
        start, self._stood = self._ends(), False
        self._turned = False
        self._gone, self._why = dict.fromkeys(start, 0.0), dict[str, str]()
        until = self._clock.now() + _BUDGET_S
        try:
            moved, tried = self._try_axes(numbers, start), set(self._numbers)
            # If some axes moved and others did not, try the moved ones alone: one axis may block another.
            while 1 < len(moved) < len(tried):
                tried = set(moved)
                moved = self._try_axes([self._numbers[name] for name in moved], start)
            for number in numbers if len(numbers) > 1 else ():
                if not moved and self._clock.now() < until:
                    moved = self._try_axes([number], start)
        finally:
            if not self._relative:
                self._command(start)
        left = [number.name for number in numbers if number.name not in moved]
        self.notes += [f"{name} stays where it is: {self._why.get(name, 'there was no time')}." for name in left]
        if not moved:
            why = f"was accepted, and no axis followed a target: {' '.join(self.notes)}"
            raise NotPossibleError(next(iter(self._refused), f"{self._plan.drive.label} {why}"))
        self.lines = list(self._goto_lines(start, moved))

    def _ends(self) -> dict[str, float]:
        """Return where each axis is, by the last readings."""
        return {name: median(value for _, value in self._samples(name, 0.0)[-SEVERAL:]) for name in self._places}

    @property
    def _body(self) -> Any:
        """The body of a move: optional inputs are left out, so that other parts of the robot stay where they are."""
        own = (number for number in self._plan.numbers if number.name in self._places)
        return self._template({at: value for number in own for at, value in number.templates.items()})

    @property
    def _lasts(self) -> bool:
        """Whether a move lasts as long as is asked for: as long to any place."""
        return "{seconds}" in inline(self._body or {})

    def _try_axes(self, numbers: Sequence[Commanded], start: Mapping[str, float]) -> dict[str, Moved]:
        """Move axes at once, a little to each side; return how each followed. Without limits, first less far."""
        found, kept = dict[str, list[Moved]](), dict[str, Moved]()
        is_free = not all(map(self._limits, numbers))
        parts = list(_PARTS[all(number.bounds for number in numbers) :])
        for part in parts:
            if part != parts[0] and not (found or self._stood):
                break
            left, found, lost = [number for number in numbers if number.name in found] or numbers, {}, set[str]()
            # No two axes go as far, so that exchanged ones show.
            ways = {one.name: part * share * one.little for one, share in zip(left, _SHARES, strict=False)}
            for side in (1, -1, 0) if part >= 1 else (1, 0):
                if side < 0 and not is_free and len(found) == len(left):
                    continue  # declared limits are judged later
                room = {
                    name: side * way for name, way in ways.items() if self._has_room(name, start[name] + side * way)
                }
                moved = self._move_axes(start, room, ways) if room else None
                # An axis that moves in one direction only may stand at an end of its travel.
                lost |= room.keys() - moved.keys() if moved is not None and not self._stood else set()
                for name, one in (moved or {}).items() if side or found else ():
                    found.setdefault(name, []).append(one)
            found = {name: own for name, own in found.items() if name not in lost}
            kept |= {name: _worst(own) for name, own in found.items()}
            took_s = max((one.took_s for one in kept.values()), default=0.0)
            if part < 1 and took_s > _SLOW_S and len(numbers) == 1 and not self._lasts:
                break
            share = 1.0 if len(numbers) == 1 else _TOGETHER
            if is_free and part == 1 and found and share * took_s < _SEEN_S / 2:
                # It is there too soon to be stopped under way.
                parts.append(min(FARTHEST, _SEEN_S / took_s / share))
            elif is_free and part == 1 and not found and all(number.turns for number in numbers):
                # An angle that stays where it is may be one in degrees.
                parts.append(FARTHEST)
        return kept

    def _has_room(self, name: str, goal: float) -> bool:
        """Return whether a target is within the declared limits; without any, it is."""
        limits = self._limits(self._numbers[name])
        if limits is None or limits[0] <= goal <= limits[1]:
            return True
        self._why.setdefault(name, "its limits leave no room")
        return False

    def _limits(self, number: Commanded) -> tuple[float, float] | None:
        """Return the limits of a position that are declared, or that the same reading contains; or None."""
        told = bounds_of(self._schemas[number.name])
        return told or (None if self._relative else number.bounds) or self._limits_beside(number.name)

    def _limits_beside(self, name: str) -> tuple[float, float] | None:
        """Return the limits that a reading contains for a position; or None."""
        read, place = self._places[name]
        beside = place.rpartition("/")[0]
        for least, most in _LIMITS:
            ends = [self._looks.samples(read, f"{beside}/{at}", 0.0)[-1:] for at in (least, most)]
            if all(ends) and ends[0][0][1] < ends[1][0][1]:
                return ends[0][0][1], ends[1][0][1]
        return None

    def _send_by(self, start: Mapping[str, float], ways: Mapping[str, float]) -> Exchange:
        """Send axes by ways from where they were at first; a device that is busy gets time to end its last move."""
        goals = {name: ways.get(name, 0.0) for name in start}
        values = {name: way - (self._gone[name] if self._relative else -start[name]) for name, way in goals.items()}
        until = self._clock.now() + _MOVES_S
        exchange = self._command(values)
        while exchange.response.status == _CONFLICT and self._clock.now() < until:
            self._refuses = True
            self._look()
            exchange = self._command(values)
        self._gone = goals if self._took(exchange) else self._gone
        return exchange

    def _move_axes(
        self, start: Mapping[str, float], ways: Mapping[str, float], sizes: Mapping[str, float]
    ) -> dict[str, Moved] | None:
        """Send axes by ways, and watch; return how each followed, and keep why others count as no axes of their own.

        Args:
            start: where they were at first.
            ways: how far from there; 0 means back.
            sizes: how far they are sent at most, by which it is judged whether one is there.

        Returns:
            None if it was refused.
        """
        rested = self._clock.now()
        self._watch(_BEFORE_S)
        before, goals = self._ends(), {name: start[name] + way for name, way in ways.items()}
        sigmas = {name: Noise.of([value for _, value in self._samples(name, rested)]).sigma for name in ways}
        exchange = self._send_by(start, ways)
        sent = self._clock.now()
        said = " and ".join(f"{name} {goal:.4g}" for name, goal in goals.items())
        if not self._took(exchange):
            words = exchange.response.body[:300].decode("utf-8", "replace")
            self._refused.append(f"{self._plan.drive.label} with {said} got {exchange.came}: {words}")
            self._why |= dict.fromkeys(ways, self._refused[-1])
            self._stood = False
            return None
        self._answer = self._binding.content(exchange.response.body)
        near = {name: max(_FOLLOWS * abs(sizes[name]), 6 * sigmas[name]) for name in ways}
        took_s: dict[str, float] = {}
        # A device may show where it is at the end of a move only.
        least_s = _MOVES_S if len(ways) > 1 else 2 * _MOVES_S
        while (now := self._clock.now()) < sent + least_s or (now < sent + _LONGEST_S and self._moves()):
            self._look()
            for name in ways:
                last = [value for _, value in self._samples(name, sent)[-SEVERAL:]]
                if len(last) == SEVERAL and all(abs(value - goals[name]) < near[name] for value in last):
                    took_s.setdefault(name, self._clock.now() - sent)
            ends = self._ends()
            has_moved = any(abs(ends[name] - before[name]) > near[name] for name in ways)
            if len(took_s) == len(ways) or (has_moved and now > sent + _PAUSES_S and not self._moves()):
                break
        self._watch(_BEFORE_S)
        ends = self._ends()
        self._gone = {name: ends[name] - start[name] for name in ends} if self._relative and not took_s else self._gone
        if any(ways.values()):
            self._stood = all(abs(ends[name] - start[name]) < near[name] / 2 for name in ways)
        beside = {
            one.name: f"with it {one.name} went from {start[one.name]:.4g} to {ends[one.name]:.4g}"
            for one in self._numbers.values()
            if one.name not in ways
            and abs(ends[one.name] - start[one.name]) > _FOLLOWS * max(one.little, *map(abs, sizes.values()))
        }
        if self._goes_the_other_way({name: (ends[name] - before[name], way) for name, way in ways.items()}):
            ways = {name: -way for name, way in ways.items()}
            goals = {name: start[name] + way for name, way in ways.items()}
        found: dict[str, Moved] = {}
        for name, way in ways.items():
            off = _off(start[name], way, ends[name], near[name])
            if off > near[name] or beside:
                came = f"sent to {goals[name]:.4g}, it came to {ends[name]:.4g}"
                self._why[name] = next(iter(beside.values()), came) if off <= near[name] else came
            else:
                found[name] = Moved(took_s.get(name, self._clock.now() - sent), off, sigmas[name], abs(way), (way,))
        return found

    def _goes_the_other_way(self, ways: Mapping[str, tuple[float, float]]) -> bool:
        """Return whether a number went the other way by as much, and exchange the words for its directions."""
        (gone, way), (name, *more) = next(iter(ways.values())), ways
        number = self._numbers[name]
        if more or self._turned or not way or number.direction is None or abs(gone + way) > _FOLLOWS * abs(way):
            return False
        self._turned, self._numbers[name] = True, self._turn_words(number)
        self._gone = {name: gone}
        return True

    def _samples(self, name: str, begin: float) -> list[Sample]:
        return self._looks.samples(*self._places[name], begin)

    def _moves(self) -> bool:
        """Return whether any number that may be an axis still changes: a device may have to turn before it drives."""
        since = self._clock.now() - _PAUSES_S
        for read in (operation.label for operation in self._reads):
            for place in filter(lambda text: is_axis(member_name(text)), self._looks.places(read)):
                seen, rest = self._looks.samples(read, place, since), self._at_rest(read, place)
                if len(seen) > SEVERAL and _spread(seen) > 3 * _spread(rest):
                    return True
        return False

    def _goto_lines(self, start: Mapping[str, float], moved: Mapping[str, Moved]) -> Iterator[str]:
        numbers = {command.name: command for command in self._plan.numbers if command.name in moved}
        still = {name: round(start[name], 5) for name in start.keys() - moved.keys()}
        read = self._places[next(iter(moved))][0]
        yield "[motion.state]"
        yield f"read = {string(read)}"
        yield "fresh_s = 1.0  # the suite's"
        yield ""
        yield "[motion.state.axes]"
        limits = {name: self._tried_limits(numbers[name], start[name], found) for name, found in moved.items()}
        for name, found in moved.items():
            own, place = self._places[name]
            pointer, _, angle = place.partition(ANGLE)
            given: dict[str, Any] = {"at": pointer, "unit": self._unit(numbers[name]), "limits": list(limits[name])}
            given |= {"read": own} if own != read else {}
            drift = slope(self._at_rest(own, place)) or 0.0
            given["rest"] = float(f"{max(AT_REST * found.way / found.took_s, 3 * abs(drift)):.3g}")
            least, most = limits[name]
            given["tolerance"] = round(
                max(2 * found.off, 8 * found.sigma, min(0.2 * found.way, 0.1 * (most - least))), 5
            )
            declared = self._limits(numbers[name])
            given |= ({"angle": angle} if angle else {}) | ({} if declared else {"bound": False})
            given |= {"speed": speed} if (speed := self._fastest(numbers[name])) else {}
            own_source = numbers[name].source if declared == numbers[name].bounds else "as declared"
            source = own_source if declared else "none are declared; so far it was seen to go"
            if declared and limits[name] != declared:
                given["accepts"], source = list(declared), "nearby, as the declared ones are far away"
            yield f"{key(name)} = {inline(given)}  # limits: {source}"
        widest = max((limits[name][1] - limits[name][0]) / found.way for name, found in moved.items())
        yield ""
        yield "[motion.goto]"
        yield from self._sending_lines(moved, still, "{seconds}")
        if self._relative:
            yield "relative = true"
        if self._relative or self._refuses:
            yield 'while_moving = "refused"  # no second move is sent before the first one has ended'
        elif self._plan.replaces:
            yield 'while_moving = "displaces"  # as the description says'
        slowest = max(move.took_s for move in moved.values())
        if self._lasts:
            settle_s = max(0.5, slowest - self.seconds + 0.3)
            yield f"seconds = {self.seconds}  # the suite's: the duration that it asks for"
            yield f"settle_s = {settle_s:.2f}  # seen: a move of {self.seconds} s took {slowest:.2f} s"
        else:
            yield f"within_s = {2.0 + slowest * widest:.1f}  # seen: a part of the way took {slowest:.2f} s"
        off = max(max(2 * move.off, 8 * move.sigma) for move in moved.values())
        yield f"tolerance = {off + 0.01:.3g}  # twice what was seen, and room"
        # If limits are only in prose, the device need not refuse targets beyond them.
        by_schema = all(self._limits(one) and (bounds_of(one.schema) or not one.bounds) for one in numbers.values())
        yield from self._refusal_lines(declared=by_schema)
        yield from self._stop_lines(1.0, "the suite's")

    def _fastest(self, number: Commanded) -> float:
        """Return the greatest speed of a move that is declared in the unit of its axis; 0 if none is."""
        unit = self._unit(number)
        speeds = (Commanded("", *one, turns=False) for one in numbers_in(body_schema(self._plan.drive) or {}))
        known = (one for one in speeds if FAST.search(one.place) and one.bounds and one.has_unit)
        return max(
            (one.bounds[1] for one in known if one.bounds and unit_of("", one.schema) == unit != ""), default=0.0
        )

    def _tried_limits(self, number: Commanded, here: float, found: Moved) -> tuple[float, float]:
        """Return the limits that are declared, or those so far seen, if there are none or they are far away."""
        declared = self._limits(number)
        # A move with a duration takes as long to any place.
        if declared and (self._lasts or found.took_s * (declared[1] - declared[0]) <= _FULL_WAY_S * found.way):
            return declared
        if declared:
            # A device that is too fast shows that on a way of a second.
            way = max(found.way, self._fastest(number) / 2)
            return max(declared[0], round(here - way, 4)), min(declared[1], round(here + way, 4))
        # Together, axes without limits may not go as far as they were seen to go.
        share = 1.0 if len(self._numbers) == 1 else _TOGETHER
        return round(here + share * min(0.0, *found.ways), 4), round(here + share * max(0.0, *found.ways), 4)

    def _unit(self, number: Commanded) -> str:
        """Return the unit of an axis by its name or description; of what turns, rad, which a turn of 7 is not."""
        near = self._limits(number) or tuple(value for _, value in self._samples(number.name, 0.0))
        said = unit_of(self._places[number.name][1], self._schemas[number.name]) or unit_of(number.place, number.schema)
        return said or ("rad" if number.turns and max(map(abs, near)) < _RAD else "")
