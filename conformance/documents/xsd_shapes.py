"""Contents that an XML Schema allows, as immutable values; texts of simple types, and elements made from values."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from datetime import datetime, time
from decimal import Decimal, InvalidOperation
from itertools import zip_longest
from math import isclose
from typing import TYPE_CHECKING, Any, Final

from conformance.documents.xml import XSD, XSI, Node, clark, elements, local, text_of
from conformance.documents.xsd_assembly import LEFT_OUT, UNKNOWN

if TYPE_CHECKING:
    from lxml import etree

# Elements of one message to read: recursive types could be read without end.
_MOST: Final = 20_000
_DOCUMENTATION: Final = f"{clark(XSD, 'annotation')}/{clark(XSD, 'documentation')}"
# Elements that a request may have.
_LARGEST: Final = 100_000


@dataclass(frozen=True)
class Simple:
    """A simple type.

    Attributes:
        builtin: local name of the built-in type (XML Schema Part 2) that it is derived from.
        enumeration: allowed values, as written; empty means any.
        minimum: smallest value; maximum: greatest; None means those of the built-in type.
        min_length: in characters; max_length: likewise.
        patterns: regular expressions (XML Schema) that a value must match.
        many: whether it is a list of such values.
        others: the further members of a union, whose first member this is.
        digits: of its fraction, at most (fractionDigits).
        default: the value that the declaration gives if none is there, or empty.
    """

    builtin: str
    enumeration: tuple[str, ...] = ()
    minimum: Decimal | None = None
    maximum: Decimal | None = None
    min_length: int | None = None
    max_length: int | None = None
    patterns: tuple[str, ...] = ()
    many: bool = False
    others: tuple[Simple, ...] = ()
    digits: int | None = None
    default: str = ""


@dataclass(frozen=True)
class Group:
    """A group of child elements.

    Attributes:
        model: sequence, choice or all.
        items: the particles.
        minimum: minOccurs; maximum: maxOccurs (None: unbounded).
    """

    model: str
    items: tuple[Element | Group, ...] = ()
    minimum: int = 1
    maximum: int | None = 1

    def elements(self) -> Iterator[Element]:
        """Yield the elements of this group and of nested groups."""
        for item in self.items:
            yield from (item,) if isinstance(item, Element) else item.elements()


@dataclass(frozen=True)
class Complex:
    """A complex type.

    Attributes:
        content: the child elements, or None.
        text: the type of its text, if it has simple content.
        attributes: (name in Clark notation, type, required) for each.
        wildcard: whether it allows elements or attributes that the schema does not name.
        unknown: whether no document declares it.
        derived: types that may take its place, each with its name in Clark notation; a message names it by xsi:type.
    """

    content: Group | None = None
    text: Simple | None = None
    attributes: tuple[tuple[str, Simple, bool], ...] = ()
    wildcard: bool = False
    unknown: bool = False
    derived: tuple[tuple[str, Complex], ...] = ()


@dataclass(frozen=True)
class Element:
    """An element declaration.

    Attributes:
        tag: name in messages, in Clark notation, after form and elementFormDefault are applied.
        type: type of its content.
        minimum: minOccurs; maximum: maxOccurs (None: unbounded).
        nillable: whether xsi:nil is allowed.
        documentation: what the schema says of it.
    """

    tag: str
    type: Simple | Complex
    minimum: int = 1
    maximum: int | None = 1
    nillable: bool = False
    documentation: str = ""

    @property
    def children(self) -> tuple[Element, ...]:
        """The child element declarations, with groups flattened."""
        if isinstance(self.type, Simple) or self.type.content is None:
            return ()
        return tuple(self.type.content.elements())


def as_typed(declared: Element, node: Node) -> Element:
    """Return the declaration of an element, with the derived type that its xsi:type names, if it names one."""
    kind, name = declared.type, dict(node.attributes).get(clark(XSI, "type"))
    found = None if name is None or isinstance(kind, Simple) else dict(kind.derived).get(name)
    return declared if found is None else replace(declared, type=found)


@dataclass
class _Reader:
    """Reads declarations of xmlschema; ``left`` is how many elements of one message may yet be read."""

    left: int = _MOST
    path: list[int] = field(default_factory=list)
    by_base: dict[str, list[Any]] | None = None

    def element(self, declared: Any) -> Element:
        """Return the content that an element declaration allows."""
        self.left -= 1
        space, _, name = str(declared.name).rpartition("}")
        tag = str(declared.name) if space else name
        nillable = bool(declared.nillable)
        if declared.elem is not None and declared.elem.get(UNKNOWN):
            unknown = Complex(wildcard=True, unknown=True)
            return Element(tag, unknown, declared.min_occurs, declared.max_occurs, nillable=nillable)
        own = self._type(declared.type)
        own = _with_fixed(own, declared) if isinstance(own, Simple) else own
        texts = (part.elem.findtext(_DOCUMENTATION, "") for part in (declared, declared.type) if part.elem is not None)
        documentation = " ".join(next(filter(None, texts), "").split())
        return Element(
            tag, own, declared.min_occurs, declared.max_occurs, nillable=nillable, documentation=documentation
        )

    def _type(self, declared: Any) -> Simple | Complex:
        if declared.is_simple():
            return _simple(declared)
        if declared.elem is not None and declared.elem.get(UNKNOWN):
            return Complex(wildcard=True, unknown=True)
        # A recursive type is followed once; everything deeper is optional in any finite message.
        if self.path.count(id(declared)) > 1 or self.left < 0:
            return Complex()
        attributes = tuple(
            (str(name), _with_fixed(_simple(attribute.type), attribute), attribute.use == "required")
            for name, attribute in declared.attributes.items()
            if name is not None and attribute.use != "prohibited"
        )
        wildcard = None in declared.attributes
        if declared.has_simple_content():
            return Complex(None, _simple(declared.content), attributes, wildcard)
        self.path.append(id(declared))
        content = self._group(declared.content)
        others = [one for one in self._subtypes(declared) if self.left > 0]
        derived = tuple((str(one.name), kind) for one in others if isinstance(kind := self._type(one), Complex))
        self.path.pop()
        wildcard = wildcard or any(map(_is_any, declared.content.iter_elements()))
        return Complex(content, None, attributes, wildcard, derived=derived)

    def _subtypes(self, declared: Any) -> list[Any]:
        """Return the global types that are derived from a type directly and have a content of elements."""
        if self.by_base is None:
            self.by_base = {}
            for one in declared.maps.types.values():
                base: Any = getattr(one, "base_type", None)
                own = str(base.name or "") if base is not None and one.is_complex() and not one.abstract else ""
                if own and not own.startswith(clark(XSD, "")) and one.has_complex_content():
                    self.by_base.setdefault(own, []).append(one)
        return self.by_base.get(declared.name, []) if declared.name else []

    def _group(self, declared: Any) -> Group:
        items: list[Element | Group] = []
        for item in declared:
            if hasattr(item, "model"):
                items.append(self._group(item))
            elif not _is_any(item):
                items.append(self.element(item))
        return Group(declared.model, tuple(items), declared.min_occurs, declared.max_occurs)


def shape(declared: Any) -> Element:
    """Return the content that an xmlschema element declaration allows."""
    return _Reader().element(declared)


def too_large(request: Element | None) -> str:
    """Return why no message of an element can be sent: it must have too many elements. Empty if it can."""
    count = 0 if request is None else _least(request)
    return f"its smallest request has {count:,} elements; the limit is {_LARGEST:,}" if count > _LARGEST else ""


def _least(part: Element | Group) -> int:
    """Return the number of elements in a message with the least occurrences, and each optional element once."""
    inner = part.type.content if isinstance(part, Element) and isinstance(part.type, Complex) else None
    items = (part.items[:1] if part.model == "choice" else part.items) if isinstance(part, Group) else (inner,)
    own = sum(_least(item) for item in items if item is not None) + isinstance(part, Element)
    return max(part.minimum, 1) * own


def _is_any(declared: Any) -> bool:
    """Return whether a particle is an xs:any, of XSD 1.0 or 1.1."""
    return type(declared).__name__.endswith("AnyElement")


def _with_fixed(simple: Simple, declared: Any) -> Simple:
    """Return a type with the default of a declaration, or with only its fixed value, if it has one."""
    if declared.fixed is None:
        return replace(simple, default=declared.default) if declared.default else simple
    return replace(simple, enumeration=(declared.fixed,))


def _simple(declared: Any) -> Simple:
    """Return a simple type."""
    within = getattr(declared, "base_type", None)
    if declared.is_list() and not getattr(declared, "enumeration", None):
        items = getattr(declared, "item_type", None) or getattr(within, "item_type", None)
        return replace(_simple(items), many=True) if items is not None else Simple("string")
    if declared.is_union() and not getattr(declared, "enumeration", None):
        members = getattr(declared, "member_types", None) or getattr(within, "member_types", None)
        first, *others = map(_simple, members or ()) if members else [Simple("string")]
        return replace(first, others=tuple(others))
    builtin = declared
    while builtin is not None and not str(builtin.name or "").startswith(clark(XSD, "")):
        builtin = builtin.base_type
    # A built-in type's own pattern adds nothing to its name.
    patterns = getattr(getattr(declared, "patterns", None) if builtin is not declared else None, "regexps", None)
    digits = getattr(declared.get_facet(_FRACTION), "value", None)
    # A value near a bound that is excluded.
    name = str(builtin.name).rpartition("}")[2] if builtin is not None else "string"
    step = Decimal(1).scaleb(-(digits or 0) if name in INTEGERS or digits else -3)
    least, most = _decimal(getattr(declared, "min_value", None)), _decimal(getattr(declared, "max_value", None))
    if least is not None and most is not None and 2 * step > most - least:
        step = (most - least) / 4
    least = least + step if least is not None and declared.get_facet(_LEAST) is not None else least
    most = most - step if most is not None and declared.get_facet(_GREATEST) is not None else most
    return Simple(
        name,
        tuple(
            str(value).lower() if isinstance(value, bool) else str(value)
            for value in getattr(declared, "enumeration", None) or ()
        ),
        least,
        most,
        getattr(declared, "min_length", None),
        getattr(declared, "max_length", None),
        tuple(patterns or filter(None, (part.get(LEFT_OUT) for part in getattr(declared.elem, "iter", tuple)()))),
        digits=digits,
    )


_FRACTION, _LEAST, _GREATEST = (clark(XSD, name) for name in ("fractionDigits", "minExclusive", "maxExclusive"))


def _decimal(value: object) -> Decimal | None:
    """Return a bound as a number, or None for types that are not numbers, such as dates."""
    if isinstance(value, bool) or not isinstance(value, int | float | Decimal):
        return None
    bound = Decimal(value) if not isinstance(value, float) else Decimal(repr(value))
    return bound if bound.is_finite() else None


_TEXT: Final = "#text"


class NoElementError(ValueError):
    """Raised for a member that no element can hold; the message names it and the possible elements."""


def value_of(element: etree._Element) -> Any:
    """Return an element's content: its text, or a mapping if it has attributes or children."""
    found: dict[str, Any] = {f"@{local(str(name))}": value for name, value in element.attrib.items()}
    text = text_of(element).strip()
    children = elements(element)
    if not found and not children:
        return text
    if text:
        found[_TEXT] = text
    for child in children:
        name, value = local(str(child.tag)), value_of(child)
        if name not in found:
            found[name] = value
        elif isinstance(found[name], list):
            found[name].append(value)
        else:
            found[name] = [found[name], value]
    return found


