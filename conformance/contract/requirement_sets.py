"""Requirement sets: which requirements a run judged by, under a name and a digest.

A set's digest is over id, level and text of each of its requirements, in the order of their ids.
"""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

from conformance.contract.files import CONTRACT_DIR, CONTRACT_VERSION, Contract

if TYPE_CHECKING:
    from collections.abc import Iterable

    from conformance.contract.ledger import Requirement


def digest_of(requirements: Iterable[Requirement]) -> str:
    """The digest of a set, as `sha256:…`."""
    lines = sorted(f"{item.id}\0{item.level}\0{item.text}\n" for item in requirements)
    return f"sha256:{hashlib.sha256(''.join(lines).encode()).hexdigest()}"


def set_of(contract: Contract) -> dict[str, str] | None:
    """Name and digest of the set that a contract judges by; None where it is a contract of one's own."""
    if contract.directory.resolve() != CONTRACT_DIR or contract.only:
        return None
    return {"name": CONTRACT_VERSION, "digest": digest_of(contract.ledger.values())}


def known_sets() -> dict[str, str]:
    """Name and digest of each set that this suite judges by."""
    return {CONTRACT_VERSION: digest_of(Contract.load().ledger.values())}
