"""Roles of a WSDL's operations, by names and messages: GetGain reads what SetGain writes."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Final

from lxml import etree

from conformance.documents.multipart import in_utf_8
from conformance.documents.wsdl import SoapOperation, SoapPort, Wsdl
from conformance.documents.wsdl_pack import each, label_of
from conformance.documents.xml import NotXmlError, elements, local, parse
from conformance.documents.xsd_shapes import STRINGS, Complex, Element, Simple

_WORD: Final = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+")
#: Ends of element names by which a device identifies its things.
REFERS: Final = re.compile(r"(?:id|token|handle|index|ref|key|number|name|channel)$", re.IGNORECASE)
#: Nouns of values that are kept as they are given, and are not measured.
KEEPS: Final = re.compile(r"settings?$|config(?:uration)?$|options?$|preferences?$|parameters?$|profile$|limits?$")
#: Types whose values may refer to something.
TEXTS: Final = STRINGS | {"anyURI", "ID", "IDREF", "NCName", "NMTOKEN", "Name", "QName"}
#: A device may apply a change or a removal this long after its response, s.
SETTLES_S: Final = 1.0
# A sentence by which xsi:nil removes a value, and what one says by which it does not.
_NIL: Final = re.compile(r"\b(?:nil|null)\b", re.IGNORECASE)
_REMOVES: Final = re.compile(r"\b(?:remov|clear|delet|eras|unset|empt)", re.IGNORECASE)
_NOT: Final = re.compile(r"\b(?:not|never|no|keep|leav|ignor|unchang)|n't", re.IGNORECASE)
# A sentence by which a value stays if a message leaves it out.
_LEFT_OUT: Final = re.compile(r"\b(?:left out|leaves? out|omit\w*|absent|missing)\b", re.IGNORECASE)
_STAYS: Final = re.compile(r"\b(?:keeps?|stays?|unchanged|retains?|remains?|as it (?:was|is))\b", re.IGNORECASE)
_NEVER: Final = re.compile(r"(?!)|\b(?:not|never|no)\b|n't", re.IGNORECASE)
# Elements of a message that are nested deeper than this are not compared.
_DEEPEST: Final = 6
# A message longer than this is not read, octets.
_LONGEST: Final = 65_536


class Role(StrEnum):
    """What an operation does to the state of a device, by the verb in its name."""

    READS = "reads"
    WRITES = "writes"
    CREATES = "creates"
    REMOVES = "removes"
    ENDS = "ends"
    OTHER = "other"


_VERBS: Final = {
    Role.READS: "get read query fetch retrieve show list describe",
    Role.WRITES: "set put update write change configure modify store save",
    Role.CREATES: "create add register insert new",
    Role.REMOVES: "delete remove unregister erase",
    Role.ENDS: "cancel abort stop end terminate close",
}
#: Roles of operations that end a thing: they come last.
LAST: Final = frozenset({Role.ENDS, Role.REMOVES})
#: Roles of operations that may begin a thing, which the response names.
MAKERS: Final = frozenset({Role.CREATES, Role.OTHER})
_ROLES: Final = {verb: role for role, verbs in _VERBS.items() for verb in verbs.split()}


@dataclass(frozen=True)
class Act:
    """One operation.

    Attributes:
        port, operation: as the WSDL has them.
        role: what it does.
        noun: its name without the verb, in lower case.
        sent: simple types of the values in its request by their names in lower case; required ones in ``needs``.
        needs: names of values that each request has.
        told: simple types of the values in its response.
        emptied: names of values that have none any more once they were sent with xsi:nil: where the schema demands the
            element, or the documentation says so. Elsewhere, a device may take xsi:nil for "as it was".
        keeps: whether the documentation says that a value stays if a message leaves it out.
        inherited: names of values that a derived type demands, and its base does not know.
    """

    port: SoapPort
    operation: SoapOperation
    role: Role
    noun: str
    sent: dict[str, Simple] = field(default_factory=dict)
    needs: frozenset[str] = frozenset()
    told: dict[str, Simple] = field(default_factory=dict)
    emptied: frozenset[str] = frozenset()
    keeps: bool = False
    inherited: frozenset[str] = frozenset()

    @property
    def makes(self) -> dict[str, Simple]:
        """Return the values in the response by which a device may identify a created thing."""
        is_one = self.role is not Role.READS and self.role not in LAST
        return {name: one for name, one in self.told.items() if is_one and name not in self.needs and _is_id(name, one)}

    @property
    def names(self) -> dict[str, Simple]:
        """The values by which a thing that it writes or creates may be identified."""
        return self.makes if self.role in MAKERS else self.sent

    def keys(self, name: str, simple: Simple) -> list[str | Simple]:
        """Return the keys by which other messages may know a value: its name, a bare id with the noun, and its type."""
        named = [f"{self.noun}{name}", *([] if REFERS.fullmatch(name) else [name])]
        return [*named, *([simple] if simple.patterns and simple.builtin in TEXTS else [])]

    @property
    def label(self) -> str:
        """How the operation is called in patterns and on pages."""
        return label_of(self.port, self.operation)

    def shows(self, writer: Act) -> bool:
        """Return whether this operation reads values that another one writes, or creates a thing with."""
        is_its = writer.role in MAKERS and self.noun == writer.noun and bool(self.needs)
        return (
            self.role is Role.READS
            and (writer.role is Role.WRITES or is_its)
            and self.needs <= writer.names.keys()
            and not self.told.keys().isdisjoint(writer.sent.keys() - self.sent.keys())
        )


def role_of(name: str) -> Role:
    """Return an operation's role by its name."""
    verb = next(iter(_WORD.findall(name)), "")
    return _ROLES.get(verb.lower(), Role.OTHER)


