"""Record the numbers in a device's responses during small moves, and find those that show the moved axis."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Any, Final

from conformance.engine.commanded import FAST, Commanded, axis_of, is_axis, member_name
from conformance.measures.samples import Sample
from conformance.scenarios.motion.templates import NoValueError, angle_of
from conformance.statement.motion_map import Angle

# Parts of a document that are searched for numbers:
_DEEP = 8  # levels
_MANY = 400  # numbers
_LISTED = 24  # items of one list
# Greatest difference of a quaternion's length from 1.
_UNIT: Final = 0.02
# No angle of one turn is greater in rad, however it is counted.
_RAD: Final = 7.0
#: Separates the pointer of a quaternion from the name of an angle.
ANGLE: Final = "#"
# A number that is written as a text, as each is in XML; in JSON, digits alone may be an identifier.
_NUMBER: Final = re.compile(r"[-+]?\d{1,12}(?:\.\d{0,30})?(?:[eE][-+]?\d{1,2})?")
_FRACTION: Final = re.compile(r"-?\d{1,12}\.\d{1,12}")
#: Names of what turns without end, in rad or, if any of its values is greater than a turn in rad, in degrees.
HEADING: Final = re.compile(r"yaw|heading|theta|orientation|bearing", re.IGNORECASE)
_ANGLES: Final[tuple[Angle, ...]] = ("roll", "pitch", "yaw")

#: Names of members that repeat a command and measure nothing; names of numbers that say where a device is.
ECHO: Final = re.compile(r"target|command|cmd|set_?point|goal|desired|requested|last_", re.IGNORECASE)
_POSITION: Final = re.compile(
    r"position|(?:^|_)pos(?:_|$)|angle|location|height|level|actual|current|count", re.IGNORECASE
)

Numbers = dict[str, float]
"""Numbers by pointer; an angle of a quaternion by its pointer, `#` and the angle's name."""


def numbers_of(document: Any, *, in_xml: bool = False) -> Numbers:
    """Return the numbers of a document, at most some hundreds."""
    found: Numbers = {}
    for place, value in _numbers(document, "", _DEEP, _NUMBER if in_xml else _FRACTION):
        found[place] = value
        if len(found) >= _MANY:
            break
    return found


def _numbers(value: Any, at: str, deep: int, number: re.Pattern[str]) -> Iterator[tuple[str, float]]:
    if isinstance(value, bool) or not deep:
        return
    if isinstance(value, str) and number.fullmatch(value):
        value = float(value)
    if isinstance(value, int | float):
        # A number with thousands of digits is no measurement.
        if abs(value) < 1e300:  # noqa: PLR2004
            yield at, float(value)
    elif isinstance(value, Mapping):
        angles = _angles(value)
        if angles:
            yield from ((f"{at}{ANGLE}{name}", angle) for name, angle in angles.items())
            return
        for key, item in value.items():
            yield from _numbers(item, f"{at}/{str(key).replace('~', '~0').replace('/', '~1')}", deep - 1, number)
    elif isinstance(value, list):
        for index, item in enumerate(value[:_LISTED]):
            yield from _numbers(item, f"{at}/{index}", deep - 1, number)


def _angles(value: Mapping[str, Any]) -> dict[str, float]:
    """Return the angles of a value that is a quaternion; empty if it is none."""
    if set(value) != set("xyzw") or not all(isinstance(item, int | float) for item in value.values()):
        return {}
    if abs(math.hypot(*map(float, value.values())) - 1) > _UNIT:
        return {}
    try:
        return {name: angle_of(value, name) for name in _ANGLES}
    except NoValueError:
        return {}


def _only_position(places: Sequence[str], own: str, *, alone: bool) -> list[str]:
    """Return the place of the only position, where a number has another name; of an item the one in its place."""
    known = [place for place in places if _POSITION.search(member_name(place)) and is_axis(member_name(place))]
    known = [place for place in known if not (FAST.search(place) or ECHO.search(place))]
    if own.isdecimal():
        known = [place for place in known if own in place.split("/")]
    return known if len(known) == 1 and (alone or own.isdecimal()) else []


