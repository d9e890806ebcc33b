"""What the operations of a WSDL are to each other, by their names and messages: which one reads what another writes."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Final

from lxml import etree

from conformance.documents.wsdl import SoapOperation, SoapPort, Wsdl
from conformance.documents.wsdl_pack import each, label_of
from conformance.documents.xml import NotXmlError, elements, local, parse
from conformance.documents.xsd_shapes import Element, Simple

_WORD: Final = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+")
#: A name of a value by which a device knows one of its things.
REFERS: Final = re.compile(r"(?:id|token|handle|index|ref|key|number|name|channel)$", re.IGNORECASE)
#: A device that takes a value, a thing or a removal later has so long, s.
SETTLES_S: Final = 1.0
# Elements of a message that are nested deeper are not compared.
_DEEPEST: Final = 6
# A longer message is not read, octets.
_LONGEST: Final = 65_536


class Role(StrEnum):
    """What an operation does to the state of a device, by the verb of its name."""

    READS = "reads"
    WRITES = "writes"
    CREATES = "creates"
    REMOVES = "removes"
    OTHER = "other"


_VERBS: Final = {
    Role.READS: "get read query fetch retrieve show list describe",
    Role.WRITES: "set put update write change configure modify store save",
    Role.CREATES: "create add register insert new",
    Role.REMOVES: "delete remove unregister erase",
}
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
        told: names of the values in its response.
    """

    port: SoapPort
    operation: SoapOperation
    role: Role
    noun: str
    sent: dict[str, Simple] = field(default_factory=dict)
    needs: frozenset[str] = frozenset()
    told: frozenset[str] = frozenset()

    @property
    def label(self) -> str:
        """How the operation is called in patterns and on pages."""
        return label_of(self.port, self.operation)

    def shows(self, writer: Act) -> bool:
        """Return whether this operation reads values that another one writes."""
        return (
            self.role is Role.READS
            and writer.role is Role.WRITES
            and self.needs <= writer.sent.keys()
            and not self.told.isdisjoint(writer.sent.keys() - self.sent.keys())
        )

    def lists(self, creator: Act) -> bool:
        """Return whether this operation lists what another one creates: GetPresets, what AddPreset does."""
        own, made = self.noun.removesuffix("s"), creator.noun.removesuffix("s")
        return self.role is Role.READS and not self.needs and bool(made) and own.startswith(made)


def role_of(name: str) -> Role:
    """Return what an operation does by its name."""
    verb = next(iter(_WORD.findall(name)), "")
    return _ROLES.get(verb.lower(), Role.OTHER)


def acts_of(found: Wsdl) -> list[Act]:
    """Return the operations of a WSDL whose messages can be made."""
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
        frozenset(name for name, _, _ in _values(response)) if response else frozenset(),
    )


def _values(declared: Element, depth: int = 0, *, needed: bool = True) -> Iterator[tuple[str, Simple, bool]]:
    """Yield name and type of each value that an element may hold, and whether it must hold it."""
    kind = declared.type
    if isinstance(kind, Simple):
        if depth:
            yield local(declared.tag).lower(), kind, needed
        return
    for name, simple, required in kind.attributes:
        yield local(name).lower(), simple, needed and required
    if kind.text is not None:
        yield local(declared.tag).lower(), kind.text, needed
    for child in declared.children if depth < _DEEPEST else ():
        yield from _values(child, depth + 1, needed=needed and bool(child.minimum))


def payload_of(octets: bytes) -> etree._Element | None:
    """Return the first element in the Body of a message; None if it is none, or a long one."""
    if not 0 < len(octets) <= _LONGEST:
        return None
    try:
        root = parse(octets, comments=False)
    except NotXmlError:
        return None
    body = next((one for one in elements(root) if local(str(one.tag)) == "Body"), None)
    return next(iter(elements(body)), None) if body is not None else None


def texts_of(payload: etree._Element) -> dict[str, list[str]]:
    """Return the values in the content of a Body, by the name of their element or attribute in lower case."""
    found: dict[str, list[str]] = {}
    for one in payload.iter(etree.Element):
        if one is not payload and not len(one):
            found.setdefault(etree.QName(one).localname.lower(), []).append("".join(map(str, one.itertext())))
        for name, text in one.attrib.items():
            found.setdefault(etree.QName(str(name)).localname.lower(), []).append(str(text))
    return found
