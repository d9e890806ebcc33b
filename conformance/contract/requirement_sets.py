"""Frozen requirement sets: a robot that is scored by one is not affected by requirements that a later suite adds.

``sets/NAME.toml`` of a pack lists id, level and text digest of each requirement. A published set never changes.
"""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import msgspec

from conformance.contract.classes import Level
from conformance.contract.ledger import Requirement
from conformance.contract.pack import Contract
from conformance.contract.toml_file import Text, TomlFileError, read_toml

_UNFROZEN = "unfrozen"


class RequirementSetError(TomlFileError):
    """Raised for a requirement set that does not exist or is invalid; the message has the set's name."""


class Frozen(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A requirement in a set: its level, and the digest of its text as `sha256:…`."""

    level: Level
    text: Text


class _File(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    requirements: dict[str, Frozen]


@dataclass(frozen=True)
class RequirementSet:
    """A named set of requirements.

    Attributes:
        name: as in ``--requirements NAME``.
        frozen_as: level and text digest, by the ids at the time of the freeze.
        renamed: the present id by each older one.
    """

    name: str
    frozen_as: Mapping[str, Frozen]
    renamed: Mapping[str, str] = field(default_factory=dict)

    @cached_property
    def requirements(self) -> dict[str, Frozen]:
        """Return level and text digest by present id."""
        return {self.renamed.get(id_, id_): item for id_, item in self.frozen_as.items()}

    @property
    def digest(self) -> str:
        """The digest of all ids, levels and texts as they were frozen, as `sha256:…`; a new name does not change it."""
        return _digest("".join(f"{id_} {item.level} {item.text}\n" for id_, item in sorted(self.frozen_as.items())))

    @property
    def facts(self) -> dict[str, str]:
        """Return name and digest, for a result."""
        return {"name": self.name, "digest": self.digest}


def set_folder(contract: Contract) -> Path:
    """Return the folder with a pack's requirement sets."""
    return contract.directory / "sets"


def names(contract: Contract) -> tuple[str, ...]:
    """Return the names of a pack's requirement sets."""
    return tuple(sorted(path.stem for path in set_folder(contract).glob("*.toml")))


def load_set(contract: Contract, name: str) -> RequirementSet:
    """Read a requirement set.

    Raises:
        RequirementSetError: the set does not exist or is invalid.
    """
    if name not in names(contract):
        there = ", ".join(names(contract)) or "none"
        raise RequirementSetError(f"{contract.name} has no set of requirements {name!r}; there are {there}")
    path = set_folder(contract) / f"{name}.toml"
    return RequirementSet(name, read_toml(path, _File, RequirementSetError).requirements, contract.ids_by_alias)


def current(contract: Contract, ledger: Mapping[str, Requirement]) -> RequirementSet:
    """Return a ledger as a set, with the name of the frozen set of the same content if there is one."""
    requirements = {id_: frozen_form(item) for id_, item in ledger.items()}
    sets = (load_set(contract, name) for name in names(contract))
    return next((set_ for set_ in sets if set_.requirements == requirements), RequirementSet(_UNFROZEN, requirements))


def frozen_form(requirement: Requirement) -> Frozen:
    """Return a requirement in its form in a frozen set: level and digest of the text."""
    return Frozen(requirement.level, _digest(requirement.text))


def judged_by(contract: Contract, name: str | None) -> RequirementSet | None:
    """Return the set that scores a run, or None if the contract has no pack.toml.

    Args:
        contract: the contract of the run.
        name: the requested set; None means everything in this suite.

    Raises:
        RequirementSetError: the set does not exist, or the contract has no pack.toml.
    """
    if contract.manifest is None or contract.only:
        if name is not None:
            raise RequirementSetError(f"{contract.directory} has no set of requirements {name!r}: it has no pack.toml")
        return None
    return current(contract, contract.ledger) if name is None else load_set(contract, name)


def _digest(text: str) -> str:
    return f"sha256:{hashlib.sha256(text.encode()).hexdigest()}"
