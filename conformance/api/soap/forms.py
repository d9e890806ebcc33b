"""Valid forms of simple types: strategies over the whole range of each, and other values by turn."""

import string
from collections.abc import Callable
from dataclasses import replace
from datetime import datetime, timedelta
from typing import Any, Final

from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

from conformance.documents.xsd_shapes import FLOATS, INTEGERS, NUMBERS, STRINGS, Simple, bounds, number_in, plain

# XML Schema 1.0 Part 2, 4.3.6: white space around a value is collapsed before it is read.
_SPACES: Final = ("", " ", "\n\t ", "  ")
# Numbers that programs misread: zeros of both signs, the smallest and greatest doubles, 2.2250738585072011e-308 (hung
# Java and PHP), 2**53 + 1 (no double), 1e23 (printed as 1e+23 or 9.99...e22).
EXTREMES: Final[dict[str, tuple[float, ...]]] = {
    "double": (
        0.0,
        -0.0,
        5e-324,
        -5e-324,
        2.2250738585072014e-308,
        2.2250738585072011e-308,
        1.7976931348623157e308,
        -1.7976931348623157e308,
        0.1,
        1 / 3,
        9007199254740993.0,
        1e22,
        1e23,
        123456789.123456789,
    ),
    "float": (0.0, -0.0, 1.401298464324817e-45, 1.1754943508222875e-38, 3.4028234663852886e38, 0.5),
}
# Texts that a device has to keep as they are: of its usual kind, with what XML escapes, beyond ASCII, beyond the BMP.
_TEXTS: Final = ("roaas one", "roaas two", "a<b>&\"c'", "Gr\u00f6\u00dfe 5 \u00b5m", "roaas  six", "\U0001f916 ok")
# Values of other types, which messages use in rotation.
_TYPED: Final = {
    "boolean": ("true", "false"),
    "dateTime": ("2031-05-06T07:08:09Z", "2032-10-11T12:13:14Z", "2031-07-08T09:10:11Z"),
    "date": ("2031-05-06", "2032-10-11", "2031-12-31"),
    "time": ("07:08:09Z", "12:13:14Z", "09:10:11Z"),
    "duration": ("PT5S", "PT7M", "P1D"),
    "base64Binary": ("//79/Pv6", "+/+/", "AAEC", "/wD+"),
    "hexBinary": ("0A1B", "FFAC", "FF00AC"),
}
# Integers that messages use in rotation, far apart first. _LARGE, for 64-bit types, also has numbers that a double or
# 32 bits cannot hold.
_SMALL: Final = (1, 9, 4, 7, 2, 6, 3, 8, 5)
_LARGE: Final = (1, 2**55, 4, 2**53 + 1, 2**32 + 7, 6, 3, 8, 5)
# Integers whose lower 32, 16 and 8 bits are other integers, and the longest text that is sent, characters.
_BEYOND_BITS: Final = (2**32 + 7, 2**16 + 300, 300)
_LONGEST: Final = 1_000
_NEGATIVE: Final = -7
_WIDE: Final = frozenset({"long", "unsignedLong"})
# Characters of random texts: those that XML has to escape, and some of two and three octets.
_CHARACTERS: Final = string.ascii_letters + string.digits + " _-./<>&'\"\u00e4\u20ac\u65e5"


def values(simple: Simple) -> SearchStrategy[str]:
    """Return a strategy for valid forms of valid, finite values.

    Where a facet's regular expression limits them there is one value only: what an expression means to two validators
    and a robot is no good ground for blame.
    """
    if simple.enumeration:
        return st.sampled_from(simple.enumeration)
    if simple.patterns:
        return st.just(plain(simple))
    if simple.builtin in INTEGERS:
        low, high = bounds(simple)
        drawn = st.one_of(st.sampled_from([low, high, min(max(0, low), high)]), st.integers(low, high))
        return _with_spaces(drawn, written_integer)
    if simple.builtin in FLOATS:
        return _with_spaces(_floats(simple), written_float)
    return _others(simple)


def _others(simple: Simple) -> SearchStrategy[str]:
    if simple.builtin == "boolean":
        return st.sampled_from(["true", "false", "1", "0", " true "])
    if simple.builtin in STRINGS:
        longest = simple.max_length if simple.max_length is not None else 30
        drawn = st.text(_CHARACTERS, min_size=simple.min_length or 0, max_size=longest)
        return drawn.map(str.strip) if not simple.min_length else drawn
    return st.just(plain(simple))


def _floats(simple: Simple) -> SearchStrategy[float]:
    low = float(simple.minimum) if simple.minimum is not None else None
    high = float(simple.maximum) if simple.maximum is not None else None
    drawn = st.floats(low, high, allow_nan=False, allow_infinity=False, width=64 if simple.builtin == "double" else 32)
    fitting = [
        value for value in EXTREMES[simple.builtin] if (low is None or value >= low) and (high is None or value <= high)
    ]
    return st.one_of(st.sampled_from(fitting), drawn) if fitting else drawn


def _with_spaces(numbers: SearchStrategy[Any], write: Callable[[Any, int], str]) -> SearchStrategy[str]:
    return st.builds(
        lambda value, form, before, after: f"{before}{write(value, form)}{after}",
        numbers,
        st.integers(0, 7),
        st.sampled_from(_SPACES),
        st.sampled_from(_SPACES),
    )


