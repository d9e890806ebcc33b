"""Messages by which a gateway is judged: a bounded set for any type, the same for the same seed.

Values are as the player has them (ros_probe/values.py): objects by field, octets as `{"b64": …}`.
"""

from __future__ import annotations

import base64
import itertools
import math
import random
import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Final

from conformance.scenarios.ros.definition import FLOATS, INTEGERS, Definition, Shape

_EXACT: Final = 2**53
# Strings that are lost in wrong encodings, in templates, by normalising or by guessing types.
_TEXTS: Final = (
    "日本語 🤖 𠀀", '"quoted" \\ / <tag> & ]]>', "x" * 5000, "line\nbreak\tand tab", "", "e\u0301 is not \u00e9", "NaN",
    "null", " blanks around ", "1e5", "\u2028", "0123", "Zürich", "true",
)  # fmt: skip
_DOUBLES: Final = (
    0.1, 1.7976931348623157e308, 5e-324, -0.0, 1 / 3, -2.2250738585072014e-308, 9007199254740991.0, 1e21, 1e-7,
    123456789.12345679, 4.35, 2.0,
)  # fmt: skip
_SINGLES: Final = (0.1, 3.4028234663852886e38, 1.401298464324817e-45, -0.0, 1 / 3, -16777215.0, 1e-7, 123456.789, 2.0)
_LINES: Final = ("\u2028", "\n", "\t")  # characters that XML cannot write as they are
_ITEMS: Final = (3, 0, 1, 7)  # lengths of the arrays that are sent
_INNER: Final = 2  # most messages in an array inside a message
_SECONDS: Final = 2**31 - 1  # greatest time, s
_NANOSECONDS: Final = 999_999_999
# Octets for each number of a large message.
_OCTETS: Final = 100
# Small values, by which a real robot hardly moves: up to 500 steps of so much, and integers up to 50.
_GENTLE: Final = 0.0001
_GENTLY: Final = 500
_LEAST: Final = 50


class Kind(StrEnum):
    """The purpose of a sample message."""

    USUAL = "usual"
    DEFAULT = "default"
    EXTREME = "extreme"
    NON_FINITE = "non-finite"
    LARGE = "large"


@dataclass(frozen=True)
class Sample:
    """A message.

    Attributes:
        what: as a noun phrase.
        kind: what it is for.
        value: the value of the message.
    """

    what: str
    kind: Kind
    value: dict[str, Any]


