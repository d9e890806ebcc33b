"""Texts of XML Schema's simple types: valid ones over the whole range, and invalid ones.

Source: XML Schema 1.0 Part 2; each type names its clause. White space around a value is ignored for all types but
string (4.3.6).
"""

from datetime import datetime
from decimal import Decimal, InvalidOperation
from math import isclose
from typing import Final

from conformance.documents.xsd_shapes import Simple

# 3.3.13 to 3.3.25: the integers, each with its own bounds where it has any.
INTEGERS: Final = frozenset(
    {
        "integer",
        "long",
        "int",
        "short",
        "byte",
        "nonNegativeInteger",
        "positiveInteger",
        "nonPositiveInteger",
        "negativeInteger",
        "unsignedLong",
        "unsignedInt",
        "unsignedShort",
        "unsignedByte",
    }
)
# 3.2.4 and 3.2.5: those that know INF and NaN.
FLOATS: Final = frozenset({"double", "float"})
NUMBERS: Final = INTEGERS | FLOATS | {"decimal"}
STRINGS: Final = frozenset({"string", "normalizedString", "token"})
# Where an integer has no bounds of its own, values stay within what a robot can be asked to hold.
_WIDEST: Final = 2**31 - 1
_LONGEST: Final = 1_000_000
# Texts that are no number of any kind to XML Schema, though some are to a programming language.
NO_NUMBERS: Final = (
    "four",
    "",
    "1,5",
    "0x10",
    "1e",
    "--1",
    "+-1",
    "1 2",
    "1_000",
    "\u0664",
    "4d",
    "4f",
    "1e5.5",
    ".",
    "infinity",
    "true",
    "4;",
    "\u22124",
    "1\u00a0000",
)
# Not-a-number by another spelling than XML Schema's: what Python, Java or C would take (3.2.5.1 is case-sensitive).
NO_FLOATS: Final = (*NO_NUMBERS, "Infinity", "inf", "nan", "-Infinity", "+INF", "NAN", "1.#INF")
NO_INTEGERS: Final = (*NO_NUMBERS, "4.0", "4.", "4e0", "INF", "NaN", "3.9")
NO_BOOLEANS: Final = ("yes", "TRUE", "2", "", "on", "tru")
NON_FINITE: Final = ("INF", "-INF", "NaN")


def bounds(simple: Simple) -> tuple[int, int]:
    """Return minimum and maximum of an integer type; without a bound, the largest values that are tried."""
    low = int(simple.minimum.to_integral_value()) if simple.minimum is not None else -_WIDEST
    high = int(simple.maximum.to_integral_value()) if simple.maximum is not None else max(low, 0) + _WIDEST
    return min(low, high), max(low, high)


def outside(simple: Simple) -> tuple[str, ...]:
    """Return texts of integers outside the type's range."""
    if simple.builtin not in INTEGERS:
        return ()
    found: list[int] = []
    if simple.maximum is not None:
        found += [int(simple.maximum) + 1, 2**63, 10**30]
    if simple.minimum is not None:
        found += [int(simple.minimum) - 1, -(2**63) - 1]
    return tuple(str(value) for value in found if _is_outside(value, simple))


def _is_outside(value: int, simple: Simple) -> bool:
    return (simple.maximum is not None and value > simple.maximum) or (
        simple.minimum is not None and value < simple.minimum
    )


def unreadable(simple: Simple) -> tuple[str, ...]:
    """Return texts that are invalid for the type; empty for types on which parsers disagree."""
    if simple.enumeration:
        return ("no-such-value", "")
    if simple.builtin in INTEGERS:
        return NO_INTEGERS
    dates = dict.fromkeys(("date", "dateTime", "time"), ("yesterday", "2026-13-45", ""))
    others = {"decimal": (*NO_NUMBERS, "1e5", "INF", "NaN"), "boolean": NO_BOOLEANS, **dates}
    return NO_FLOATS if simple.builtin in FLOATS else others.get(simple.builtin, ())


def plain(simple: Simple) -> str:
    """Return the text of an ordinary value of the type."""
    if simple.enumeration:
        return simple.enumeration[0]
    if simple.builtin in INTEGERS:
        low, high = bounds(simple)
        return str(min(max(1, low), high))
    if simple.builtin in FLOATS | {"decimal"}:
        low_d = simple.minimum if simple.minimum is not None else Decimal("-1e300")
        high_d = simple.maximum if simple.maximum is not None else Decimal("1e300")
        return f"{min(max(Decimal('0.5'), low_d), high_d)}"
    known = {
        "boolean": "true",
        "date": "2026-01-31",
        "dateTime": "2026-01-31T12:00:00Z",
        "time": "12:00:00Z",
        "duration": "PT1S",
        "anyURI": "urn:example:a",
        "base64Binary": "AAAA",
        "hexBinary": "00FF",
        "gYear": "2026",
        "gYearMonth": "2026-01",
        "gMonth": "--01",
        "gMonthDay": "--01-31",
        "gDay": "---31",
    }
    text = known.get(simple.builtin, "map")
    # A text longer than any message cannot be sent.
    short = min(simple.min_length or 0, _LONGEST) - len(text)
    return (text + "a" * max(0, short))[: simple.max_length]


def is_alike(simple: Simple, one: str, two: str) -> bool:
    """Return whether two texts are the same value of a type (2.2)."""
    one, two = one.strip(), two.strip()
    if simple.builtin == "boolean":
        one, two = ({"1": "true", "0": "false"}.get(text, text) for text in (one, two))
    first, second = (number_in(text) if simple.builtin in NUMBERS else None for text in (one, two))
    if first is not None and second is not None:
        return first == second or (simple.builtin in FLOATS and isclose(first, second, rel_tol=1e-5, abs_tol=1e-9))
    if simple.builtin == "dateTime":
        try:
            return datetime.fromisoformat(one) == datetime.fromisoformat(two)
        except (TypeError, ValueError):
            return one == two
    return one == two


def number_in(text: str) -> Decimal | None:
    """Return the number that a text is, or None."""
    try:
        return Decimal(text)
    except InvalidOperation:
        return None
