"""Find how a device is sent to positions, by moving it a little: the positions that a reading also contains."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from statistics import median
from typing import Any, Final

from conformance.engine.commanded import FAST, Commanded, axis_of, body_schema, bounds_of, numbers_in, parts_of, unit_of
from conformance.engine.driven_numbers import ANGLE
from conformance.engine.finding import AT_REST, ECHO, REFUSED, Finder
from conformance.engine.map_text import inline, key, string
from conformance.measures.samples import SEVERAL, Noise, slope
from conformance.scenarios.motion.templates import fill
from conformance.scenarios.scenario import NotPossibleError
from conformance.transport.exchange import Exchange

# _BEFORE_S: how long the device is watched before and after a small move. _MOVES_S: time for the move, s.
_BEFORE_S, _MOVES_S = 0.25, 3.0
# After this time no further axis is tried, s.
_BUDGET_S: Final = 16.0
# _PARTS: shares of a small move that are tried. _FOLLOWS: share by which an axis may miss its target or move along.
_PARTS, _FOLLOWS = (0.2, 1.0), 0.15
# No angle is limited to so many rad; the status of a move that must wait for another one.
_RAD, _CONFLICT = 7.0, 409


@dataclass(frozen=True)
class Moved:
    """How an axis followed a target.

    Attributes:
        place: where it is read.
        took_s: time until it was there, s.
        off: how far from its target it rested.
        sigma: the standard deviation of its noise.
        way: how far it was sent.
        ways: the ways on which it followed, with signs.
    """

    place: str
    took_s: float
    off: float
    sigma: float
    way: float
    ways: tuple[float, ...] = ()


class PositionFinder(Finder):
    """Finds the map of a device that is sent to positions."""

    seconds = 0.5

    def _find(self) -> None:
        self._refused: list[str] = []
        self._watch_at_rest()
        counts = {operation.label: self._named_places(operation.label) for operation in self._reads}
        read = max(counts, key=lambda label: (len(counts[label]), self._is_called_alike(label)))
        if not counts[read]:
            wanted = ", ".join(command.name for command in self._plan.numbers)
            raise NotPossibleError(
                f"{self._plan.drive.label} takes {wanted}, and {', '.join(counts)} tell no number of such a name: "
                "give --read, or write a map (docs/motion.md)"
            )
        self._reads = [operation for operation in self._reads if operation.label == read]
        self._relative = all(command.is_relative for command in self._plan.numbers if command.name in counts[read])
        schemas = dict(numbers_in(self._reads[0].shape or {}))
        self._schemas = {name: schemas.get(place, {}) for name, place in counts[read].items()}
        self._places = counts[read]
        begun = self._clock.now() - _BEFORE_S
        start = {
            name: median(value for _, value in self._looks.samples(read, place, begun))
            for name, place in counts[read].items()
        }
        moved: dict[str, Moved] = {}
        until = self._clock.now() + _BUDGET_S
        try:
            for number in self._plan.numbers:
                if number.name in start and self._clock.now() > until:
                    self._found.notes.append(f"{number.name} stays where it is: {_BUDGET_S:g} s were over.")
                elif number.name in start:
                    found = self._try_axis(number, counts[read], start)
                    if found is not None:
                        moved[number.name] = found
        finally:
            if not self._relative:
                self._command(start)
        if not moved and self._refused:
            raise NotPossibleError(self._refused[0])
        if not moved:
            said = " ".join(self._found.notes)
            raise NotPossibleError(f"{self._plan.drive.label} was accepted, and {read} followed no target: {said}")
        self._found.lines = list(self._goto_lines(read, start, moved))

    @property
    def _body(self) -> dict[str, Any] | None:
        """The body of a move: optional inputs are left out, so that other parts of the robot stay where they are."""
        own = (number for number in self._plan.numbers if number.name in self._places)
        return self._template({number.place: f"{{{number.name}}}" for number in own})

    def _is_called_alike(self, operation: str) -> bool:
        """Return whether an operation is called as something that is commanded."""
        called = operation.rpartition("/")[2].lower()
        return any(command.place.strip("{}").rpartition("/")[2].lower() == called for command in self._plan.numbers)

    def _named_places(self, operation: str) -> dict[str, str]:
        """Return the places of an operation's numbers, by the name of the commanded number they share."""
        places, found = self._looks.places(operation), dict[str, str]()
        for number in self._plan.numbers:
            words = number.place.strip("{}").split("/")
            own = words[-1].lower()
            same = [place for place in places if place.rpartition("/")[2].partition(ANGLE)[0].lower() == own]
            same = same or [place for place in places if not FAST.search(place) and axis_of(place) == axis_of(own)]
            if own in operation.rpartition("/")[2].lower() and not ECHO.search(operation):
                same += [place for place in places if place.lower() in {"", "/value", f"/{own}/value"}]
            # Of several members, prefer the one whose path is most like the command's.
            same.sort(key=lambda text: (bool(ECHO.search(text)), -len(set(words) & set(text.split("/")))))
            if same and same[0] not in found.values():
                found[number.name] = same[0]
        return found

    def _try_axis(self, number: Commanded, places: Mapping[str, str], start: Mapping[str, float]) -> Moved | None:
        """Move one axis a little to each side, less far if it does not arrive; return how it followed, or None."""
        found, why = None, "its limits leave no room"
        # With declared limits, a part of them is safe; without, start with the smallest move.
        for part in _PARTS[1:] if number.bounds else _PARTS:
            little = part * number.little
            tries: list[Moved] = []
            for way in (little, -little) if part == _PARTS[-1] else (little,):
                limits = self._limits(number)
                if limits and not limits[0] <= start[number.name] + way <= limits[1]:
                    continue
                one = self._move_axis(number, places, start, way)
                if isinstance(one, str):
                    why = one
                    tries.clear()
                    break
                tries.append(one)
            if not tries:
                break
            found = Moved(
                tries[0].place,
                max(move.took_s for move in tries),
                max(move.off for move in tries),
                max(move.sigma for move in tries),
                little,
                tuple(move.ways[0] for move in tries),
            )
        if found is None:
            self._found.notes.append(f"{number.name} stays where it is: {why}.")
        return found

    def _limits(self, number: Commanded) -> tuple[float, float] | None:
        """Return the limits of a position that are declared, where it is read or where it is commanded; or None."""
        return bounds_of(self._schemas[number.name]) or (None if self._relative else number.bounds)

    def _sent_by(self, start: Mapping[str, float], name: str, way: float) -> Exchange:
        """Send one axis farther by a way; a device that is still busy with its last move gets time to end that."""
        values = {name: way} if self._relative else {**start, name: start[name] + way}
        until = self._clock.now() + _MOVES_S
        while True:
            exchange = self._command(values)
            if exchange.response.status != _CONFLICT or not self._relative or self._clock.now() > until:
                return exchange
            self._look()

    def _move_axis(
        self, number: Commanded, places: Mapping[str, str], start: Mapping[str, float], way: float
    ) -> Moved | str:
        """Send one axis a little farther, and back; return how it followed, or why it counts as no axis of its own."""
        place, read, goal = places[number.name], self._reads[0].label, start[number.name] + way
        rested = self._clock.now()
        self._watch(_BEFORE_S)
        sigma = Noise.of([value for _, value in self._looks.samples(read, place, rested)]).sigma
        exchange = self._sent_by(start, number.name, way)
        sent = self._clock.now()
        if not exchange.response.ok:
            said = exchange.response.body[:300].decode("utf-8", "replace")
            self._refused.append(f"{self._plan.drive.label} with {number.name} {goal:.4g} got {exchange.came}: {said}")
            return self._refused[-1]
        self._answer = self._binding.content(exchange.response.body)
        near = max(_FOLLOWS * abs(way), 6 * sigma)

        def is_there() -> bool:
            last = [value for _, value in self._looks.samples(read, place, sent)[-SEVERAL:]]
            return len(last) == SEVERAL and all(abs(number - goal) < near for number in last)

        while self._clock.now() < sent + _MOVES_S and not is_there():
            self._look()
        took_s = self._clock.now() - sent
        self._watch(_BEFORE_S)
        ends = {
            name: median(value for _, value in self._looks.samples(read, at, sent)[-SEVERAL:])
            for name, at in places.items()
        }
        self._sent_by(start, number.name, -way if self._relative else 0.0)
        self._watch(max(_BEFORE_S, took_s))
        if abs(ends[number.name] - goal) > near:
            return f"sent to {goal:.4g}, it came to {ends[number.name]:.4g}"
        for name, end in ends.items():
            own = next(command.little for command in self._plan.numbers if command.name == name)
            if name != number.name and abs(end - start[name]) > max(_FOLLOWS * own, _FOLLOWS * abs(way)):
                return f"with it {name} went from {start[name]:.4g} to {end:.4g}"
        return Moved(place, took_s, abs(ends[number.name] - goal), sigma, abs(way), (way,))

    def _goto_lines(self, read: str, start: Mapping[str, float], moved: Mapping[str, Moved]) -> Iterator[str]:
        numbers = {command.name: command for command in self._plan.numbers if command.name in moved}
        still = {name: round(start[name], 5) for name in start.keys() - moved.keys()}
        yield "[motion.state]"
        yield f"read = {string(read)}"
        yield "fresh_s = 1.0  # the suite's"
        yield ""
        yield "[motion.state.axes]"
        widest = 0.0
        for name, found in moved.items():
            number, here = numbers[name], start[name]
            near = (here + min(0.0, *found.ways), here + max(0.0, *found.ways))
            declared = self._limits(number)
            limits = [round(one, 4) for one in declared or near]
            widest = max(widest, (limits[1] - limits[0]) / found.way)
            pointer, _, angle = found.place.partition(ANGLE)
            given: dict[str, Any] = {"at": pointer, "unit": self._unit(number, found), "limits": limits}
            drift = slope(self._at_rest(read, found.place)) or 0.0
            given["rest"] = float(f"{max(AT_REST * found.way / found.took_s, 3 * abs(drift)):.3g}")
            given["tolerance"] = round(max(2 * found.off, 8 * found.sigma, 0.2 * found.way), 5)
            given |= ({"angle": angle} if angle else {}) | ({} if declared else {"bound": False})
            source = "as declared" if declared else "none are declared; so far it was seen to go"
            yield f"{key(name)} = {inline(given)}  # limits: {source}"
        yield ""
        yield "[motion.goto]"
        template, lasts = self._plan.drive.label, "{seconds}" in inline(self._body or {})
        for name, value in still.items():
            template = template.replace(f"{{{name}}}", f"{value:g}")
        yield f"send = {string(template)}"
        if self._body is not None:
            named = {name: f"{{{name}}}" for name in moved}
            yield f"body = {inline(fill(self._body, {**named, **still, 'seconds': '{seconds}', 'lease': '{lease}'}))}"
        if self._relative:
            yield "relative = true"
            yield 'while_moving = "refused"  # no second move is sent before the first one has ended'
        slowest = max(move.took_s for move in moved.values())
        if lasts:
            settle_s = max(0.5, slowest - self.seconds + 0.3)
            yield f"seconds = {self.seconds}  # the suite's: the duration that it asks for"
            yield f"settle_s = {settle_s:.2f}  # seen: a move of {self.seconds} s took {slowest:.2f} s"
        else:
            yield f"within_s = {2.0 + slowest * widest:.1f}  # seen: a part of the way took {slowest:.2f} s"
        off = max(max(2 * move.off, 8 * move.sigma) for move in moved.values())
        yield f"tolerance = {off + 0.01:.3g}  # twice what was seen, and room"
        if REFUSED & self._plan.drive.responses.keys() and all(map(self._limits, numbers.values())):
            yield 'beyond_limits = "refused"  # the description declares limits, and a response for invalid requests'
        yield from self._stop_lines()

    def _unit(self, number: Commanded, found: Moved) -> str:
        """Return the unit of an axis by its name or description; of what turns, rad, which a turn of 7 is not."""
        declared = self._limits(number) or (0.0, 0.0)
        said = unit_of(found.place, self._schemas[number.name]) or unit_of(number.place, number.schema)
        return said or ("rad" if number.turns and max(map(abs, declared)) < _RAD else "")

    def _stop_lines(self) -> Iterator[str]:
        """Yield the stop beside the operation that moves the device, if its parameters are known."""
        stop = self._plan.stop
        if stop is None:
            return
        schema = body_schema(stop)
        wanted = [name for part in parts_of(schema) for name in part.get("required", ())]
        told = self._answer if isinstance(self._answer, dict) else {}
        if any(name not in told for name in wanted):
            self._found.notes.append(f"{stop.label} is not used: what it takes ({', '.join(wanted)}) is not known.")
            return
        yield ""
        yield "[motion.stop]"
        yield f"send = {string(stop.label)}"
        if wanted:
            yield f"body = {inline({name: f'{{goto:/{name}}}' for name in wanted})}"
        yield "rests_within_s = 1.0  # the suite's"
