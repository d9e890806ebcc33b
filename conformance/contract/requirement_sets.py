"""Frozen sets of requirements: a robot judged by one stays judged by it, whatever a later suite adds.

``sets/NAME.toml`` of a pack holds id, level and text digest of each requirement. It never changes once it is published.
``python -m conformance.contract.freeze NAME`` writes one from the ledger. A newer requirement is in no set until
the next one is frozen.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from conformance.contract.classes import Level
from conformance.contract.toml_file import Text, TomlFileError, read_toml

if TYPE_CHECKING:
    from collections.abc import Mapping

    from conformance.contract.ledger import Requirement
    from conformance.contract.pack import Contract

_UNFROZEN = "unfrozen"


class RequirementSetError(TomlFileError):
    """A set that there is not, or whose file cannot be used; the message names it."""


class Frozen(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A requirement as a set has it: its level, and the digest of its text, as `sha256:…`."""

    level: Level
    text: Text


class _File(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    requirements: dict[str, Frozen]


@dataclass(frozen=True)
class RequirementSet:
    """Requirements under a name.

    Attributes:
        name: as in ``--requirements NAME``.
        requirements: level and text's digest, by id.
    """

    name: str
    requirements: Mapping[str, Frozen]

    @property
    def digest(self) -> str:
        """Over ids, levels and texts, as `sha256:…`."""
        return _digest("".join(f"{id_} {item.level} {item.text}\n" for id_, item in sorted(self.requirements.items())))

    @property
    def told(self) -> dict[str, str]:
        """Name and digest, as a result has them."""
        return {"name": self.name, "digest": self.digest}


def set_folder(contract: Contract) -> Path:
    """Return the folder that holds a pack's sets."""
    return contract.directory / "sets"


def names(contract: Contract) -> tuple[str, ...]:
    """Return the names of a pack's sets."""
    return tuple(sorted(path.stem for path in set_folder(contract).glob("*.toml")))


def load_set(contract: Contract, name: str) -> RequirementSet:
    """Read a set.

    Raises:
        RequirementSetError: there is none of that name, or its file cannot be used.
    """
    if name not in names(contract):
        there = ", ".join(names(contract)) or "none"
        raise RequirementSetError(f"{contract.name} has no set of requirements {name!r}; there are {there}")
    path = set_folder(contract) / f"{name}.toml"
    return RequirementSet(name, read_toml(path, _File, RequirementSetError).requirements)


def current(contract: Contract, ledger: Mapping[str, Requirement]) -> RequirementSet:
    """Return a ledger as a set: under the name of the frozen one that holds the same, where there is one."""
    requirements = {id_: frozen(item) for id_, item in ledger.items()}
    sets = (load_set(contract, name) for name in names(contract))
    same = next((one for one in sets if one.requirements == requirements), None)
    return same or RequirementSet(_UNFROZEN, requirements)


def frozen(requirement: Requirement) -> Frozen:
    """A requirement as a set has it."""
    return Frozen(requirement.level, _digest(requirement.text))


def judged_by(contract: Contract, name: str | None) -> RequirementSet | None:
    """The set that a run judges by; None where the contract has no pack.toml.

    Args:
        contract: of the run.
        name: what was asked for; None for all that this suite has.

    Raises:
        RequirementSetError: there is none of that name, or the contract has no pack.toml.
    """
    if contract.manifest is None or contract.only:
        if name is not None:
            raise RequirementSetError(f"{contract.directory} has no set of requirements {name!r}: it has no pack.toml")
        return None
    return current(contract, contract.ledger) if name is None else load_set(contract, name)


def _digest(text: str) -> str:
    return f"sha256:{hashlib.sha256(text.encode()).hexdigest()}"
