"""Invalid variants of a valid document in any format, each with one fault at one place.

This module contains the faults that a list of members can have. The faults of values are in the modules of each format.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

Made = TypeVar("Made")
# A name and a text that no contract contains.
STRANGE_NAME = "roaas_unknown"
STRANGE_TEXT = "roaas-no-number"


@dataclass(frozen=True)
class Mutation(Generic[Made]):
    """A document with one fault.

    Attributes:
        kind: missing, unknown, duplicate, non-finite, ...: the last part of the requirement's id in class strict-input.
        what: the fault and its place, as a noun phrase.
        made: the invalid document.
        field: name of the invalid field, or empty.
        shown: the invalid value as an error message can quote it, or empty.
        malformed: whether it cannot be parsed (400) or has an invalid shape or value (422); None means either.
        reason: why validators reject it, or empty.
    """

    kind: str
    what: str
    made: Made
    field: str = ""
    shown: str = ""
    malformed: bool | None = None
    reason: str = ""


@dataclass(frozen=True)
class Member:
    """One member of an object or element.

    Attributes:
        name: local name.
        item: the member in its format.
        required: whether the contract requires a member of this name.
        repeatable: whether the contract allows several of them.
    """

    name: str
    item: Any
    required: bool = False
    repeatable: bool = False


def broken_members(
    where: str, members: Sequence[Member], strange: Iterable[Member], write: Callable[[list[Any]], Made]
) -> Iterator[Mutation[Made]]:
    """Yield the mutations of a list of members: one missing, one duplicated, an unknown one at the end and the start.

    ``where`` names the place; ``write`` returns the document with other members there.
    """
    items = [member.item for member in members]
    for index, member in enumerate(members):
        before, after = items[:index], items[index + 1 :]
        if member.required:
            missing = write([*before, *after])
            yield Mutation("missing", f"{member.name} missing at {where}", missing, member.name, malformed=False)
        if not member.repeatable:
            yield Mutation("duplicate", f"{member.name} twice at {where}", write([*before, *[member.item] * 2, *after]))
    for member in strange:
        for changed in ([*items, member.item], [member.item, *items]):
            what = f"the unknown {member.name} at {where}"
            yield Mutation("unknown", what, write(changed), member.name, malformed=False)
