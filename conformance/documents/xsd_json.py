"""What XML Schema and JSON Schema have in common: an element as a JSON value, and its declaration as a JSON Schema."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final

from conformance.documents.representation import scalar
from conformance.documents.xml import XSI, clark, elements, local, text_of
from conformance.documents.xsd_shapes import INTEGERS, NUMBERS, STRINGS, Element, Group, Simple, plain

if TYPE_CHECKING:
    from lxml import etree

_NIL: Final = clark(XSI, "nil")
# Elements that are nested deeper than this have no schema.
_DEEPEST: Final = 6
# Formats of JSON Schema by the built-in type of XML Schema that has them.
_FORMATS: Final = {
    "dateTime": "date-time", "date": "date", "time": "time", "duration": "duration", "anyURI": "uri",
}  # fmt: skip
# Most bytes of a base64 value: if its type declares a length, and if it declares none.
_DECLARED_OCTETS, _ANY_OCTETS = 33_001, 4_354
# Types whose values have no blank, and a regular expression for such values.
_TOKENS: Final = frozenset({"NMTOKEN", "NCName", "Name", "ID", "IDREF", "language"})
_NAME_LIKE: Final = r"[A-Za-z][A-Za-z0-9]*"


def value_of(element: etree._Element | None, declared: Element | None) -> Any:
    """Return an element as a JSON value by its declaration; what the schema does not name is left out."""
    if element is None or declared is None:
        return {}
    kind = declared.type
    if element.get(_NIL) in {"true", "1"}:
        return None
    if isinstance(kind, Simple) or (kind.text is not None and not kind.attributes):
        return _scalar_of(kind if isinstance(kind, Simple) else kind.text or Simple("string"), text_of(element))
    found: dict[str, Any] = {} if kind.text is None else {"value": _scalar_of(kind.text, text_of(element))}
    types = {name: simple for name, simple, _ in kind.attributes}
    # A missing attribute has its default (XML Schema Part 1, 3.2.1).
    texts = {name: simple.default for name, simple in types.items() if simple.default}
    texts |= {str(name): str(text) for name, text in element.attrib.items()}
    found |= {local(name): _scalar_of(types[name], text) for name, text in texts.items() if name in types}
    found |= {local(part.tag): [] for part in declared.children if part.maximum != 1}
    parts = {part.tag: part for part in declared.children}
    for child in elements(element):
        if (part := parts.get(str(child.tag))) is not None:
            name, value = local(part.tag), value_of(child, part)
            found[name] = [*found.get(name, []), value] if part.maximum != 1 else value
    return found


def _scalar_of(simple: Simple, text: str) -> Any:
    kind = _kind(simple)
    if simple.many:
        return [scalar(part, kind) for part in text.split()]
    if simple.builtin == "base64Binary":
        return "".join(text.split())
    return scalar(text, kind) if kind != "string" else text if simple.builtin in STRINGS else text.strip()


def _kind(simple: Simple) -> str:
    if simple.builtin == "boolean" or simple.others:
        return "string" if simple.others else "boolean"
    return "integer" if simple.builtin in INTEGERS else "number" if simple.builtin in NUMBERS else "string"


def schema_of(
    declared: Element, depth: int = 0, given: Mapping[str, Sequence[Any]] | None = None, branch: int | None = None
) -> dict[str, Any]:
    """Return the JSON Schema of an element's content.

    Args:
        declared: the element.
        depth: how deep it is.
        given: values of members by name; then texts have a default, and attributes are called ``@name``, as in a map.
        branch: the branch of each choice, in rotation; None means all of them, as optional.
    """
    kind, at, text = declared.type, "" if given is None else "@", "value" if given is None else "#text"
    own: dict[str, Any] = {"description": declared.documentation} if declared.documentation else {}
    if isinstance(kind, Simple) or (kind.text is not None and not kind.attributes):
        simple = kind if isinstance(kind, Simple) else kind.text or Simple("string")
        own |= _simple_schema(simple) | _default_of(declared.tag, simple, given)
    elif depth < _DEEPEST:
        parts = {
            f"{at}{local(name)}": _simple_schema(simple) | _default_of(name, simple, given)
            for name, simple, _ in kind.attributes
        }
        parts |= {text: _simple_schema(kind.text)} if kind.text is not None else {}
        children = list(_children(kind.content, branch))
        for child in children:
            part = schema_of(child, depth + 1, given, branch)
            said = {"description": child.documentation} if child.documentation else {}
            many = {"type": "array", "items": part, "minItems": child.minimum, **said}
            many |= {} if child.maximum is None else {"maxItems": child.maximum}
            parts[local(child.tag)] = part if child.maximum == 1 else many
        needed = [f"{at}{local(name)}" for name, _, needs in kind.attributes if needs]
        needed += [local(child.tag) for child in children if child.minimum]
        own |= {"type": "object", "properties": parts, "required": needed}
    if declared.nillable and "type" in own:
        own["type"] = [own["type"], "null"]
    return own


def _default_of(tag: str, simple: Simple, given: Mapping[str, Sequence[Any]] | None) -> dict[str, Any]:
    if given is None or _kind(simple) != "string":
        return {}
    return {"default": next(iter(given.get(local(tag), ())), plain(simple))}


def _children(group: Group | None, branch: int | None) -> Iterator[Element]:
    """Yield the elements of a group, of a choice those of one branch; those of all branches need not be there."""
    items = group.items if group is not None else ()
    is_choice = group is not None and group.model == "choice" and len(items) > 1
    if is_choice and branch is not None:
        items = items[branch % len(items) :][:1]
    for item in items:
        found = [item] if isinstance(item, Element) else _children(item, branch)
        yield from (replace(one, minimum=0) if is_choice and branch is None else one for one in found)


def _simple_schema(simple: Simple) -> dict[str, Any]:
    schema: dict[str, Any] = {"type": _kind(simple)}
    if simple.enumeration:
        schema["enum"] = [_scalar_of(replace(simple, many=False), text) for text in simple.enumeration]
    bounds = {"minimum": simple.minimum, "maximum": simple.maximum} if schema["type"] != "string" else {}
    schema |= {name: number_of(bound) for name, bound in bounds.items() if bound is not None}
    # The usual values of a format need no pattern.
    patterns = simple.patterns or ((_NAME_LIKE,) if simple.builtin in _TOKENS else ())
    patterns = () if simple.builtin in _FORMATS else patterns
    schema |= {"pattern": f"^(?:{patterns[0]})$"} if patterns else {}
    schema |= {"multipleOf": 10**-simple.digits} if simple.digits and schema["type"] == "number" else {}
    lengths = {"minLength": simple.min_length, "maxLength": simple.max_length}
    is_text = not simple.many and simple.builtin != "base64Binary"
    schema |= {name: length for name, length in lengths.items() if length is not None and is_text}
    schema |= {"format": _FORMATS[simple.builtin]} if simple.builtin in _FORMATS else {}
    schema |= _octets_schema(simple.max_length) if simple.builtin == "base64Binary" else {}
    return {"type": "array", "items": schema} if simple.many else schema


def _octets_schema(most: int | None) -> dict[str, Any]:
    """Return the schema of octets as base64, with examples: few octets, and many, which a thing is created with."""
    count = min(most or _ANY_OCTETS, _DECLARED_OCTETS)
    made = [(bytes(range(256)) * (count // 256 + 1))[:size] for size in (min(count, 4), count)]
    examples = [b64encode(octets).decode() for octets in made]
    return {"pattern": "^(?:[A-Za-z0-9+/]{4})*[A-Za-z0-9+/=]*$", "description": "kept exactly", "examples": examples}


def number_of(bound: Any) -> int | float:
    """Return a decimal as a JSON number."""
    return int(bound) if bound == bound.to_integral_value() else float(bound)
