"""The content that an XML Schema allows, as immutable values."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from decimal import Decimal
from typing import Any, Final

from conformance.documents.xml_names import XSD, clark
from conformance.documents.xsd_unknown import UNKNOWN

# So many elements of one message are read; types that hold one another in many ways would be read without end.
_MOST: Final = 20_000
# So many elements a request may have.
_LARGEST: Final = 100_000


@dataclass(frozen=True)
class Simple:
    """A simple type.

    Attributes:
        builtin: local name of the built-in type (XML Schema Part 2) that it is derived from.
        enumeration: allowed values, as written; empty: any.
        minimum: smallest value; maximum: greatest; None: those of the built-in type.
        min_length: in characters; max_length: likewise.
        patterns: regular expressions (XML Schema) that a value must match.
    """

    builtin: str
    enumeration: tuple[str, ...] = ()
    minimum: Decimal | None = None
    maximum: Decimal | None = None
    min_length: int | None = None
    max_length: int | None = None
    patterns: tuple[str, ...] = ()


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
    """

    content: Group | None = None
    text: Simple | None = None
    attributes: tuple[tuple[str, Simple, bool], ...] = ()
    wildcard: bool = False
    unknown: bool = False


@dataclass(frozen=True)
class Element:
    """An element declaration.

    Attributes:
        tag: name in messages, in Clark notation, after form and elementFormDefault are applied.
        type: type of its content.
        minimum: minOccurs; maximum: maxOccurs (None: unbounded).
        nillable: whether xsi:nil is allowed.
    """

    tag: str
    type: Simple | Complex
    minimum: int = 1
    maximum: int | None = 1
    nillable: bool = False

    @property
    def children(self) -> tuple[Element, ...]:
        """The child element declarations, with groups flattened."""
        if isinstance(self.type, Simple) or self.type.content is None:
            return ()
        return tuple(self.type.content.elements())


@dataclass
class _Reader:
    """Reads declarations of xmlschema; ``left`` is how many elements of one message may yet be read."""

    left: int = _MOST
    path: list[int] = field(default_factory=list)

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
        own = _fixed(own, declared.fixed) if isinstance(own, Simple) else own
        return Element(tag, own, declared.min_occurs, declared.max_occurs, nillable=nillable)

    def _type(self, declared: Any) -> Simple | Complex:
        if declared.is_simple():
            return _simple(declared)
        if declared.elem is not None and declared.elem.get(UNKNOWN):
            return Complex(wildcard=True, unknown=True)
        # A type within itself is followed once; what is beyond is optional in every message that ends.
        if self.path.count(id(declared)) > 1 or self.left < 0:
            return Complex()
        attributes = tuple(
            (str(name), _fixed(_simple(attribute.type), attribute.fixed), attribute.use == "required")
            for name, attribute in declared.attributes.items()
            if name is not None and attribute.use != "prohibited"
        )
        wildcard = None in declared.attributes
        if declared.has_simple_content():
            return Complex(None, _simple(declared.content), attributes, wildcard)
        self.path.append(id(declared))
        content = self._group(declared.content)
        self.path.pop()
        wildcard = wildcard or any(map(_is_any, declared.content.iter_elements()))
        return Complex(content, None, attributes, wildcard)

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
    """Return how many elements a message has in which each occurs as often as it must, and once if it need not."""
    inner = part.type.content if isinstance(part, Element) and isinstance(part.type, Complex) else None
    items = (part.items[:1] if part.model == "choice" else part.items) if isinstance(part, Group) else (inner,)
    own = sum(_least(one) for one in items if one is not None) + isinstance(part, Element)
    return max(part.minimum, 1) * own


def _is_any(declared: Any) -> bool:
    """Return whether a particle is an xs:any, of XSD 1.0 or 1.1."""
    return type(declared).__name__.endswith("AnyElement")


def _fixed(simple: Simple, value: str | None) -> Simple:
    """Return a type with the one value that a declaration allows, if it does."""
    return simple if value is None else replace(simple, enumeration=(value,))


def _simple(declared: Any) -> Simple:
    """Return a simple type; of a list that of its items, of a union that of its first member."""
    within = getattr(declared, "base_type", None)
    if declared.is_list() and not getattr(declared, "enumeration", None):
        items = getattr(declared, "item_type", None) or getattr(within, "item_type", None)
        return _simple(items) if items is not None else Simple("string")
    if declared.is_union() and not getattr(declared, "enumeration", None):
        members = getattr(declared, "member_types", None) or getattr(within, "member_types", None)
        return _simple(members[0]) if members else Simple("string")
    builtin = declared
    while builtin is not None and not str(builtin.name or "").startswith(clark(XSD, "")):
        builtin = builtin.base_type
    # A builtin's own pattern only says again what its name says.
    patterns = None if builtin is declared else getattr(declared, "patterns", None)
    return Simple(
        str(builtin.name).rpartition("}")[2] if builtin is not None else "string",
        tuple(_written(value) for value in getattr(declared, "enumeration", None) or ()),
        _decimal(getattr(declared, "min_value", None)),
        _decimal(getattr(declared, "max_value", None)),
        getattr(declared, "min_length", None),
        getattr(declared, "max_length", None),
        tuple(str(pattern) for pattern in getattr(patterns, "regexps", ()) or ()),
    )


def _written(value: object) -> str:
    return ("true" if value else "false") if isinstance(value, bool) else str(value)


def _decimal(value: object) -> Decimal | None:
    """Return a bound as a number, or None for types that are not numbers, such as dates."""
    if isinstance(value, bool) or not isinstance(value, int | float | Decimal):
        return None
    bound = Decimal(value) if not isinstance(value, float) else Decimal(repr(value))
    return bound if bound.is_finite() else None