def node_of(declared: Element, value: Any) -> Node:
    """Return an element with a value, its children in the order of the schema; the schema may forbid the value.

    Raises:
        NoElementError: it has a member that the schema does not name, or a list where nothing can repeat.
    """
    kind = declared.type
    attributes = () if isinstance(kind, Simple) else kind.attributes
    if not isinstance(value, Mapping):
        return Node(declared.tag, _text_of_value(value, kind if isinstance(kind, Simple) else kind.text))
    known = {f"@{local(name)}" for name, *_ in attributes} | {local(child.tag) for child in declared.children}
    if strange := [name for name in value if name not in known | {_TEXT}]:
        raise NoElementError(f"{local(declared.tag)} has no {strange[0]}, but {', '.join(sorted(known)) or 'nothing'}")
    given = ((tag, simple, value.get(f"@{local(tag)}")) for tag, simple, _ in attributes)
    return Node(
        declared.tag,
        _text_of_value(value.get(_TEXT, ""), None),
        tuple(_children(declared, value)),
        tuple((tag, _text_of_value(one, simple)) for tag, simple, one in given if one is not None),
    )


def _children(declared: Element, value: Mapping[str, Any]) -> Iterator[Node]:
    for child in declared.children:
        given = value.get(local(child.tag))
        if given is not None:
            yield from (node_of(child, item) for item in (given if isinstance(given, list) else [given]))


