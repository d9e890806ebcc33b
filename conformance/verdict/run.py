"""The data of one run: the statement, what is judged and allowed, and the evidence so far."""

import hashlib
from dataclasses import dataclass, field
from typing import Any

from conformance.contract.interfaces import Interface
from conformance.contract.pack import Contract
from conformance.contract.requirement_sets import RequirementSet
from conformance.statement.statement import Statement, empty_statement
from conformance.verdict.effort import Effort
from conformance.verdict.evidence import Judge


def seed_of_nonce(nonce: str) -> int:
    """Return the run's seed for a nonce of a relying party: 48 bits that nobody could know before."""
    return int.from_bytes(hashlib.sha256(b"roaas-nonce/1\0" + nonce.encode()).digest()[:6])


@dataclass(frozen=True)
class Given:
    """The inputs of a run that a verifier of its result needs.

    Attributes:
        statement: digest of the statement file as `sha256:…`, or None.
        baseline: digest of the baseline file as `sha256:…`, or None.
        nonce: chosen by the relying party, or None.
        places: lines of claims and requirements in their files, as in result.json.
    """

    statement: str | None = None
    baseline: str | None = None
    nonce: str | None = None
    places: dict[str, Any] = field(default_factory=dict)


@dataclass
class Run:
    """The data of one run, without connections.

    Attributes:
        statement: the vendor's statement, with command line options applied.
        contract: the contract that the robot is judged by.
        claims: the classes that are judged.
        allow_motion: whether the robot may be moved.
        seed: seed of everything random.
        requirement_set: the frozen set that scores the robot, or None for the whole contract.
        given: inputs that the result repeats, beside the statement.
        effort: how much is tried; reduced when the robot responds slowly.
        judge: the evidence.
        aborted: why the run was aborted, or empty.
        interrupted: whether the user interrupted the run.
        unreachable: why an interface was not reachable at the start.
        cut_short: number of generated cases that time did not allow, by check.
    """

    statement: Statement = field(default_factory=lambda: empty_statement(Contract.load()))
    contract: Contract = field(default_factory=Contract.load)
    claims: tuple[str, ...] = ()
    allow_motion: bool = False
    seed: int = 0
    effort: Effort = field(default_factory=Effort)
    requirement_set: RequirementSet | None = None
    given: Given = Given()
    judge: Judge = field(init=False)
    aborted: str = ""
    interrupted: bool = False
    unreachable: dict[Interface, str] = field(default_factory=dict)
    cut_short: dict[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.judge = Judge(self.contract.ledger)

    @property
    def scored(self) -> frozenset[str] | None:
        """The requirements that count: those of the frozen set, some of them by an alias; None: all."""
        if self.requirement_set is None:
            return None
        frozen, ledger = self.requirement_set.requirements.keys(), self.contract.ledger.values()
        return frozenset(item.id for item in ledger if not frozen.isdisjoint({item.id, *item.aliases}))

    @property
    def remarks(self) -> tuple[str, ...]:
        """Remarks for the report about cases that were omitted because responses took long or time ran out."""
        found = [self.effort.speed.remark] if self.effort.speed.remark else []
        if self.cut_short:
            checks = ", ".join(f"{name} ({count} cases)" for name, count in sorted(self.cut_short.items()))
            found.append(
                f"For want of time ({self.effort.budget_s:g} s for each exploration at {self.effort.name} effort), "
                f"cases that were made were not tried: {checks}."
            )
        return tuple(found)
