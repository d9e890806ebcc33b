"""Find by driving a device a little which of its numbers shows each velocity that it is given."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from statistics import median
from typing import Any, Final

from conformance.documents.json_schema import Schema
from conformance.engine.commanded import (
    Commanded,
    axis_of,
    body_schema,
    bounds_of,
    is_axis,
    lasting,
    member_name,
    numbers_in,
    unique_names,
    unit_of,
)
from conformance.engine.driven_numbers import ANGLE, ECHO
from conformance.engine.finding import AT_REST, ROOM_M, ROOM_S, Finder
from conformance.engine.map_text import inline, key, string
from conformance.measures.responses import Response, agreement, response_to, rests_from
from conformance.measures.samples import SEVERAL, Sample, slope
from conformance.scenarios.scenario import NotPossibleError

_DRIVEN_S = 0.7  # duration of a drive, s
_KEPT_S = 0.1  # interval of commands during a drive, s
_BEFORE_S, _AFTER_S = 0.25, 0.6  # how long the device is watched before and after a drive, s
_LET_GO_S = 10.0  # how long the suite waits at most without a command for the device to stop, s
_SURE_S = 0.5  # how long the device must rest to count as stopped, s
_DEMANDED_S = 2.0  # hold time that the device must keep if it neither showed nor declares one, s
_LONGER = 1.5  # factor by which a declared hold time may be off
# Names of the units (of length, of angle), by how many of them make one metre or one radian.
_UNITS: Final = {1.0: ("m", "rad"), 100.0: ("cm", ""), 1000.0: ("mm", ""), math.degrees(1): ("", "deg")}
_NEAR: Final = 2.0
_FULL = 0.8  # a device that still has this share of its velocity has not begun to stop
_LATE_S = 0.15  # how much longer than the start of the drive the start of the stop may take, s
# A device that obeys a stop must stand before this share of the hold time: after that, the hold time may have ended it.
_STILL_HELD: Final = 0.8
_STOPS_S: Final = 4.0  # how long the suite waits for the device to stand after a stop, s
_OTHER: Final = 4.0  # rates that differ by more than this factor have different units
_ROOM_RAD: Final = 3.0  # greatest turn, rad
_OFF, _OFF_WITHOUT_UNIT = 0.15, 0.25  # error that a velocity may have, as a share of the fastest one
_COORDINATES: Final = frozenset("xyz")


class VelocityFinder(Finder):
    """Finds the map of a device that is given velocities."""

    def halt(self) -> str:
        """Command velocity 0, without renewing a lease: the process that guards the run may send it as well."""
        exchange = self._exchange(self._ready.with_lease(self._binding.make(*self._call_and_body({}))))
        return "" if self._took(exchange) else f"{self._plan.drive.label} with velocity 0 got {exchange.came}"

    def _find(self) -> None:
        try:
            responses = self._responses()
            shown = self._measures(responses)
            name, (place, response) = next(iter(shown.items()))
            numbers = {command.name: command for command in self._plan.numbers}
            hold_s = self._hold_s(numbers[name], place, response)
            settle_s = max(self._settle_s, *(self._rises_s(numbers[name], *seen) for name, seen in shown.items()))
            stops_s = self._stops_s(numbers[name], place, response)
        finally:
            self._command({})
        self.lines = list(self._lines(responses, shown, settle_s, hold_s))
        if stops_s is not None:
            # A stop that takes as long as the end of the hold time stops nothing.
            most_s = 2.0 if hold_s is None else min(2.0, _STILL_HELD * hold_s)
            rests_s = max(min(settle_s, 2.0) + _LATE_S, min(1.5 * stops_s + _LATE_S, most_s))
            self.lines += self._stop_lines(rests_s, "seen: how long it took to rest, and half as long again")

    def _drive(self, number: Commanded, speed: float, *, end: bool = True) -> tuple[float, float]:
        """Drive at a velocity and end it; return when it had begun, and when the last command was answered.

        Raises:
            NotPossibleError: it was refused.
        """
        begun = last = 0.0
        until = math.inf
        while self._clock.now() < until:
            if self._clock.now() >= last + _KEPT_S:
                exchange = self._command({number.name: speed})
                last = self._clock.now()
                if not self._took(exchange):
                    said = exchange.response.body[:300].decode("utf-8", "replace")
                    raise NotPossibleError(
                        f"{self._plan.drive.label} with {number.name} {speed:g} got {exchange.came}: {said}"
                    )
                begun, until = (begun, until) if begun else (last, last + _DRIVEN_S)
            self._look()
        if end:
            self._command({})
        return begun, last

    def _responses(self) -> dict[str, dict[tuple[str, str], Response]]:
        """Return how each read number changes, by commanded number, operation and place.

        Raises:
            NotPossibleError: all of what can be commanded was refused.
        """
        self._watch_at_rest()
        found: dict[str, dict[tuple[str, str], Response]] = {}
        refused: dict[str, NotPossibleError] = {}
        self._late = dict[str, str]()
        self._settle_s, self._first = 0.3, dict[str, float]()
        self._other_way = dict[str, None]()
        for number in self._plan.numbers:
            try:
                drives = self._forth_and_back(number)
            except NotPossibleError as problem:
                # A body may have numbers that the device cannot drive, such as the vertical velocity of a rover's
                # Twist.
                refused[number.name] = problem
                found[number.name] = {}
                continue
            found[number.name] = self._alike(drives)
            positions = [one for one in found[number.name].values() if one.is_position]
            if number.direction and positions and all(one.ratio < 0 for one in positions):
                # Which of two words is the positive one, only the position says.
                self._turn_words(number)
                self._other_way.clear()
                drives = [(-speed, *moments) for speed, *moments in drives]
                found[number.name] = {at: one._replace(ratio=-one.ratio) for at, one in found[number.name].items()}
            late_s = max(
                (self._late_s(*at, drives[-1], one.ratio) for at, one in found[number.name].items() if one.is_position),
                default=0.0,
            )
            for (operation, place), response in found[number.name].items():
                speed, _, _, ended, done = drives[-1]
                after = self._looks.samples(operation, place, ended, done)
                since = rests_from(after, response.sigma, response.ratio * speed)
                took_s = max(0.0, since - ended - late_s) if since else 0.0 if late_s else None
                self._settle_s = max(self._settle_s, 1.0 if took_s is None else 1.5 * took_s + 0.15)
        if len(refused) == len(self._plan.numbers):
            raise next(iter(refused.values()))
        self.notes += [f"{name} stays 0: {problem}" for name, problem in refused.items()]
        self.notes += self._late.values()
        self._refused = frozenset(refused)
        return found

    def _late_s(self, operation: str, place: str, drive: Sequence[float], ratio: float) -> float:
        """Return for how long a device drove on at its velocity when it was stopped, longer than it took to begin, s.

        Which delay a link or a control loop has, both commands have.
        """
        speed, _, begun, ended, done = drive
        moving, during = ratio * speed, self._looks.samples(operation, place, begun, ended)
        begins_s = ended - begun - (during[-1][1] - during[0][1]) / moving
        after = self._looks.samples(operation, place, ended, done)
        windows = (after[index : index + 2 * SEVERAL] for index in range(len(after) - 2 * SEVERAL + 1))
        full = [one[-1][0] for one in windows if (slope(one) or 0.0) / moving >= _FULL]
        late_s = max(full, default=ended) - ended - max(0.0, begins_s) - _LATE_S
        if late_s <= _LATE_S:
            return 0.0
        self._late[place] = (
            f"Told to stop, {place} went on as fast for {late_s + _LATE_S:.1f} s longer than it took to begin."
        )
        return late_s

    def _drives_on(self, rested: float, begun: float, ended: float) -> bool:
        """Return whether a number that did not change before a drive still changes as in that."""
        now = self._clock.now()
        for operation in (one.label for one in self._reads):
            for place in self._looks.places(operation):
                spans = ((rested, begun), ((begun + ended) / 2, ended), (now - _LATE_S, now))
                seen = [self._looks.samples(operation, place, *span) for span in spans]
                before, during, last = (abs(slope(one) or 0.0) for one in seen)
                if is_axis(member_name(place)) and before < during / 4 and last > during / 2 and len(seen[2]) > SEVERAL:
                    return True
        return False

    @property
    def _body(self) -> Any:
        """The body of a command, which says for how long it holds, if it can."""
        numbers = {at: value for number in self._plan.numbers for at, value in number.templates.items()}
        return self._template({**lasting(body_schema(self._plan.drive)), **numbers})

    def _forth_and_back(self, number: Commanded) -> list[tuple[float, ...]]:
        """Drive to each side; return the velocities, each with when it rested, began, ended and was looked at last.

        Raises:
            NotPossibleError: a velocity was refused.
        """
        least, most = number.limits
        speeds = [number.little] if most > 0 else []
        speeds += [-number.little] if least < 0 else []
        drives: list[tuple[float, ...]] = []
        for speed in (*speeds, *speeds[:1]):
            rested = self._clock.now()
            self._watch(_BEFORE_S)
            begun, _ = self._drive(number, speed)
            ended = self._clock.now()
            self._watch(_AFTER_S)
            while self._clock.now() < ended + _STOPS_S and self._drives_on(rested, begun, ended):
                self._look()
            drives.append((speed, rested, begun, ended, self._clock.now()))
            if len(drives) == 1 and not self._alike(drives):
                if speed == speeds[-1]:
                    break
                drives.clear()  # at an end of its travel a device only goes back
            elif len(drives) == len(speeds):
                break
        self._first[number.name] = drives[0][0]
        return drives

    def _alike(self, drives: Sequence[tuple[float, ...]]) -> dict[tuple[str, str], Response]:
        found = {}
        for operation in (one.label for one in self._reads):
            for place in self._looks.places(operation):
                samples = partial(self._looks.samples, operation, place)
                seen = [
                    response_to(speed, samples(rested, begun), samples(begun, ended), samples(ended, done))
                    for speed, rested, begun, ended, done in drives
                ]
                named = member_name(place).partition(ANGLE)[0]
                if ECHO.search(f"{operation} {place}") or not is_axis(named or "value"):
                    continue
                if (response := agreement(seen)) is not None:
                    found[operation, place] = response
                if all(one is not None and one.is_position for one in seen) and any(
                    one.ratio < 0 for one in seen if one
                ):
                    self._other_way[f"{place} of {operation}"] = None
        return found

    def _measures(self, responses: Mapping[str, Mapping[tuple[str, str], Response]]) -> dict[str, tuple[str, Response]]:
        """Return, for each commanded number, the place in one operation's response that measures it.

        Raises:
            NotPossibleError: nothing shows any of them.
        """
        counts = {
            one.label: sum(any(operation == one.label for operation, _ in own) for own in responses.values())
            for one in self._reads
        }
        read = max(counts, key=lambda label: counts[label])
        if not counts[read]:
            tried = ", ".join(f"{command.name} at {command.little:g}" for command in self._plan.numbers)
            raise NotPossibleError(
                f"{self._plan.drive.label} was accepted ({tried}), and no number of {', '.join(counts)} changed with it"
                f"{self._reversed_text}"
            )
        self._reads = [one for one in self._reads if one.label == read]
        own = {
            name: {place: one for (operation, place), one in given.items() if operation == read}
            for name, given in responses.items()
        }
        turns = {command.name for command in self._plan.numbers if command.turns and own[command.name]}
        # A place that changes with both wheels belongs to neither of them.
        shared = {
            name: {place for other, seen in own.items() if other != name for place in given.keys() & seen.keys()}
            for name, given in own.items()
        }
        shown = {
            command.name: self._choose(command, own[command.name], shared[command.name], turning=bool(turns))
            for command in self._plan.numbers
        }
        if turns and not any(shown[name] for name in shown.keys() - turns):
            # A drive shows one direction only: without turning, the direction ahead.
            ahead = {name: self._shown_as_position(own[name]) for name in shown.keys() - turns}
            if any(ahead.values()):
                shown = {name: ahead.get(name) for name in shown}
                self.notes.append(f"{', '.join(turns)} stays 0: nothing shows how fast it drives once it has turned.")
        for one in self._plan.numbers:
            if shown[one.name] is None and one.name not in self._refused:
                why = "nothing changed with it" if not own[one.name] else "no single number shows it"
                self.notes.append(f"{one.name} stays 0: {why}.")
        found = {name: one for name, one in shown.items() if one}
        if not found:
            raise NotPossibleError(
                f"{read} changes when the device is driven, but no number of it is an axis' own{self._reversed_text}"
            )
        return found

    @property
    def _reversed_text(self) -> str:
        """What is said of numbers that moved against the sign of a velocity; empty if none did."""
        return f"; against the sign that was commanded moved {', '.join(self._other_way)}" if self._other_way else ""

    def _choose(
        self, number: Commanded, own: Mapping[str, Response], shared: set[str], *, turning: bool
    ) -> tuple[str, Response] | None:
        velocities = {place: one for place, one in own.items() if not one.is_position and 1 / _NEAR < one.ratio < _NEAR}
        position = self._shown_as_position(own)
        if position and position[0] in shared and velocities.keys() - shared:
            position = None
        # A joint is called as what commands it. Once a device has turned, x and y change otherwise.
        called = number.place.rpartition("/")[2].lower()
        is_named = called not in _COORDINATES and not called.isdecimal()
        is_joint = position and is_named and position[0].rpartition("/")[2].lower() == called
        if position and (number.turns or not turning or is_joint):
            return position
        if not position and not velocities:
            # A tilt that lowers the tilt: judged as a velocity of the wrong sign.
            called = axis_of(number.place)
            alike = ((at, one) for at, one in own.items() if called and one.is_position and axis_of(at) == called)
            return next(((at, one._replace(ratio=abs(one.ratio))) for at, one in alike), None)
        return min(velocities.items(), key=lambda item: abs(math.log(item[1].ratio)), default=None)

    def _shown_as_position(self, own: Mapping[str, Response]) -> tuple[str, Response] | None:
        """Return the place of the position that alone shows a velocity."""
        positions = {place: one for place, one in own.items() if one.is_position and one.ratio > 0}
        # One wheel alone turns a device: then a coordinate changes otherwise the farther it drives.
        turning = {at: one for at, one in own.items() if one.is_position and self._looks.is_heading(at)}
        if turning and max(abs(one.ratio) for one in turning.values()) > max(
            (abs(one.ratio) for at, one in positions.items() if at not in turning), default=0.0
        ):
            positions = {at: one for at, one in positions.items() if at in turning}
        # The one whose unit is likeliest.
        best = min(
            positions.items(),
            key=lambda item: min(abs(math.log(item[1].ratio / unit)) for unit in _UNITS),
            default=None,
        )
        alone = best and not any(
            1 / _OTHER < abs(one.ratio / best[1].ratio) < _OTHER
            for place, one in own.items()
            if one.is_position and place != best[0]
        )
        return best if alone and best else None

    def _hold_s(self, number: Commanded, place: str, response: Response) -> float | None:
        """Let the device go; return how long it drove on, s, and stop it. None: for longer than the suite waits."""
        speed = self._first[number.name]
        self._watch(_BEFORE_S)
        _, last = self._drive(number, speed, end=False)
        read, moving = self._reads[0].label, response.ratio * speed
        least, most = bounds_of(self._schema_at(place)) or (-math.inf, math.inf)
        # A device stands at the end of its travel as if it had stopped: it is stopped a second before that.
        near, samples = abs(moving), list[Sample]()
        while self._clock.now() < last + _LET_GO_S:
            self._look()
            samples = self._looks.samples(read, place, last)
            if response.is_position and samples and not least + near <= samples[-1][1] <= most - near:
                break
            since = self._still_since(samples, response, moving)
            if since is not None and self._clock.now() >= since + _SURE_S:
                held_s = since - last
                if response.is_position:
                    # Computed from the distance covered, because noise hides when the robot came to rest.
                    held_s = abs((samples[-1][1] - samples[0][1]) / moving)
                self.notes.append(f"Let go, it came to rest {held_s:.2f} s after the last command.")
                return max(0.1, math.ceil(held_s * 20) / 20)
        self.notes.append(f"Let go, it drove on for all of the {self._clock.now() - last:.1f} s of the watch.")
        return None

    def _stops_s(self, number: Commanded, place: str, response: Response) -> float | None:
        """Drive, and send the stop; return how long the device took to rest, s. None: it accepts none for a drive."""
        found = self._stop_call()
        if found is None:
            return None
        self._watch(_BEFORE_S)
        speed = self._first[number.name]
        self._drive(number, speed, end=False)
        exchange = self._send(*found)
        ended = self._clock.now()
        self._watch(_STOPS_S / 2)
        samples = self._looks.samples(self._reads[0].label, place, ended)
        since = self._still_since(samples, response, response.ratio * speed)
        self._command({})
        if not self._took(exchange):
            self.notes.append(f"{found[0]} is not used: while the device drove, it got {exchange.came}.")
            return None
        return _STOPS_S if since is None else since - ended

    def _rises_s(self, number: Commanded, place: str, response: Response) -> float:
        """Drive back at the limit; return how long the device may take to reach that velocity, s.

        Its acceleration shows there alone. 0: it was not seen to reach it.
        """
        least, most = number.limits
        speed = least if self._first[number.name] > 0 and least < 0 else most
        moving, read = response.ratio * speed, self._reads[0].label
        ends = bounds_of(self._schema_at(place)) or (-math.inf, math.inf)
        here = self._looks.samples(read, place, 0.0)[-1][1]
        if response.is_position and not ends[0] < here + 2 * _DRIVEN_S * moving < ends[1]:
            return 0.0
        begun, _ = self._drive(number, speed)
        ended = self._clock.now()
        self._watch(_AFTER_S)
        seen = self._looks.samples(read, place, begun, ended)
        if not response.is_position:
            full = (moment for moment, value in seen if value / moving >= _FULL)
            return 1.5 * (next(full, begun) - begun)
        last = slope(seen[len(seen) // 2 :]) or 0.0
        if len(seen) < 2 * SEVERAL or last / moving < _FULL / 2:
            return 0.0
        # At a constant acceleration, half of the time is lost; an exponential one takes longer to be near its end.
        return 3.0 * max(0.0, seen[-1][0] - seen[0][0] - (seen[-1][1] - seen[0][1]) / moving)

    def _schema_at(self, place: str) -> Schema:
        """Return what the description says of the number at a place."""
        return dict(numbers_in(self._reads[0].shape or {})).get(place.partition(ANGLE)[0], {})

    @staticmethod
    def _still_since(samples: list[Sample], response: Response, moving: float) -> float | None:
        if response.is_position:
            return rests_from(samples, response.sigma, moving)
        since = None
        for moment, value in reversed(samples):
            if abs(value) > 0.3 * abs(moving):
                break
            since = moment
        return since

    def _lines(
        self,
        responses: Mapping[str, Mapping[tuple[str, str], Response]],
        shown: Mapping[str, tuple[str, Response]],
        settle_s: float,
        hold_s: float | None,
    ) -> Iterator[str]:
        """Yield the lines of the map, each figure with its origin."""
        read, numbers = self._reads[0].label, {command.name: command for command in self._plan.numbers}
        places = {
            place: one
            for name in shown
            for (operation, place), one in responses[name].items()
            if operation == read and one.is_position and 1 / _OTHER < one.ratio / _unit(one.ratio)[0] < _OTHER
        }
        places |= {place: one for place, one in shown.values() if one.is_position}
        if all(self._turns_with(responses[name]) for name in shown):
            # If each number turns the device, it drives in circles and stays near.
            places = {place: one for place, one in places.items() if self._looks.is_heading(place)}
        # How fast each place changes at most.
        fastest = {
            place: max(
                abs(one.ratio) * max(map(abs, numbers[name].limits))
                for name in shown
                for at, one in responses[name].items()
                if at == (read, place)
            )
            for place in places
        }
        self._even(places, fastest)
        names = unique_names(list(places), self._looks.titles)
        driven = {place: name for name, (place, one) in shown.items() if one.is_position}
        yield "[motion.state]"
        yield f"read = {string(read)}"
        yield ""
        yield "[motion.state.axes]" + ("" if places else "  # nothing shows where it is")
        for place, response in places.items():
            number = numbers.get(driven.get(place, ""))
            yield f"{key(names[place])} = {self._axis(place, response, number, fastest[place])}"
        yield ""
        yield "[motion.velocity]"
        still = {command.name: 0 for command in self._plan.numbers if command.name not in shown}
        yield from self._sending_lines(shown, still, 1)
        widest = {name: max(map(abs, numbers[name].limits)) for name in shown}
        off = {name: _OFF if numbers[name].has_unit else _OFF_WITHOUT_UNIT for name in shown}
        least = max(off[name] * widest[name] for name in shown)
        yield f"tolerance = {least:.3g}  # the suite's: {max(off.values()):.0%} of the fastest"
        yield f"settle_s = {min(settle_s, 2.0):.2f}  # seen: so long it took to rest, and half as long again"
        declared_s = self._plan.holds_s
        if declared_s is not None and (hold_s is None or hold_s > _LONGER * declared_s + _LATE_S):
            yield f"hold_s = {declared_s:g}  # as the description says"
        elif hold_s is not None:
            yield f"hold_s = {hold_s:.2f}  # seen: let go, it stopped by itself"
        else:
            yield f"hold_s = {_DEMANDED_S:g}  # the suite's: let go, it drove on"
            yield "# If the robot by design holds a velocity until it is told otherwise, take out the line above."
        yield from self._refusal_lines(declared=all(bounds_of(numbers[name].schema) for name in shown))
        yield ""
        yield "[motion.velocity.axes]"
        for name, (place, response) in shown.items():
            number = numbers[name]
            given: dict[str, Any] = {"limits": list(number.limits)}
            given |= {"of": names[place]} if response.is_position else {"at": place}
            if response.is_position and (scale := _scale(number, place, response.ratio)) != 1:
                given["scale"] = scale
            if not response.is_position:
                given |= {"noise": float(f"{response.sigma:.2g}"), "rest": self._rest(place, response, widest[name])}
            given["tolerance"] = round(
                max(off[name] * widest[name], 8 * (0 if response.is_position else response.sigma)), 4
            )
            source = f"limits {number.source}" if number.bounds else "limits: the suite's, as none are declared"
            yield f"{key(name)} = {inline(given)}  # {source}; changed by {response.ratio:.3g} at velocity 1"

    def _turns_with(self, responses: Mapping[tuple[str, str], Response]) -> bool:
        """Return whether a number turns the device."""
        return any(one.is_position and self._looks.is_heading(place) for (_, place), one in responses.items())

    def _even(self, places: dict[str, Response], fastest: dict[str, float]) -> None:
        """Give all coordinates of a device that turns the rate of the fastest: once turned, it drives along others."""
        along = [place for place in places if not self._looks.is_heading(place)]
        if 0 < len(along) < len(places):
            lead = max(along, key=lambda place: fastest[place])
            places |= {place: places[place]._replace(ratio=places[lead].ratio) for place in along}
            fastest |= dict.fromkeys(along, fastest[lead])

    def _rest(self, place: str, response: Response, fastest: float) -> float:
        """Return how fast a number may seem to move at rest: a share of the fastest, or as before any drive."""
        seen = self._at_rest(self._reads[0].label, place)
        drift = slope(seen) if response.is_position else median(value for _, value in seen)
        return float(f"{max(AT_REST * fastest, 3 * abs(drift or 0.0)):.3g}")

    def _axis(self, place: str, response: Response, number: Commanded | None, fastest: float) -> str:
        """Return an axis of the state, with limits around its present position."""
        samples = self._looks.samples(self._reads[0].label, place, 0.0)
        here = samples[-1][1]
        scale, (way, turn) = _unit(response.ratio)
        is_heading = ANGLE in place or bool(self._looks.is_heading(place))
        turns = is_heading or (number is not None and number.turns)
        pointer, _, angle = place.partition(ANGLE)
        schema = self._schema_at(place)
        told = unit_of(pointer, schema) or (unit_of(number.place, number.schema) if number and scale == 1 else "")
        unit = "rad" if angle else told or (turn if turns else way)
        if is_heading and not angle:
            unit = "deg" if self._looks.is_in_degrees(self._reads[0].label, place) else unit or "rad"
        # One that was seen to turn in degrees is known by the same factor of a radian.
        scale = next((factor for factor, units in _UNITS.items() if unit and unit in units), scale)
        if turns and unit in {"rad", "deg"} and not angle and self._looks.is_heading(place):
            angle = "yaw"
        room = _ROOM_RAD * scale if turns else ROOM_M * scale
        # A turn in an undeclared unit may be in degrees.
        room = room if turns and (told or is_heading) else max(room, ROOM_S * fastest)
        all_around = [round(end * scale, 1) for end in (-3.0, 3.0)]
        limits = all_around if angle else [round(here - room, 4), round(here + room, 4)]
        if declared := bounds_of(schema):
            limits = [max(limits[0], declared[0]), min(limits[1], declared[1])]
        given: dict[str, Any] = {"at": pointer, "unit": unit, "limits": limits}
        given["tolerance"] = round(max(6 * response.sigma, 0.06 * fastest, 0.002 * scale), 4)
        given["rest"] = self._rest(place, response, fastest)
        given |= {"angle": angle} if angle else {} if declared else {"bound": False}
        return f"{inline(given)}  # limits: {'all around' if angle else f'{room:.3g} {unit} around where it was'}"


def _scale(number: Commanded, place: str, ratio: float) -> float:
    """Return how fast a position must change at velocity 1: by the unit, or as measured if none is declared."""
    if ANGLE in place and unit_of(number.place, number.schema) == "deg":
        return round(math.radians(1), 6)
    return _unit(ratio)[0] if number.has_unit else float(f"{ratio:.3g}")


def _unit(ratio: float) -> tuple[float, tuple[str, str]]:
    """Return a velocity's units per m/s or rad/s and the unit's name; the measured ratio if no unit is near."""
    near = min(_UNITS, key=lambda unit: abs(math.log(abs(ratio) / unit)))
    if abs(math.log(abs(ratio) / near)) < math.log(_NEAR):
        return near, _UNITS[near]
    return float(f"{abs(ratio):.2g}"), ("", "")
