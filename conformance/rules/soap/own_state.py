"""Faults that the device's state explains: a thing was acknowledged, started, used up, removed, or ended before."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import accumulate
from typing import TYPE_CHECKING, Final

from conformance.api.soap.roles import LAST, REFERS, Role, payload_of, role_of, texts_of
from conformance.documents.wsdl import Wsdl
from conformance.documents.wsdl_pack import each, label_of
from conformance.documents.xml import elements, local
from conformance.scenarios.soap_survey import Kind, SoapProbe

if TYPE_CHECKING:
    from lxml import etree

# Valid messages without a wrong one between them that show that an operation may be repeated.
_REPEATED: Final = 3
_CALLED: Final = frozenset({Kind.USUAL, Kind.VARIED, Kind.AGAIN})
_ENDS: Final = LAST | {Role.OTHER}
# A sent operation, and the values in its message with their names.
_Sent = tuple[str, frozenset[tuple[str, str]]]


def probes_left(trace: Iterable[SoapProbe], found: Wsdl | None) -> list[SoapProbe]:
    """Return the probes whose response the device's state does not explain.

    The fault of an operation that reads is explained if the suite ended or removed its thing since the last success. A
    declared fault says by itself that the state forbids the operation. It counts only if the same message, with an id,
    succeeds before and after, and nothing was done in between. What neither reads nor writes by its name need not be
    repeatable: its fault counts only if it was repeated without faults before any wrong message, and succeeds later.
    """
    probes = list(trace)
    sent = [(one.operation, _values(one)) for one in probes]
    names = [role_of(one.operation.rpartition("/")[2]) for one in probes]
    good = [one.is_success for one in probes]
    # How many successes that may have changed the device came before each probe.
    changes = [0, *accumulate(ok and role is not Role.READS for ok, role in zip(good, names, strict=True))]
    before, after = _successes(good, sent), _successes(good[::-1], sent[::-1])[::-1]
    declared, kept = _declared_faults(probes, found), list[SoapProbe]()
    for index, (probe, role, (_, values)) in enumerate(zip(probes, names, sent, strict=True)):
        fault, last, later = probe.fault, before[index], after[index]
        later = None if later is None else len(probes) - 1 - later
        is_proven = last is not None and later is not None and changes[later] == changes[last + 1]
        if fault is None or probe.kind not in _CALLED:
            is_kept = True
        elif _inside(fault) & declared.get(probe.operation, frozenset()):
            is_kept = is_proven and role is Role.READS and any(REFERS.search(name) for name, _ in values)
        elif role in {Role.OTHER, Role.ENDS}:
            is_kept = is_proven and probe.kind is Kind.AGAIN and _is_repeatable(probes, probe.operation)
        else:
            ids = {text for name, text in values if REFERS.search(name)}
            others = range(0 if last is None else last + 1, index)
            is_kept = not any(
                good[other] and names[other] in _ENDS and ids & {text for _, text in sent[other][1]} for other in others
            )
        kept += [probe] if is_kept else []
    return kept


def _values(probe: SoapProbe) -> frozenset[tuple[str, str]]:
    """Return the values in a valid message, each with its name."""
    seen = probe.exchange or probe.unanswered
    payload = payload_of(seen.request.body) if seen is not None else None
    found = texts_of(payload) if payload is not None else {}
    return frozenset((name, text) for name, texts in found.items() for text in texts)


def _successes(good: list[bool], sent: list[_Sent]) -> list[int | None]:
    """Return for each message where the same one succeeded last, before it."""
    found, last = list[int | None](), dict[_Sent, int]()
    for index, (is_good, key) in enumerate(zip(good, sent, strict=True)):
        found.append(last.get(key))
        if is_good:
            last[key] = index
    return found


def _declared_faults(probes: list[SoapProbe], found: Wsdl | None) -> dict[str, frozenset[str]]:
    """Return the faults that each operation declares, but those of all that answer messages the schema forbids."""
    by_label = {label_of(port, one): one.faults for port, one in each(found.ports)} if found is not None else {}
    general = frozenset.intersection(*by_label.values()) if by_label else frozenset()
    refusing = frozenset(
        tag
        for probe in probes
        if probe.kind is Kind.INVALID and probe.fault is not None
        for tag in _inside(probe.fault)
    )
    return {label: faults - (general & refusing) for label, faults in by_label.items()}


def entries(fault: etree._Element) -> list[etree._Element]:
    """Return the elements in the detail of a fault."""
    return [
        element for part in elements(fault) if local(str(part.tag)).lower() == "detail" for element in elements(part)
    ]


def _inside(fault: etree._Element) -> frozenset[str]:
    return frozenset(str(element.tag) for element in entries(fault))


def _is_repeatable(probes: list[SoapProbe], label: str) -> bool:
    usual = [probe for probe in probes if probe.operation == label and probe.kind is Kind.USUAL]
    return len(usual) >= _REPEATED and all(probe.is_success for probe in usual)
