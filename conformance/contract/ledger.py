"""The requirement ledger: each requirement with its class, level, text, source and origin."""

from collections.abc import Collection, Container, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import msgspec

from conformance.contract.classes import CauseKind, Level, Origin, Prerequisite, Topic
from conformance.contract.toml_file import Text, TomlFileError, fit, read_tables


class LedgerError(TomlFileError):
    """Raised for an invalid ledger; the message names the requirement and the offending value."""


@dataclass(frozen=True)
class Requirement:
    """One requirement.

    Attributes:
        id: ``CLASS/NAME``.
        class_: its conformance class.
        level: how binding it is.
        text: the rule, in one sentence.
        source: section of contract.md (``contract.md#goals``), file of the contract, paper section, RFC clause or
            WS-I id; several are separated by "; ", and the first one is binding.
        origin: the kind of source.
        needs: what a run must have to judge it, beside the interface.
        untestable: why no check can judge it, or None.
        forbids: the kinds of causes that the requirement is about; it keeps the finding that other requirements share.
        aliases: ids that it had before, and ids of requirements that were merged into it. Checks and mutants may still
            name a part of it by such an id, and baselines and old results are read by them.
        same_as: requirements of the generic suite that ask the same: where a contract does not have them, what judges
            them judges this one; a contract that has them does not have a generic one beside them.
        also: further classes that it binds: it is judged when one of them is claimed, and all of them fail with it.
        topic: what it is about, for readers; None means its class's topic.
        breaks: what breaks in practice when a device does not meet it, or None.
    """

    id: str
    class_: str
    level: Level
    text: str
    source: str
    origin: Origin
    needs: tuple[Prerequisite, ...] = ()
    untestable: str | None = None
    forbids: tuple[CauseKind, ...] = ()
    aliases: tuple[str, ...] = ()
    same_as: tuple[str, ...] = ()
    also: tuple[str, ...] = ()
    topic: Topic | None = None
    breaks: str | None = None

    @property
    def classes(self) -> tuple[str, ...]:
        """Return the classes that the requirement binds, its own first."""
        return self.class_, *self.also

    def binds(self, claims: Container[str]) -> bool:
        """Return whether the requirement binds a device that claims some classes."""
        return any(name in claims for name in self.classes)


class _Entry(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A requirement as written in ``requirements.toml``."""

    level: Level
    text: Text
    source: Text
    origin: Origin
    needs: tuple[Prerequisite, ...] = ()
    untestable: Text | None = None
    forbids: tuple[CauseKind, ...] = ()
    aliases: tuple[Text, ...] = ()
    same_as: tuple[Text, ...] = ()
    also: tuple[Text, ...] = ()
    topic: Topic | None = None
    breaks: Text | None = None


def expanded(ids: Iterable[str], ledger: Iterable[str]) -> tuple[str, ...]:
    """Return ids with each pattern ``*/NAME`` replaced by the requirements of that name in all classes."""
    there = tuple(ledger)
    return tuple(
        id_
        for text in ids
        for id_ in ([id_ for id_ in there if id_.endswith(text[1:])] if text.startswith("*/") else [text])
    )


def ids_by_alias(ledger: Mapping[str, Requirement]) -> dict[str, str]:
    """Return the id that a requirement has now by each of its aliases."""
    return {alias: item.id for item in ledger.values() for alias in item.aliases}


def twins(ledger: Mapping[str, Requirement]) -> dict[str, str]:
    """Return by each id in `same_as` that a contract lacks the id of its requirement that asks the same."""
    return {other: item.id for item in ledger.values() for other in item.same_as if other not in ledger}


def classes_of(ledger: Mapping[str, Requirement], ids: Iterable[str]) -> tuple[str, ...]:
    """Return the conformance classes of some requirements, by their ids or aliases, which need not begin with them."""
    names = ids_by_alias(ledger)
    return tuple(dict.fromkeys(ledger[names.get(id_, id_)].class_ for id_ in ids))


def load_ledger(path: Path, classes: Collection[str]) -> dict[str, Requirement]:
    """Read a ``requirements.toml``.

    Args:
        path: the file.
        classes: names of the conformance classes that are allowed.

    Raises:
        LedgerError: the file cannot be read, or a requirement in it is invalid.
    """
    ledger: dict[str, Requirement] = {}
    for class_, requirements in read_tables(path, LedgerError).items():
        if class_ not in classes:
            raise LedgerError(f"{path}: {class_!r} is no conformance class; there are {', '.join(classes)}")
        if not isinstance(requirements, dict):
            raise LedgerError(f"{path}: {class_} = {requirements!r} must be tables: [{class_}.NAME]")
        for name, table in requirements.items():
            id_ = f"{class_}/{name}"
            entry = fit(table, _Entry, f"{path}: {id_}", LedgerError)
            ledger[id_] = Requirement(id_, class_, **msgspec.structs.asdict(entry))
    return ledger
