"""Mutations of a valid document, in whatever format: each breaks it in one way, at one place.

A format shows a place of its documents as a list of members, and writes the broken list. What can go wrong with any
list is here; what can go wrong with a text, each format knows for itself.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

Made = TypeVar("Made")
# Names and texts that no contract has.
STRANGE_NAME = "roaas_unknown"
STRANGE_TEXT = "roaas-no-number"


@dataclass(frozen=True)
class Mutation(Generic[Made]):
    """A document with one thing wrong.

    Attributes:
        kind: missing, unknown, duplicate, non-finite, ...: the end of the id in class strict-input, behind the format.
        what: what is wrong and where, as a noun phrase.
        made: the broken document, as its format has it.
        field: name of the field that is wrong, or empty.
        shown: what a refusal can name of the value, or empty.
        malformed: whether it cannot be parsed at all (400), or has a wrong shape or value (422); None: either.
        reason: why validators refuse it, or empty.
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
    """One child of a place in a valid document.

    Attributes:
        name: local name.
        item: the child, as its format has it.
        required: whether the contract requires one of the name.
        repeatable: whether the contract allows any number of them.
    """

    name: str
    item: Any
    required: bool = False
    repeatable: bool = False


def broken_members(
    where: str, members: Sequence[Member], strange: Iterable[Member], write: Callable[[list[Any]], Made]
) -> Iterator[Mutation[Made]]:
    """Yield the mutations of a list of members: one missing, one twice, a strange one last and first.

    ``where`` names the place, and ``write`` makes a document with other items there.
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
