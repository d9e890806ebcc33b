"""What one run knows: what is claimed of a robot, what may be done to it, and what has been found so far."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from conformance.contract.pack import Contract
from conformance.statement.statement import Statement, empty_statement
from conformance.verdict.effort import Effort
from conformance.verdict.evidence import Judge

if TYPE_CHECKING:
    from conformance.contract.interfaces import Interface
    from conformance.contract.requirement_sets import RequirementSet


def seed_of_nonce(nonce: str) -> int:
    """The seed of a run that a relying party asked for with a nonce: it could not be known before; 48 bits."""
    return int.from_bytes(hashlib.sha256(b"roaas-nonce/1\0" + nonce.encode()).digest()[:6])


@dataclass(frozen=True)
class Given:
    """What a run was asked with, for whoever checks its result.

    Attributes:
        statement: digest of the statement's file, as `sha256:…`; None where there was none.
        baseline: digest of the file of accepted failures, likewise.
        nonce: what the relying party chose, or None.
        places: where in their files claims and requirements stand, as result.json has it.
    """

    statement: str | None = None
    baseline: str | None = None
    nonce: str | None = None
    places: dict[str, Any] = field(default_factory=dict)


@dataclass
class Run:
    """One run: data only, whoever is connected to what.

    Attributes:
        statement: what the vendor says, options applied.
        contract: what the robot is judged by.
        claims: the classes that are judged.
        allow_motion: whether the robot may be moved.
        seed: of everything random.
        requirement_set: what the robot is scored by, or None for all of the contract.
        given: what is told of that in the result, beside the statement.
        effort: how much is tried; lessened once it is known how slowly the robot answers.
        judge: what has been found.
        aborted: why the robot cannot be asked any more, or empty.
        interrupted: whether somebody broke the run off.
        unreachable: why an interface was not reached at the start.
        cut_short: by check, how many of the cases that were made for it were not tried for want of time.
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
    def remarks(self) -> tuple[str, ...]:
        """What a reader has to know of how much was tried: what was left out because answers, or cases, took long."""
        found = [self.effort.speed.remark] if self.effort.speed.remark else []
        if self.cut_short:
            checks = ", ".join(f"{name} ({count} cases)" for name, count in sorted(self.cut_short.items()))
            found.append(
                f"For want of time ({self.effort.budget_s:g} s for each exploration at {self.effort.name} effort), "
                f"cases that were made were not tried: {checks}."
            )
        return tuple(found)
