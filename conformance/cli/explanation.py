"""One requirement with everything that is known about it."""

from collections.abc import Iterable
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any

from conformance.contract.classes import Prerequisite
from conformance.contract.generic import generic_ledger
from conformance.contract.ledger import Requirement, ids_by_alias
from conformance.contract.pack import Contract
from conformance.engine.collected_checks import Check, checks_of
from conformance.explaining.advice import Source, Topic, sources_of, topic_of

#: At which effort checks run, and with how many cases.
EFFORTS = (
    "At each effort, unless a check says otherwise. Quick tries about a tenth of the cases that standard generates, "
    "and every other value of those that a check lists. Deep generates as many cases as --minutes allows."
)
#: By prerequisite: what a run needs to judge the requirement, in words.
NEEDS = {
    Prerequisite.MOTION: "permission to move the device (--allow-motion)",
    Prerequisite.OBSERVER: "a view of what requests cause: a ROS probe (--ros-domain-id), or the device's own list",
    Prerequisite.LIMITS: "limits in the statement",
    Prerequisite.HOLD: "a hold time in the statement (hold_s, of [limits] or of the motion map)",
    Prerequisite.RESOLVED: "declared tolerances that are small beside the limits",
    Prerequisite.SEEN: "a device that shows this by itself; others are not judged by it",
    Prerequisite.PROBE: "a ROS probe (--ros-domain-id)",
}


@dataclass(frozen=True)
class Explanation:
    """A requirement with its reasons, sources, checks, mutants and advice.

    Attributes:
        requirement: the requirement.
        sources: where it comes from.
        topic: why it matters and how to meet it, or None.
        checks: the checks that judge it.
        mutants: the hand-written mutants that it must kill, each with a name and what it `says`.
    """

    requirement: Requirement
    sources: tuple[Source, ...]
    topic: Topic | None
    checks: tuple[Check, ...]
    mutants: tuple[Any, ...]

    @property
    def why(self) -> str:
        """Return what breaks in practice: the ledger's text on this requirement, then the text on its subject."""
        return " ".join(filter(None, (self.requirement.breaks, self.topic.why if self.topic else None)))


def explanation_of(contract: Contract, requirement: Requirement, mutants: Iterable[Any] = ()) -> Explanation:
    """Return the explanation of a requirement, with those of a pack's mutants that it must kill.

    Raises:
        ContractError: a module with checks cannot be imported.
    """
    return Explanation(
        requirement,
        sources_of(requirement.source),
        topic_of(requirement.id),
        checks_of(contract).get(requirement.id, ()),
        tuple(mutant for mutant in mutants if requirement.id in mutant.catches),
    )


_NEAR, _CUTOFF = 5, 0.5


class UnknownRequirementError(ValueError):
    """Raised for an id that no ledger has; the message names it and ids that look alike."""


def ledger_of(contract: Contract) -> dict[str, Requirement]:
    """Return the requirements of a pack and those that bind any web API, by id."""
    return {**generic_ledger(), **contract.ledger}


def page_of(id_: str) -> str:
    """Return the page of a requirement on the documentation site, without a suffix."""
    return f"requirements/{id_}"


def find(contract: Contract, id_: str) -> Requirement:
    """Return the requirement with an id, or with an id that it had before.

    Raises:
        UnknownRequirementError: no ledger has it.
    """
    ledger = ledger_of(contract)
    aliases = ids_by_alias(ledger)
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