@dataclass
class Maker:
    """Makes messages of one type.

    Attributes:
        definition: the definition of the type.
        seed: the seed of what is random.
        is_xml: whether strings have to be such as XML can write and keep.
        is_gentle: whether usual values are small, for a real robot, or a gateway that refuses greater ones.
    """

    definition: Definition
    seed: int
    is_xml: bool = False
    is_gentle: bool = False

    def __post_init__(self) -> None:
        self._random = random.Random(f"{self.seed} {self.definition.root}")  # noqa: S311 - values, no secrets
        self._leaf, self._texts, self._gentle = itertools.count(), itertools.count(), itertools.count()

    def samples(self, most: int, *, large: int) -> Iterator[Sample]:
        """Yield messages: usual ones, those that a fault is likely to change, and usual ones again.

        Args:
            most: how many, beside large ones and those with NaN or infinities.
            large: how many numbers the large ones have; 0 if there are none.
        """
        yield self.usual()
        yield Sample("the message with its defaults", Kind.DEFAULT, {})
        for turn in range(max(0, most - 4)):
            yield Sample(f"message {turn + 1} of extreme values", Kind.EXTREME, self._message(turn))
        if large and (grown := self._large(large)) is not None:
            yield grown
        yield self.usual()
        yield from self._non_finite()
        yield self.usual()

    def usual(self) -> Sample:
        """Return a message of usual values, a different one each time."""
        if not self.is_gentle:
            return Sample("a usual message", Kind.USUAL, self._message(None))
        share = next(self._gentle) % _GENTLY + 1

        def small(shape: Shape, _: int | None) -> Any:
            if shape.item in FLOATS:
                return _single(_GENTLE * share)
            least = (share - 1) % _LEAST + 1
            return least if shape.item in INTEGERS else shape.item == "boolean" if not shape.is_text else ""

        return Sample("a message of small values", Kind.USUAL, self._message(None, small))

    def _message(self, turn: int | None, leaf: Any = None) -> dict[str, Any]:
        self._leaf, self._texts = itertools.count(), itertools.count()
        made: dict[str, Any] = self._fill(self.definition.root, turn, 0, leaf or self._value)
        return made

    def _fill(self, name: str, turn: int | None, depth: int, leaf: Any) -> dict[str, Any]:
        if name.startswith("builtin_interfaces/") and name.endswith(("/Time", "/Duration")):
            # A greater number is no ROS time, and a gateway may read it in any way.
            return {"sec": self._random.randint(0, _SECONDS), "nanosec": self._random.randint(0, _NANOSECONDS)}
        found = {}
        for field, shape in self.definition.fields(name):
            number = self._count(shape, turn, depth) if shape.is_array else 1
            if shape.is_message:
                items: list[Any] = [self._fill(shape.item, turn, depth + 1, leaf) for _ in range(number)]
            else:
                items = [leaf(shape, turn) for _ in range(number)]
            octets = {"b64": base64.b64encode(bytes(items)).decode()} if shape.is_octets else None
            found[field] = octets or (items if shape.is_array else items[0])
        return found

    def _count(self, shape: Shape, turn: int | None, depth: int) -> int:
        if shape.count is not None:
            return shape.count
        wanted = self._random.randint(1, 4) if turn is None else _ITEMS[turn % len(_ITEMS)]
        wanted = min(wanted, _INNER) if depth and shape.is_message else wanted
        full = turn is not None and turn % len(_ITEMS) == len(_ITEMS) - 1
        return wanted if shape.most is None else min(shape.most, 64 if full else wanted)

    def _value(self, shape: Shape, turn: int | None) -> Any:
        """Return a value that is no array: for each turn and field a different extreme value."""
        if shape.is_text:
            return self._text(turn, shape.longest)
        if turn is None:
            return self._any(shape)
        values = self._extremes(shape.item)
        return values[(turn + next(self._leaf)) % len(values)]

    def _extremes(self, item: str) -> tuple[Any, ...]:
        if item in FLOATS:
            return _DOUBLES if item == "double" else tuple(map(_single, _SINGLES))
        if item in INTEGERS:
            least, most = INTEGERS[item]
            beyond = (_EXACT + 1, -_EXACT - 1, most - 1)
            return (most, least, *(number for number in beyond if least <= number <= most), 0, 1)
        return (True, False)

    def _any(self, shape: Shape) -> Any:
        if shape.item in FLOATS:
            value = self._random.uniform(-1000, 1000)
            return value if shape.item == "double" else _single(value)
        if shape.item in INTEGERS:
            least, most = INTEGERS[shape.item]
            return self._random.randint(max(least, -1_000_000), min(most, 1_000_000))
        return self._random.random() < 1 / 2

    def _text(self, turn: int | None, longest: int | None) -> str:
        if turn is None:
            text = f"text {self._random.randrange(10**9)}"
        else:
            text = _TEXTS[(turn + next(self._texts)) % len(_TEXTS)]
            if self.is_xml and (text != text.strip() or any(one in text for one in _LINES)):
                text = "plain"
        return text[:longest]

    def _large(self, number: int) -> Sample | None:
        for field, shape in self.definition.fields():
            if shape.is_array and shape.most is None and shape.item in {"uint8", "octet", *FLOATS}:
                value = self._message(None)
                if shape.is_octets:
                    octets = self._random.randbytes(_OCTETS * number)
                    value[field] = {"b64": base64.b64encode(octets).decode()}
                    return Sample(f"a message with {_OCTETS * number:,} octets", Kind.LARGE, value)
                value[field] = [self._any(Shape(shape.item)) for _ in range(number)]
                return Sample(f"a message with {number:,} numbers", Kind.LARGE, value)
        return None

    def _non_finite(self) -> Iterator[Sample]:
        """Yield messages of usual values, but for one NaN or infinity."""
        for value in (math.nan, math.inf, -math.inf):
            made = self._with_one(dict.fromkeys(FLOATS, value))
            if made is not None:
                yield Sample(f"a message with {value}", Kind.NON_FINITE, made)

    def beyond(self) -> Sample | None:
        """Return a message with an integer that is greater than its type has; None if it has no integers."""
        made = self._with_one({item: most + 1 for item, (_, most) in INTEGERS.items()})
        return None if made is None else Sample("a message with an integer beyond its type", Kind.EXTREME, made)

    @property
    def has_numbers(self) -> bool:
        """Whether messages of the type have numbers or booleans."""
        return self._with_one(dict.fromkeys((*FLOATS, *INTEGERS, "boolean"), 0)) is not None

    def _with_one(self, values: Mapping[str, Any]) -> dict[str, Any] | None:
        """Return a message of usual values with an extreme one in the first field of some types, or None."""
        seen: list[str] = []

        def leaf(shape: Shape, turn: int | None) -> Any:
            if shape.item in values and not shape.is_octets and not seen:
                seen.append(shape.item)
                return values[shape.item]
            return self._value(shape, turn)

        made = self._message(None, leaf)
        return made if seen else None


def _single(value: float) -> float:
    """Return the float32 nearest to a number."""
    single: float = struct.unpack("f", struct.pack("f", value))[0]
    return single
