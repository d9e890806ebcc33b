"""The judge: checks and observers say what they saw, and it keeps the evidence, requirement by requirement."""

from __future__ import annotations

import re
import threading
import time
from collections import deque
from collections.abc import Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from conformance.contract.classes import CauseKind
from conformance.transport.exchange import NoAnswer, Unanswered
from conformance.verdict.finding import Finding, Sent, causes_of, kind_of, observed_in, subject_of

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Iterator

    from conformance.contract.ledger import Requirement
    from conformance.transport.exchange import Attempt, Request

# Findings of one requirement that are kept: those that break its rule, and those whose cause others may meet as well.
MAX_FINDINGS = 5
MAX_CAUSES = 20
# Requests before a finding that are kept with it.
MAX_SEQUENCE = 40
# What differs between two cases of one finding: numbers, and values in quotes.
_VALUES = re.compile(r"[-+]?\d[\d.e+-]*|'[^']*'|\"[^\"]*\"")


class RefutedError(AssertionError):
    """A property does not hold: tells Hypothesis to look for a smaller case. The judge has the evidence already."""


class HarnessError(Exception):
    """The suite made what the contract does not allow, and was about to send it as valid: never the robot's failure.

    What a check was to judge is in error then, and the run ends with 4 unless something else failed.
    """


@dataclass
class Evidence:
    """What is known of one requirement.

    Attributes:
        cases: how many cases were judged.
        findings: causes of failure, by cause.
        skips: reasons why something could not be judged that had to be.
        errors: reasons why judging broke off.
        notes: remarks that change no verdict.
        checks: names of the checks that judged it.
        unclaimed: why it does not apply to a robot for which no classes were named.
        unshown: how many cases failed in further ways than are kept as findings.
        because: the finding of another requirement because of which this one could not be tested.
    """

    cases: int = 0
    findings: dict[str, Finding] = field(default_factory=dict)
    skips: list[str] = field(default_factory=list)
    errors: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    checks: set[str] = field(default_factory=set)
    unclaimed: str = ""
    unshown: int = 0
    because: Finding | None = None

    @property
    def failures(self) -> int:
        """Return how many cases failed."""
        return sum(finding.seen for finding in self.findings.values()) + self.unshown