def _text_of_value(value: Any, simple: Simple | None) -> str:
    """Return a value as XML Schema writes it."""
    if isinstance(value, list | Mapping):
        raise NoElementError(f"{value!r} in place of one value")
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float) and simple is not None and simple.builtin == "decimal":
        return f"{Decimal(repr(value)):f}"  # it has no exponent
    whole = simple is not None and simple.builtin in INTEGERS
    return str(int(value)) if whole and isinstance(value, float) and value.is_integer() else str(value)


# 3.3.13 to 3.3.25: the integers, each with its own bounds where it has any.
_INTEGERS: Final = (
    "integer long int short byte nonNegativeInteger positiveInteger nonPositiveInteger negativeInteger "
    "unsignedLong unsignedInt unsignedShort unsignedByte"
)
INTEGERS: Final = frozenset(_INTEGERS.split())
# Types that allow INF and NaN (XML Schema Part 2, 3.2.4 and 3.2.5).
FLOATS: Final = frozenset({"double", "float"})
NUMBERS: Final = INTEGERS | FLOATS | {"decimal"}
STRINGS: Final = frozenset({"string", "normalizedString", "token"})
_WIDEST: Final = 2**31 - 1  # greatest integer to send where the type has no bound
_LONGEST: Final = 1_000_000  # longest text, characters
# Texts that are no number in XML Schema, although some programming languages accept them.
NO_NUMBERS: Final = (
    "four", "", "1,5", "0x10", "1e", "--1", "+-1", "1 2", "1_000", "\u0664", "4d", "4f", "1e5.5", ".", "infinity",
    "true", "4;", "\u22124", "1\u00a0000",
)  # fmt: skip
# Spellings of NaN and infinity that Python, Java or C accept but XML Schema does not (3.2.5.1 is case-sensitive).
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


