"""What is not there of a WSDL's documents: the device's fault, or a limit of what the suite knows."""

from collections.abc import Iterable
from typing import Final
from urllib.parse import urlsplit

from conformance.commandline.device_options import advice
from conformance.documents.wsdl_imports import Collected
from conformance.documents.xml_names import namespace
from conformance.documents.xsd import Types

# How libxml2 and xmlschema call content models that break the rule of unique particle attribution.
_AMBIGUOUS: Final = ("determinist", "Unique Particle Attribution")


def gaps(
    found: Collected, types: Types, location: str, named: Iterable[tuple[str, str]]
) -> tuple[list[str], list[str]]:
    """Return what is wrong with the documents of a WSDL, and what is not known of them through no fault of the device.

    A device is to blame for the documents on its own server, and for names that no document declares.

    Args:
        found: the documents.
        types: their schemas, compiled.
        location: that of the WSDL.
        named: who names an element in a message, and its tag.
    """
    own = f"{location.partition('://')[0]}://{urlsplit(location).netloc}/" if "://" in location else ""
    gone = {place: why for place, why in found.missing.items() if own and place.startswith(own)}
    faults = [f"{place} could not be read: {reason}" for place, reason in gone.items()]
    as_any = f"What it declares counts as any content{advice('; give its folder by --schemas')}."
    notes = [
        f"{place} could not be read: {reason}. {as_any}" for place, reason in found.missing.items() if place not in gone
    ]
    for space in found.lacking:
        if not found.imported[space] and any(one.space == space for one in types.unknown):
            notes += [f"No location leads to a schema of {space}. {as_any}"]
    if not found.missing:
        faults += [
            f"its schemas name the {one.kind} {one.tag}, which no document declares"
            for one in types.unknown
            if one.space not in found.lacking
        ]
    faults += [
        f"{who} names the element {tag}, which no schema declares"
        for who, tag in named
        if types.shape(tag) is None and namespace(tag) not in found.lacking
    ]
    faults += [f"two of its schemas declare the {one.kind} {one.tag}, each in its own way" for one in types.twice]
    if types.is_11 or (types.problems and all(any(words in one for words in _AMBIGUOUS) for one in types.problems)):
        notes.append(f"Its schemas are ambiguous or XSD 1.1, and one of two validators judges: {types.problems[0]}")
    else:
        faults += [f"its schemas are refused by one of two compilers: {problem}" for problem in types.problems]
    return faults, notes