class Judge:
    """Collects evidence from checks and observers.

    Args:
        known: the requirements, by id; or their ids alone.

    Attributes:
        evidence: by requirement.
        check_name: of the check that runs.
        at_risk: the requirements that a hostile request is about to test; a robot that dies of it has failed them.
        met: what the check that runs has found so far, newest last.
        ended_by: the finding after which the robot stopped responding, or None.
    """

    def __init__(self, known: Collection[str] | Mapping[str, Requirement]) -> None:
        self.evidence: dict[str, Evidence] = {id_: Evidence() for id_ in sorted(known)}
        self.check_name = ""
        self.at_risk: tuple[str, ...] = ()
        self.met: list[Finding] = []
        self.ended_by: Finding | None = None
        self._ledger: Mapping[str, Requirement] = known if isinstance(known, Mapping) else {}
        self._sent: deque[Sent] = deque(maxlen=MAX_SEQUENCE)
        self._findings = 0
        self._by_rule = threading.local()

    def begin(self, check_name: str) -> None:
        """Begin a check: what was sent before does not lead to its findings."""
        self.check_name, self.at_risk, self.met = check_name, (), []
        self._sent.clear()

    def sent(self, request: Request) -> None:
        """Take down that a request of the check went out."""
        self._sent.append(Sent(time.monotonic(), request))

    @contextmanager
    def by_rule(self) -> Iterator[None]:
        """Let what is judged meanwhile, in this thread, be rules of their own for whatever came, errors included."""
        self._by_rule.on = True
        try:
            yield
        finally:
            self._by_rule.on = False

    def _led_to(self, exchange: Attempt | None) -> tuple[Sent, ...]:
        """The requests up to that of an exchange, which may have gone over a socket that nobody listens to."""
        sent = tuple(self._sent)
        if exchange is None:
            return sent
        for index in range(len(sent) - 1, -1, -1):
            if sent[index].request is exchange.request:
                return sent[: index + 1]
        return (*sent[-MAX_SEQUENCE + 1 :], Sent(time.monotonic(), exchange.request))

    def check(
        self,
        requirement: str,
        holds: bool,  # noqa: FBT001 - reads as a sentence: judge.check(id, answer.status == 200, ...)
        exchange: Attempt | None,
        expected: str,
        *,
        found: str = "",
        cause: str = "",
        subject: str = "",
    ) -> bool:
        """Judge one case, and go on whatever comes of it.

        Args:
            requirement: its id; one that the contract at hand does not have is ignored.
            holds: whether the case meets it.
            exchange: the evidence.
            expected: what the requirement asks for here, in a few words.
            found: what a look at the response showed; empty: status and media type are wrong by themselves.
            cause: failures of the same cause are one finding; by default the texts without their numbers.
            subject: what was tested; by default method and target of the request.

        Returns:
            ``holds``.
        """
        evidence = self.evidence.get(requirement)
        if evidence is None:
            return holds
        evidence.cases += 1
        evidence.checks.add(self.check_name)
        if not holds:
            subject = subject or subject_of(exchange, self.check_name)
            self._found(evidence, requirement, exchange, expected, found, cause, subject)
        return holds

    def _found(
        self,
        evidence: Evidence,
        requirement: str,
        exchange: Attempt | None,
        expected: str,
        found: str,
        cause: str,
        subject: str,
    ) -> None:
        """Put a failed case down: as one more of a finding that there is, or as a new one."""
        kind = self._kind(requirement, exchange, found)
        observed = observed_in(exchange, found)
        causes = causes_of(kind, exchange)
        # Without a word of the check, two causes are two findings, even where the texts are alike.
        key = f"{kind} {cause or ' '.join((*causes, _VALUES.sub('#', f'{expected}|{observed}')))}"
        finding = evidence.findings.get(key)
        if finding is not None:
            finding.seen += 1
            finding.causes |= causes
            self.met.append(finding)
            unsent = isinstance(exchange, Unanswered) and exchange.kind is NoAnswer.CIRCUIT_OPEN
            smaller = exchange and finding.exchange and exchange.request.size < finding.exchange.request.size
            if finding.unsent > unsent or (smaller and finding.unsent >= unsent):
                finding.subject, finding.expected, finding.observed = subject, expected, observed
                finding.exchange, finding.sequence = exchange, self._led_to(exchange)
            return
        breaks_rule = kind is CauseKind.RULE
        alike = [one for one in evidence.findings.values() if (one.cause is CauseKind.RULE) == breaks_rule]
        if len(alike) >= (MAX_FINDINGS if breaks_rule else MAX_CAUSES):
            evidence.unshown += 1
            self.met.append(alike[0])
            return
        self._findings += 1
        evidence.findings[key] = finding = Finding(
            requirement,
            self._ledger[requirement].source if requirement in self._ledger else "",
            subject,
            expected,
            observed,
            exchange,
            kind,
            causes=causes,
            sequence=self._led_to(exchange),
            met=self._findings,
        )
        self.met.append(finding)

    def _kind(self, requirement: str, exchange: Attempt | None, found: str) -> CauseKind:
        """Return the kind of cause that keeps a requirement from being met."""
        kind = kind_of(exchange, found)
        forbids = self._ledger[requirement].forbids if requirement in self._ledger else ()
        return CauseKind.RULE if getattr(self._by_rule, "on", False) and kind not in forbids else kind

    def require(
        self,
        requirement: str,
        holds: bool,  # noqa: FBT001 - as check()
        exchange: Attempt | None,
        expected: str,
        *,
        found: str = "",
        cause: str = "",
    ) -> None:
        """Judge one case of a property: like check(), but a case that fails ends the example.

        Raises:
            RefutedError: it does not hold.
        """
        if not self.check(requirement, holds, exchange, expected, found=found, cause=cause):
            raise RefutedError(f"{requirement}: expected {expected}, got {observed_in(exchange, found)}")

    def skip(self, requirement: str, reason: str) -> None:
        """Say that something which had to be judged could not be, and why."""
        self._say(requirement, reason, lambda evidence: evidence.skips)

    def error(self, requirement: str, reason: str) -> None:
        """Say that judging broke off, and why."""
        self._say(requirement, reason, lambda evidence: evidence.errors)

    def note(self, requirement: str, remark: str) -> None:
        """Add a remark that changes no verdict."""
        self._say(requirement, remark, lambda evidence: evidence.notes)

    def unclaimed(self, requirement: str, reason: str) -> None:
        """Say that the requirement does not apply: it needs an interface that nobody said was there."""
        if requirement in self.evidence:
            self.evidence[requirement].unclaimed = reason

    def _say(self, requirement: str, text: str, where: Callable[[Evidence], list[str]]) -> None:
        evidence = self.evidence.get(requirement)
        if evidence is not None and text not in where(evidence):
            where(evidence).append(text)

    def refuted(self) -> dict[str, int]:
        """Return how many failures each requirement that has any has seen so far."""
        return {id_: evidence.failures for id_, evidence in self.evidence.items() if evidence.findings}

    def counts(self, ids: Iterable[str]) -> dict[str, int]:
        """Return how many cases each of the requirements has."""
        return {id_: self.evidence[id_].cases for id_ in ids if id_ in self.evidence}

    def cases(self, requirement: str) -> int:
        """Return how many cases a requirement has; 0 for one that the contract at hand does not have."""
        return self.evidence[requirement].cases if requirement in self.evidence else 0

    def stopped(self, requirement: str, reason: str) -> None:
        """Say that a requirement was not tested because the run was called off, and why."""
        evidence = self.evidence.get(requirement)
        if evidence is None:
            return
        if self.ended_by is None:
            self.error(requirement, reason)
        elif not evidence.findings:
            evidence.because = self.ended_by