def beyond(simple: Simple, text: str) -> Iterator[str]:
    """Yield texts that a facet may forbid: next to a bound, with a character too many or too few for ``text``."""
    if simple.builtin in NUMBERS:
        step = Decimal(1 if simple.builtin in INTEGERS else "0.001")
        for bound, sign in ((simple.minimum, -1), (simple.maximum, 1)):
            # An exclusive bound is itself forbidden, so it is sent as well as the number beyond.
            yield from () if bound is None else (f"{bound:f}", f"{bound + sign * step:f}")
        number = number_in(text) if simple.builtin == "decimal" else None
        yield from () if number is None else (f"{number + Decimal('1e-7'):f}",)  # more digits than are allowed
    elif simple.enumeration:
        yield f"{text}~"
    else:
        if simple.max_length is not None and simple.max_length < _LONGEST:
            yield (text or "a").ljust(simple.max_length + 1, text[-1:] or "a")
        if simple.patterns or simple.min_length:
            yield from (text[: max((simple.min_length or 1) - 1, 0)], text + text[-1:])
        yield from (text[:-1], text + "~")


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
        "base64Binary": "+/8A",
        "hexBinary": "00FF",
        "gYear": "2026",
        "gYearMonth": "2026-01",
        "gMonth": "--01",
        "gMonthDay": "--01-31",
        "gDay": "---31",
    }
    text = known.get(simple.builtin, "map")
    # No text may be longer than a message.
    short = min(simple.min_length or 0, _LONGEST) - len(text)
    return (text + "a" * max(0, short))[: simple.max_length]


def is_alike(simple: Simple, one: str, two: str) -> bool:
    """Return whether two texts are the same value of a type (2.2)."""
    one, two = one.strip(), two.strip()
    if one == two:  # NaN as well (3.2.5)
        return True
    if simple.many:
        item, pairs = replace(simple, many=False), list(zip_longest(one.split(), two.split(), fillvalue=""))
        return all(is_alike(item, *pair) for pair in pairs)
    if read := _READ.get(simple.builtin):
        one, two = read(one), read(two)
    first, second = (number_in(text) if simple.builtin in NUMBERS else None for text in (one, two))
    if first is not None and second is not None:
        return first == second or (simple.builtin in FLOATS and isclose(first, second, rel_tol=1e-5, abs_tol=1e-9))
    if moment := _MOMENTS.get(simple.builtin):
        try:
            return moment(one) == moment(two)
        except (TypeError, ValueError):
            return one == two
    return one == two


def _duration(text: str) -> str:
    """Return months and seconds of a duration, which are the same in PT60S and PT1M."""
    found = _DURATION.fullmatch(text)
    if found is None:
        return text
    sign, *parts = found.groups()
    years, months, days, hours, minutes, seconds = (Decimal(part or 0) for part in parts)
    return f"{sign}{years * 12 + months} {(((days * 24 + hours) * 60 + minutes) * 60 + seconds).normalize():f}"


_MOMENTS: Final[Mapping[str, Callable[[str], datetime | time]]] = {
    "dateTime": datetime.fromisoformat,
    "time": time.fromisoformat,
}
_DURATION: Final = re.compile(
    r"(-?)P(?:(\d+)Y)?(?:(\d+)M)?(?:(\d+)D)?(?:T(?:(\d+)H)?(?:(\d+)M)?(?:(\d+(?:\.\d+)?)S)?)?", re.ASCII
)
# Functions that map all forms of a value to one text (XML Schema 2, 3.2.2, 3.2.6, 3.2.15, 3.2.16, 3.3.2).
_READ: Final[Mapping[str, Callable[[str], str]]] = {
    "boolean": lambda text: {"1": "true", "0": "false"}.get(text, text),
    "duration": _duration,
    "hexBinary": str.upper,
    "token": lambda text: " ".join(text.split()),
    "base64Binary": lambda text: "".join(text.split()),
}


def number_in(text: str) -> Decimal | None:
    """Return the number that a text is, or None."""
    try:
        return Decimal(text)
    except InvalidOperation:
        return None