def acts_of(found: Wsdl) -> list[Act]:
    """Return the operations of a WSDL for which messages can be made."""
    return [_act(found, port, operation) for port, operation in each(found.ports) if not found.remark(operation)]


def _act(found: Wsdl, port: SoapPort, operation: SoapOperation) -> Act:
    _, *noun = _WORD.findall(operation.name) or [operation.name]
    request = found.types.shape(operation.request) if operation.request else None
    response = found.types.shape(operation.response) if operation.response else None
    sent = {name: (simple, needed) for name, simple, needed in _values(request)} if request else {}
    return Act(
        port,
        operation,
        role_of(operation.name),
        "".join(noun).lower(),
        {name: simple for name, (simple, _) in sent.items()},
        frozenset(name for name, (_, needed) in sent.items() if needed),
        {name: simple for name, simple, _ in _values(response)} if response else {},
        frozenset(_nullable(request, clears=_says(operation, _NIL, _REMOVES, _NOT))) if request else frozenset(),
        _says(operation, _LEFT_OUT, _STAYS),
        frozenset(_extra_names(request)) if request else frozenset(),
    )


def _says(operation: SoapOperation, what: re.Pattern[str], does: re.Pattern[str], no: re.Pattern[str] = _NEVER) -> bool:
    """Return whether a sentence of the documentation says what happens, without a word that denies it."""
    sentences = re.split(r"[.;]", operation.documentation)
    return any(what.search(one) and does.search(one) and not no.search(one) for one in sentences)


def _nullable(declared: Element, depth: int = 0, *, clears: bool) -> Iterator[str]:
    for child in declared.children if depth < _DEEPEST else ():
        if child.nillable and (child.minimum or clears):
            yield local(child.tag).lower()
        yield from _nullable(child, depth + 1, clears=clears)


def _extra_names(declared: Element, depth: int = 0) -> Iterator[str]:
    for child in declared.children if depth < _DEEPEST else ():
        known = {name for name, _, _ in _values(replace(child, type=_without_derived(child.type)))}
        for _, other in () if isinstance(child.type, Simple) else child.type.derived:
            needed = {name for name, _, needs in _values(replace(child, type=_without_derived(other))) if needs}
            yield from needed - known
        yield from _extra_names(child, depth + 1)


def _without_derived(kind: Simple | Complex) -> Simple | Complex:
    return kind if isinstance(kind, Simple) else replace(kind, derived=())


def _is_id(name: str, simple: Simple) -> bool:
    return bool(REFERS.search(name)) or (bool(simple.patterns) and simple.builtin in TEXTS)


def in_order(acts: Iterable[Act], asks: Callable[[SoapOperation], int]) -> list[Act]:
    """Return operations in an order in which they can be called: creation before use, and endings last."""
    found, makers, ranks = list(acts), defaultdict[str | Simple, list[str]](list), defaultdict[str, int](int)
    for act in found:
        for key in [key for name, simple in act.makes.items() for key in act.keys(name, simple)]:
            makers[key].append(act.label)
    for _ in range(_DEEPEST):
        for act in found:
            keys = [key for name in act.needs if _is_id(name, act.sent[name]) for key in act.keys(name, act.sent[name])]
            before = [ranks[label] + 1 for key in keys for label in makers.get(key, ()) if label != act.label]
            ranks[act.label] = min(max(before, default=0), _DEEPEST)
    return sorted(
        found, key=lambda one: (one.role is Role.REMOVES, one.role is Role.ENDS, ranks[one.label], asks(one.operation))
    )


def _values(declared: Element, depth: int = 0, *, needed: bool = True) -> Iterator[tuple[str, Simple, bool]]:
    """Yield name and type of each value that an element may hold, and whether it must hold it."""
    kind = declared.type
    if isinstance(kind, Simple):
        if depth:
            yield local(declared.tag).lower(), kind, needed
        return
    for _, other in kind.derived if depth < _DEEPEST else ():
        yield from _values(replace(declared, type=other), depth, needed=False)
    for name, simple, required in kind.attributes:
        yield local(name).lower(), simple, needed and required
    if kind.text is not None:
        yield local(declared.tag).lower(), kind.text, needed
    for child in declared.children if depth < _DEEPEST else ():
        yield from _values(child, depth + 1, needed=needed and bool(child.minimum))


def payload_of(octets: bytes, content_type: str = "") -> etree._Element | None:
    """Return the first element in a message's Body; None if it is no message, or too long."""
    if not 0 < len(octets) <= _LONGEST:
        return None
    try:
        root = parse(in_utf_8(content_type, octets), comments=False)
    except NotXmlError:
        return None
    body = next((element for element in elements(root) if local(str(element.tag)) == "Body"), None)
    return next(iter(elements(body)), None) if body is not None else None


def texts_of(payload: etree._Element) -> dict[str, list[str]]:
    """Return the values in the content of a Body, by the name of their element or attribute in lower case."""
    found: dict[str, list[str]] = {}
    for element in payload.iter(etree.Element):
        if element is not payload and not len(element):
            found.setdefault(etree.QName(element).localname.lower(), []).append("".join(map(str, element.itertext())))
        for name, text in element.attrib.items():
            found.setdefault(etree.QName(str(name)).localname.lower(), []).append(str(text))
    return found
