"""The data of one run: statement, contract, permissions, and the evidence so far."""

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Final, Literal

from conformance.contract.classes import Interface
from conformance.contract.pack import Contract
from conformance.contract.requirement_sets import RequirementSet
from conformance.statement.statement import Statement, empty_statement
from conformance.verdict.effort import Effort, Tally
from conformance.verdict.evidence import Judge
from conformance.verdict.time_limit import TimeLimit

#: Why a requirement outside the selection has no verdict.
UNSELECTED: Final = "it was not selected for this run"
#: Why such a run certifies nothing.
WITHHELD: Final = "only selected requirements were judged, so no class passes"


@dataclass(frozen=True)
class Selection:
    """The requirements that are judged, and whether the run ends at the first finding.

    Attributes:
        ids: of the requirements; None means all.
        played: ids whose checks are played unless they move the device; None means all.
        exit_first: whether nothing further is tested once a MUST is found to fail.
        accepted: ids whose failures the baseline accepts, so that they end no run.
    """

    ids: frozenset[str] | None = None
    played: frozenset[str] | None = None
    exit_first: bool = False
    accepted: frozenset[str] = frozenset()

    def has(self, requirement: str) -> bool:
        """Return whether a requirement is judged."""
        return self.ids is None or requirement in self.ids

    def ends_at(self, requirement: str) -> bool:
        """Return whether a failure of a requirement ends the run."""
        return self.exit_first and self.has(requirement) and requirement not in self.accepted


_NEXT_TO_ALL = 0.99  # if more of the cases than this share were sent, the verdict does not mention the time limit
_FEWEST_SHARE = 0.04


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
        ros: where the statement has a ROS map: "watch" the robot's graph, or "play" the robot; empty if neither.
        seed: seed of everything random.
        requirement_set: the frozen set that scores the robot, or None for the whole contract.
        given: inputs that the result repeats, beside the statement.
        effort: how much is tried; reduced when the robot responds slowly.
        digests: of what judges, as in result.json; empty until the run begins.
        judge: the evidence.
        aborted: why the run was aborted, or empty.
        signals: how many signals that end the run came.
        interrupted: whether the run was interrupted.
        ended_by: what interrupted it, such as SIGHUP, if that is known.
        losses: how often the device stopped responding.
        restart_command: command that restarts a device that stopped responding, or empty.
        wait_s: how long a device that stopped responding is waited for, s; None means as the restart command has it.
        stop_s: for how long the stop of the device is tried by default, s.
        refused: how the device refused the run's credentials, so that nothing, or not all, was judged; or empty.
        unshown: why nothing of a device with a description of its own was shown, or empty.
        stop_undelivered: why the device may still move after the run; empty if it was stopped, or was not moved.
        unreachable: why an interface was not reachable at the start.
        tally: the generated cases of all explorations, and those that time did not allow.
        limit: the time that the run may take, and what it left out.
        selection: the requirements that are judged of the claimed ones.
        prepare: loads what is needed after the run; called while a check waits for the robot.
    """

    statement: Statement = field(default_factory=lambda: empty_statement(Contract.load()))
    contract: Contract = field(default_factory=Contract.load)
    claims: tuple[str, ...] = ()
    allow_motion: bool = False
    ros: Literal["", "watch", "play"] = ""
    seed: int = 0
    effort: Effort = field(default_factory=Effort)
    requirement_set: RequirementSet | None = None
    given: Given = Given()
    digests: dict[str, Any] = field(default_factory=dict)
    judge: Judge = field(init=False)
    aborted: str = ""
    signals: int = 0
    interrupted: bool = False
    ended_by: str = ""
    losses: int = 0
    restart_command: str = ""
    wait_s: float | None = None
    stop_s: float = 20.0
    refused: str = ""
    unshown: str = ""
    stop_undelivered: str = ""
    unreachable: dict[Interface, str] = field(default_factory=dict)
    tally: Tally = field(default_factory=Tally)
    limit: TimeLimit = field(default_factory=TimeLimit)
    selection: Selection = field(default_factory=Selection)
    prepare: Callable[[], object] | None = None

    def __post_init__(self) -> None:
        self.judge = Judge(self.contract.ledger)

    @property
    def mapped_calls(self) -> tuple[str, ...]:
        """The operations that maps in the statement name, of those that may be called in this run."""
        said = self.statement
        maps = (said.motion_map, said.state_map) if self.allow_motion else ()
        moves = [call for one in maps if one for call in one.calls]
        acts = self.ros == "play" or (self.ros and self.allow_motion)
        return (*moves, *(said.ros_map.calls if said.ros_map and acts else ()))

    def out_of_time(self, requirement: str) -> None:
        """Record that the time was over before a case of a requirement was tried."""
        say = self.judge.note if self.contract.is_claimed else self.judge.not_seen
        say(requirement, self.limit.reason)

    @property
    def tries_stop_s(self) -> float:
        """How long the stop of the device is tried: as long as a lost device is waited for, s."""
        return self.wait_s or self.stop_s

    @property
    def scored_ids(self) -> frozenset[str] | None:
        """Return the requirements that count: those of the frozen set, some by an alias; None means all."""
        if self.requirement_set is None:
            return None
        frozen, ledger = self.requirement_set.requirements.keys(), self.contract.ledger.values()
        return frozenset(item.id for item in ledger if not frozen.isdisjoint({item.id, *item.aliases}))

    @property
    def beside(self) -> frozenset[str]:
        """The classes that are judged without deciding the verdict, because no claim names them."""
        named = self.statement.claims or ()
        classes = self.contract.classes
        return frozenset(name for name in self.claims if classes[name].beside and name not in named)

    @property
    def share(self) -> float:
        """The share of the cases that were tried, of those that a fast robot gets at this effort, 0 to 1."""
        return self.effort.speed.share * self.tally.share

    @property
    def less(self) -> str:
        """On how many of the cases the verdict rests, and why not on all; empty if next to all were tried."""
        if self.share > _NEXT_TO_ALL:
            return ""
        why = f"{self.effort.usual_ms:.0f} ms an answer" if self.effort.slow else "time ran out"
        return f"on {max(1, round(100 * self.share))} % of the cases: {why}"

    @property
    def enough(self) -> bool:
        """Whether enough cases were tried for a verdict.

        An exploration has up to 100 cases, and at least three. A fault that every fifth value shows is missed by three
        cases more often than not (0.8 ** 3 = 0.51), and found by four. Operations that were not called support nothing.
        """
        return self.share >= _FEWEST_SHARE and not self.limit.uncalled

    @property
    def is_decided(self) -> bool:
        """Whether the robot can be conformant: enough was tried, nothing in the suite broke, and it was stopped."""
        return self.enough and not self.judge.faults and not self.stop_undelivered

    @property
    def remarks(self) -> tuple[str, ...]:
        """Remarks for the report about cases that were omitted because responses took long or time ran out."""
        found = [self.effort.speed.remark] if self.effort.speed.remark else []
        if self.tally.cut_short:
            checks = ", ".join(
                f"{name} ({count} case{'' if count == 1 else 's'})"
                for name, count in sorted(self.tally.cut_short.items())
            )
            found.append(
                f"For want of time ({self.effort.longest_s:g} s for each exploration at {self.effort.name} effort), "
                f"cases that were made were not tried: {checks}."
            )
        return tuple(found)
