"""Find a requirement by its id, among those of a pack and those that bind any web API."""

from difflib import get_close_matches

from conformance.contract.generic import generic_ledger
from conformance.contract.ledger import Requirement, renamed
from conformance.contract.pack import Contract

_NEAR, _CUTOFF = 5, 0.5


class UnknownRequirementError(ValueError):
    """Raised for an id that no ledger has; the message names it and ids that look alike."""


def known(contract: Contract) -> dict[str, Requirement]:
    """Return the requirements of a pack and those that bind any web API, by id."""
    return {**generic_ledger(), **contract.ledger}


def page_of(id_: str) -> str:
    """Return the page of a requirement on the documentation site, without a suffix."""
    return f"requirements/{id_}"


def found(contract: Contract, id_: str) -> Requirement:
    """Return the requirement with an id, or with an id that it had before.

    Raises:
        UnknownRequirementError: no ledger has it.
    """
    ledger = known(contract)
    aliases = renamed(ledger)
    requirement = ledger.get(aliases.get(id_, id_))
    if requirement is None:
        names = [*ledger, *aliases]
        near = get_close_matches(id_, names, _NEAR, _CUTOFF) or [name for name in names if id_.lower() in name.lower()]
        hint = f"did you mean {', '.join(near[:_NEAR])}? " if near else ""
        raise UnknownRequirementError(
            f"contract {contract.name} has no requirement {id_!r}; {hint}`roaas explain` lists all; "
            "--contract names another contract"
        )
    return requirement
