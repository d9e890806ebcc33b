"""Strategies for the valid forms of simple types, over the whole range of each."""

import string
from collections.abc import Callable
from typing import Any, Final

from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

from conformance.documents.xsd_shapes import FLOATS, INTEGERS, STRINGS, Simple, bounds, plain

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
        return _padded(drawn, written_integer)
    if simple.builtin in FLOATS:
        return _padded(_floats(simple), written_float)
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


def _padded(numbers: SearchStrategy[Any], write: Callable[[Any, int], str]) -> SearchStrategy[str]:
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