def written_integer(value: int, form: int) -> str:
    """Return an integer in one of four forms: plain, signed, with leading zeros, with both (3.3.13.1)."""
    sign, digits = ("-" if value < 0 else ""), str(abs(value))
    plus = sign or "+"
    return (f"{sign}{digits}", f"{plus}{digits}", f"{sign}000{digits}", f"{plus}0{digits}")[form % 4]


def written_float(value: float, form: int) -> str:
    """Return a float in one of eight forms, each of exactly its value (3.2.5.1)."""
    written = repr(value)
    sign, size = ("-", written[1:]) if written.startswith("-") else ("", written)
    power = "e" in size
    forms = (
        written,
        written,
        f"{sign or '+'}{size}",
        f"{sign}00{size}",
        written.replace("e", "E"),
        written if power else f"{written}e0",
        f"{sign}{size.removeprefix('0')}" if size.startswith("0.") else written,
        written if power else (written.removesuffix("0") if size.endswith(".0") else f"{written}000"),
    )
    return forms[form]


def another(simple: Simple, text: str, turn: int, is_free: bool) -> str:  # noqa: FBT001 - one caller
    """Return another value of a type, or the same one if no other is surely valid.

    ``is_free``: whether the value refers to nothing, by its name.
    """
    if simple.many:
        item = replace(simple, many=False)
        return " ".join(another(item, text, turn + more, is_free) for more in range(1 + turn % 2))
    if simple.others and turn % 3 > 1:
        return another(simple.others[0], text, turn, is_free)
    known = simple.enumeration or (() if simple.patterns else _values_of(simple, is_free))
    if known:
        return known[turn % len(known)]
    if simple.builtin in FLOATS | {"decimal"}:
        low = float(simple.minimum) if simple.minimum is not None else 0.0
        high = float(simple.maximum) if simple.maximum is not None else low + 1.0
        share = (0.25, 0.75, 0.5, 0.6, 0.4, 0.7)[turn % 6]
        number = low + share * (high - low)
        return f"{number if simple.digits is None else round(number, simple.digits):.10g}"
    return text


def extreme(simple: Simple, text: str, is_free: bool) -> str:  # noqa: FBT001 - as another()
    """Return the longest text that a type allows, or an integer beyond 8, 16 or 32 bits; else the same value."""
    if _is_limited(simple) or not is_free:
        return text
    if simple.builtin in INTEGERS:
        low, high = bounds(simple)
        return next((str(number) for number in _BEYOND_BITS if low <= number <= high), text)
    longest = simple.max_length if simple.builtin in STRINGS else None
    return text if longest is None or longest > _LONGEST else (string.ascii_lowercase * longest)[:longest]


def shortest(simple: Simple, text: str, is_free: bool) -> str:  # noqa: FBT001 - as another()
    """Return an empty text or a negative number if a type allows it; else the same value."""
    if _is_limited(simple) or not is_free:
        return text
    if simple.builtin in INTEGERS:
        return str(_NEGATIVE) if bounds(simple)[0] <= _NEGATIVE else text
    return "" if simple.builtin in STRINGS and not simple.min_length else text


def boundless(simple: Simple, text: str, is_free: bool, number: str) -> str:  # noqa: FBT001 - as another()
    """Return INF or NaN, as ``number`` says, if a type allows it; else the same value."""
    is_bounded = simple.minimum is not None or simple.maximum is not None
    return text if _is_limited(simple) or is_bounded or not is_free or simple.builtin not in FLOATS else number


def _is_limited(simple: Simple) -> bool:
    return bool(simple.enumeration or simple.patterns or simple.many or simple.others)


def _values_of(simple: Simple, is_free: bool) -> tuple[str, ...]:  # noqa: FBT001 - as another()
    """Return values of a type, in the order of turns."""
    shortest, longest = simple.min_length or 0, simple.max_length
    if simple.builtin in INTEGERS and is_free:
        low, high = bounds(simple)
        own = _LARGE if simple.builtin in _WIDE and high > _LARGE[1] else _SMALL
        return tuple(str(min(max(number, low), high)) for number in own)
    if simple.builtin in STRINGS and is_free:
        return tuple(one for one in _TEXTS if shortest <= len(one) <= (len(one) if longest is None else longest))
    return () if shortest or longest else _TYPED.get(simple.builtin, ())


def rewritten(simple: Simple, text: str, form: int) -> str:
    """Return the same value in one of two other forms of its type (XML Schema Part 2, 3.2)."""
    if simple.patterns or simple.enumeration:
        return text
    if simple.many:
        return ("\n", "  ")[form].join(rewritten(replace(simple, many=False), one, form) for one in text.split())
    number = number_in(text) if simple.builtin in NUMBERS else None
    if number is not None:
        is_float = simple.builtin in FLOATS
        return (f"{number:E}" if is_float else f"{number:+f}", f"\n{'00' if number >= 0 else ''}{text} ")[form]
    moment = datetime.fromisoformat(text[:-1]) if text in _TYPED["dateTime"] else None
    others = {
        "boolean": ({"true": "1", "false": "0"}.get(text, text), f"\n {text} "),
        "dateTime": (f"{moment + timedelta(hours=2):%FT%T}+02:00" if moment else text, text.replace("Z", ".0Z")),
        "hexBinary": (text.lower(), text),
        "base64Binary": (f"{text[:2]}\n{text[2:]}", text),
    }
    return others.get(simple.builtin, (text, text))[form]
