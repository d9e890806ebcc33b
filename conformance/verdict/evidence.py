"""The judge: checks tell it what they saw, and it keeps the evidence, requirement by requirement."""

from __future__ import annotations

import re
import time
from collections import deque
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from conformance.transport.exchange import Attempt, Request

# Findings of one requirement that are shown; more causes than this are the same story.
MAX_FINDINGS = 5
# Requests before a finding that are kept with it.
MAX_SEQUENCE = 40


class RefutedError(AssertionError):
    """A property does not hold: tells Hypothesis to look for a smaller case. The judge has the evidence already."""


class HarnessError(Exception):
    """The suite made what the contract does not allow, and was about to send it as valid: never the robot's failure.

    What a check was to judge is in error then, and the run ends with 4 unless something else failed.
    """


class Sent(NamedTuple):
    """A request, and when it was answered or given up, s on the monotonic clock."""

    at_s: float
    request: Request


class Again(NamedTuple):
    """How often a failure came back when its request was sent again."""

    came_back: int
    sent: int


@dataclass
class Finding:
    """One cause for which a requirement is not met.

    Attributes:
        message: what was found.
        expected: what the requirement asks for.
        exchange: the smallest failing request with what became of it, or None where none was sent.
        seen: how often it was found.
        sequence: the requests of its check up to it, so that they can be sent again.
        again: how often it came back; None: it was not tried again.
    """

    message: str
    expected: str
    exchange: Attempt | None
    seen: int = 1
    sequence: tuple[Sent, ...] = ()
    again: Again | None = None

    @property
    def told(self) -> str:
        """What was found; of what does not come back every time, also how often it does."""
        if self.again is None or self.again.came_back == self.again.sent:
            return self.message
        return f"{self.message} (intermittent: it came back {self.again.came_back} of {self.again.sent} times)"


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
    """

    cases: int = 0
    findings: dict[str, Finding] = field(default_factory=dict)
    skips: list[str] = field(default_factory=list)
    errors: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    checks: set[str] = field(default_factory=set)
    unclaimed: str = ""

    @property
    def failures(self) -> int:
        """How many cases failed."""
        return sum(finding.seen for finding in self.findings.values())


class Judge:
    """Collects evidence from checks and observers, for the requirements whose ids are known."""

    def __init__(self, known: set[str]) -> None:
        self.evidence: dict[str, Evidence] = {id_: Evidence() for id_ in sorted(known)}
        self.check_name = ""
        # What a check is about to risk: said before a hostile request, so that a robot that dies of it has failed it.
        self.at_risk: tuple[str, ...] = ()
        self._sent: deque[Sent] = deque(maxlen=MAX_SEQUENCE)

    def begin(self, check_name: str) -> None:
        """A check begins: what was sent before does not lead to its findings."""
        self.check_name, self.at_risk = check_name, ()
        self._sent.clear()

    def sent(self, request: Request) -> None:
        """A request of the check went out."""
        self._sent.append(Sent(time.monotonic(), request))

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
    ) -> bool:
        """Judge one case, and go on whatever comes of it.

        Args:
            requirement: its id; one that the contract at hand does not have is ignored.
            holds: whether the case meets it.
            exchange: the evidence.
            expected: what the requirement asks for here, in a few words.
            found: what was found instead; by default what came.
            cause: failures of the same cause are one finding; by default the texts without their numbers.

        Returns:
            ``holds``.
        """
        evidence = self.evidence.get(requirement)
        if evidence is None:
            return holds
        evidence.cases += 1
        evidence.checks.add(self.check_name)
        if holds:
            return True
        message = found or (exchange.came if exchange else "not so")
        key = cause or re.sub(r"[-+]?\d[\d.e+-]*|'[^']*'|\"[^\"]*\"", "#", f"{expected}|{message}")
        known = evidence.findings.get(key)
        if known is None:
            if len(evidence.findings) < MAX_FINDINGS:
                evidence.findings[key] = Finding(message, expected, exchange, 1, self._led_to(exchange))
            else:
                next(iter(evidence.findings.values())).seen += 1
            return False
        known.seen += 1
        if exchange and known.exchange and exchange.request.size < known.exchange.request.size:
            known.message, known.expected, known.exchange = message, expected, exchange
            known.sequence = self._led_to(exchange)
        return False

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
            raise RefutedError(f"{requirement}: expected {expected}, found {found or (exchange and exchange.came)}")

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
        """How many failures each requirement that has any has seen so far."""
        return {id_: evidence.failures for id_, evidence in self.evidence.items() if evidence.findings}

    def counts(self, ids: Iterable[str]) -> dict[str, int]:
        """How many cases each of the requirements has."""
        return {id_: self.evidence[id_].cases for id_ in ids if id_ in self.evidence}

    def told(self, requirement: str) -> str:
        """The findings of one requirement in words, with a command that shows each."""
        lines = []
        for finding in self.evidence[requirement].findings.values():
            lines.append(f"{requirement}: expected {finding.expected}; found: {finding.message} (seen {finding.seen}x)")
            if finding.exchange:
                lines.append(f"  {finding.exchange.request.curl()[:2000]}")
        return "\n".join(lines)