class Looks:
    """Readings of a device by operation: the middle of each reading's time, and its numbers.

    Args:
        titles: the names of items of lists, by JSON pointer.
    """

    def __init__(self, titles: Mapping[str, str] = MappingProxyType({})) -> None:
        self._seen: dict[str, list[tuple[float, Numbers]]] = {}
        self.titles = titles

    def is_heading(self, place: str) -> bool:
        """Return whether the name of a number says that it turns without end."""
        return bool(HEADING.search(self.titles.get(place, place.rpartition("/")[2])))

    def add(self, operation: str, moment: float, numbers: Numbers) -> None:
        """Keep one reading."""
        self._seen.setdefault(operation, []).append((moment, numbers))

    def places(self, operation: str) -> list[str]:
        """Return the places that every reading of an operation has."""
        seen = self._seen.get(operation, [])
        return [place for place in seen[0][1] if all(place in one for _, one in seen)] if seen else []

    def places_of(
        self, numbers: Sequence[Commanded], path: str, operations: Iterable[str]
    ) -> dict[str, tuple[str, str]]:
        """Return operation and place of each commanded number, of one operation as far as possible.

        Args:
            numbers: what is commanded.
            path: the path of the operation that commands them.
            operations: operations that are read.
        """
        told = {operation: self._named_places(operation, numbers, path) for operation in operations}
        found: dict[str, tuple[str, str]] = {}
        for operation in sorted(told, key=lambda operation: -len(told[operation])):
            found = {name: (operation, place) for name, place in told[operation].items()} | found
        return found

    def _named_places(self, operation: str, numbers: Sequence[Commanded], path: str) -> dict[str, str]:
        """Return the places of an operation's numbers, by the name of the commanded number they share."""
        places, found = self.places(operation), dict[str, str]()
        for number in numbers:
            words = number.place.strip("{}").split("/")
            own = words[-1].lower()
            is_item = own.isdecimal()
            same = [
                place for place in places if not is_item and place.rpartition("/")[2].partition(ANGLE)[0].lower() == own
            ]
            same = same or [
                place for place in places if not FAST.search(place) and axis_of(place) == axis_of(number.place)
            ]
            if not is_item and own in operation.rpartition("/")[2].lower() and not ECHO.search(operation):
                same += [place for place in places if place.lower() in {"", "/value", f"/{own}/value"}]
            same = same or _only_position(places, own, alone=len(numbers) == 1)
            # Of several members, prefer the one whose path is most like the command's; of things, that of the command.
            same.sort(
                key=lambda text: (
                    bool(ECHO.search(text) or FAST.search(text)),
                    -len(set(words) & set(text.split("/"))),
                    not self._is_of_thing(operation, text, path),
                )
            )
            if same and same[0] not in found.values():
                found[number.name] = same[0]
        return found

    def _is_of_thing(self, operation: str, place: str, path: str) -> bool:
        """Return whether a place is within an object with an id that the path of the command has."""
        thing, ids = place.rpartition("/")[0], path.partition("?")[0].split("/")
        return any(f"{value:g}" in ids for _, value in self.samples(operation, f"{thing}/id", 0.0)[-1:])

    def _turn(self, operation: str, place: str) -> float:
        """Return the value of a whole turn at a place; 0 if the number is no angle that wraps around."""
        if ANGLE in place:
            return math.tau
        if not self.is_heading(place):
            return 0.0
        return 360.0 if self.is_in_degrees(operation, place) else math.tau

    def is_in_degrees(self, operation: str, place: str) -> bool:
        """Return whether an angle has values that are beyond a turn in rad."""
        return any(abs(numbers.get(place, 0.0)) > _RAD for _, numbers in self._seen.get(operation, ()))

    def samples(self, operation: str, place: str, begin: float, end: float = math.inf) -> list[Sample]:
        """Return the samples of a place between two moments; angles go on beyond a whole turn."""
        found: list[Sample] = []
        for moment, numbers in self._seen.get(operation, []):
            if begin <= moment <= end and place in numbers:
                value = numbers[place]
                if found and (turn := self._turn(operation, place)):
                    value = found[-1][1] + math.remainder(value - found[-1][1], turn)
                found.append((moment, value))
        return found
