"""The conformance classes and requirements that apply to any web API."""

from functools import cache

import msgspec

from conformance.contract.classes import ConformanceClass, Interface, Topic
from conformance.contract.ledger import Requirement, load_ledger
from conformance.contract.locating import GENERIC_RULES, ContractError
from conformance.contract.toml_file import Text, read_toml

LEDGER = "requirements.toml"


class ClassEntry(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A conformance class as written in ``classes.toml`` and ``pack.toml``."""

    name: Text
    title: Text | None = None
    interfaces: tuple[Interface, ...] | None = None
    one_is_enough: bool = False
    topic: Topic | None = None
    acts: bool = False
    within: str = ""
    beside: bool = False


class _Classes(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The content of ``rules/classes.toml``."""

    class_: tuple[ClassEntry, ...] = msgspec.field(name="class")


@cache
def generic_classes() -> dict[str, ConformanceClass]:
    """Return the conformance classes that apply to any web API, by name."""
    entries = read_toml(GENERIC_RULES / "classes.toml", _Classes, ContractError).class_
    return {
        item.name: ConformanceClass(
            item.name,
            item.title or "",
            item.interfaces or (),
            item.one_is_enough,
            item.topic or Topic.SERVICE,
            item.within,
            item.beside,
        )
        for item in entries
    }


@cache
def generic_ledger() -> dict[str, Requirement]:
    """Return the requirements that apply to any web API, by id."""
    return load_ledger(GENERIC_RULES / LEDGER, generic_classes())
