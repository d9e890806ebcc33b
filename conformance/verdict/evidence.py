"""The judge, which collects the evidence of checks and checkers for each requirement."""

import re
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Final

from conformance.contract.classes import CauseKind, Level
from conformance.contract.ledger import Requirement, ids_by_alias, twins
from conformance.documents.openapi import is_json
from conformance.documents.patterns import PatternError
from conformance.transport.exchange import Attempt, Exchange, Listener, NoAnswer, Request, Unanswered
from conformance.verdict.finding import (
    Finding,
    Sent,
    Showing,
    causes_of,
    few_of,
    kind_of,
    likeness,
    observed_in,
    subject_of,
)

MAX_FINDINGS = 100  # findings of one requirement; the last stands for all further causes
MAX_SEQUENCES = 10  # findings that keep all their requests
# Requests before a finding that are kept with it.
MAX_SEQUENCE = 40
_REST = "the rest"
_FAULT = 200  # characters of the message on a suite error
_NAMED = 3  # operations that this message names
_REFUSED = 400
# Numbers and quoted values: the parts of a text that differ between cases of one finding.
_VALUES = re.compile(r"[-+]?\d[\d.e+-]*|'[^']*'|\"[^\"]*\"")
# What a requirement expected in place of each kind of missing response.
_SILENT = {
    NoAnswer.TIMEOUT: "a response within the deadline",
    NoAnswer.CIRCUIT_OPEN: "a response within the deadline",
    NoAnswer.CLOSED: "a response",
    NoAnswer.REFUSED: "a response",
}
#: Doubt about what only prose demands.
SENTENCE: Final = "the description's sentence may mean something else"
_SILENCES = frozenset({CauseKind.HANG, CauseKind.NO_RESPONSE})


@dataclass(frozen=True, slots=True)
class Case:
    """One case of a requirement.

    Attributes:
        holds: whether the device meets the requirement in this case.
        exchange: the evidence, or None.
        expected: what the requirement demands here, as a noun phrase.
        observed: what was seen instead; empty means a description of the response.
        cause: failures of the same cause are one finding; empty means derived from the texts.
        subject: what was tested; empty means method and target of the request.
        operations: how each operation shows it, that of the exchange first, if not only that of the request.
        requirement: its id or an alias; empty where a rule is bound to one.
        doubt: what a right device may do that looks the same, as a sentence; with it, a failed case only warns.
    """

    holds: bool
    exchange: Attempt | None
    expected: str
    observed: str = ""
    cause: str = ""
    subject: str = ""
    operations: tuple[Showing, ...] = ()
    requirement: str = ""
    doubt: str = ""


def case(
    requirement: str,
    holds: bool,  # noqa: FBT001 - reads as a sentence: case(id, answer.status == 200, ...)
    exchange: Attempt | None,
    expected: str,
    found: str = "",
    cause: str = "",
) -> Case:
    """Return a case of a requirement; the arguments are as in Case."""
    return Case(holds, exchange, expected, found, cause, requirement=requirement)


#: Function that judges the exchanges of a run, in the order in which they ended.
Checker = Callable[[Attempt], Iterator[Case]]


class RefutedError(AssertionError):
    """Raised to make Hypothesis shrink a failing case. The judge has recorded the failure already."""


class HarnessError(Exception):
    """Raised when the suite generated a valid request that the contract forbids: a bug of the suite, not of the robot.

    The requirements of the check then have an error, and the run ends with exit code 4 unless something else failed.
    """


@dataclass
class Evidence:
    """Everything known about one requirement.

    Attributes:
        cases: number of judged cases.
        findings: findings by cause.
        skips: reasons why a mandatory case could not be judged.
        errors: reasons why judging was aborted.
        notes: remarks that change no verdict.
        unseen: what the device's state kept it from showing.
        checks: names of the checks that judged it.
        unclaimed: why it does not apply to a robot for which no classes were named.
        because: the finding of another requirement that prevented the test, or None.
        parts: number of judged cases by the id that checks use, which may be an alias of the requirement.
        occasions: number of judged cases by interface, method and format, and of those after a refused request.
    """

    cases: int = 0
    occasions: Counter[str] = field(default_factory=Counter)
    parts: dict[str, int] = field(default_factory=dict)
    findings: dict[str, Finding] = field(default_factory=dict)
    skips: list[str] = field(default_factory=list)
    errors: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    unseen: list[str] = field(default_factory=list)
    checks: set[str] = field(default_factory=set)
    unclaimed: str = ""
    because: Finding | None = None

    @property
    def is_unseen(self) -> bool:
        """Return whether the device's state is why nothing was judged."""
        return bool(self.unseen) and not (self.cases or self.errors or self.because)

    @property
    def failures(self) -> int:
        """Return the number of failed cases."""
        return sum(finding.seen for finding in self.findings.values())


class Judge:
    """Collects the evidence of checks and checkers.

    Args:
        known: the requirements by id, or their ids alone.

    Attributes:
        evidence: by requirement.
        check_name: name of the running check.
        at_risk: the requirements that fail if the robot stops responding during a hostile request.
        met: findings of the running check, newest last.
        ended_by: the finding after which the robot stopped responding, or None.
        concerned: returns the labels of the operations of a description that a request concerns.
        judged: is told of each case: its requirement and its exchange.
    """

    def __init__(self, known: Collection[str] | Mapping[str, Requirement]) -> None:
        self.evidence: dict[str, Evidence] = {id_: Evidence() for id_ in sorted(known)}
        self.check_name = ""
        self.at_risk: tuple[str, ...] = ()
        self.met: list[Finding] = []
        self._faults: dict[str, tuple[dict[str, None], set[str]]] = {}
        self.ended_by: Finding | None = None
        self.concerned: Callable[[Request], Iterable[str]] = lambda _: ()
        self.judged: Callable[[str, Attempt | None], None] = lambda _requirement, _exchange: None
        self._ledger: Mapping[str, Requirement] = known if isinstance(known, Mapping) else {}
        self._renamed, self._twins = ids_by_alias(self._ledger), twins(self._ledger)
        # The requirement that forbids only that kind, by kind of missing response.
        self._on_silence = {one.forbids[0]: id_ for id_, one in self._ledger.items() if len(one.forbids) == 1}
        self._sent: deque[Sent] = deque(maxlen=MAX_SEQUENCE)
        self._findings = 0
        self._newest: Attempt | None = None
        self._occasions: tuple[str, ...] = ()
        self._by_rule = threading.local()

    def of(self, requirement: str) -> Evidence | None:
        """Return the evidence of a requirement by its id or an alias, or None if the contract does not have it."""
        return self.evidence.get(self._known_as(requirement)[1])

    def _known_as(self, requirement: str) -> tuple[str, str]:
        """Return the part that an id names, and its requirement: by an alias, or one that asks the same."""
        part = self._twins.get(requirement, requirement)
        return part, self._renamed.get(part, part)

    def announce(self, ids: Iterable[str]) -> None:
        """Record the ids that a check is going to judge: a requirement passes when each of its parts was judged."""
        for id_ in ids:
            evidence = self.of(id_)
            if evidence is not None:
                evidence.parts.setdefault(self._known_as(id_)[0], 0)

    def begin(self, check_name: str) -> None:
        """Start a check: earlier requests do not belong to the sequence that led to its findings."""
        self.check_name, self.at_risk, self.met = check_name, (), []
        self._sent.clear()

    def note_sent(self, attempt: Attempt) -> None:
        """Record that the check sent a request, and its outcome."""
        self._sent.append(Sent(time.monotonic(), attempt.request))
        after = isinstance(self._newest, Exchange) and self._newest.response.status >= _REFUSED
        self._newest, self._occasions = attempt, (occasion_of(attempt), *(("after a refusal",) if after else ()))

    @contextmanager
    def by_rule(self) -> Iterator[None]:
        """Treat everything judged in this context, in this thread, as a broken rule of its own, even server errors."""
        self._by_rule.on = True
        try:
            yield
        finally:
            self._by_rule.on = False

    def _led_to(self, exchange: Attempt | None) -> tuple[Sent, ...]:
        """Return the check's requests up to that of an exchange, which may have used a raw socket without listeners."""
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
        operations: Sequence[Showing] = (),
        doubt: str = "",
    ) -> bool:
        """Record whether one case meets a requirement.

        Args:
            requirement: its id or an alias; ignored if the contract does not have it.
            holds: whether the case meets the requirement.
            exchange: the evidence.
            expected: what the requirement demands here, as a noun phrase.
            found: what the response showed; empty if status and media type alone are wrong.
            cause: failures of the same cause are one finding; by default the texts without their numbers.
            subject: what was tested; by default method and target of the request.
            operations: the operations of a description that show it, that of ``exchange`` first; by default those
                that its request concerns.
            doubt: as in Case.

        Returns:
            ``holds``.
        """
        part, requirement = self._known_as(requirement)
        evidence = self.evidence.get(requirement)
        if evidence is None:
            return holds
        if isinstance(exchange, Unanswered) and exchange.kind is NoAnswer.HURRIED:
            self.skip(requirement, exchange.problem)
            return holds
        cases = (sum(showing.seen for showing in operations) if operations else 0) or 1
        evidence.cases += cases
        evidence.parts[part] = evidence.parts.get(part, 0) + cases
        evidence.checks.add(self.check_name)
        self.judged(requirement, exchange)
        if exchange is not None:
            for occasion in self._occasions if exchange is self._newest else (occasion_of(exchange),):
                evidence.occasions[occasion] += cases
        if not holds:
            self.on_failure(requirement)
            subject = subject or subject_of(exchange, self.check_name)
            if not operations and exchange is not None:
                operations = [Showing(label, 1, exchange.request) for label in self.concerned(exchange.request)]
            self._add_failure(
                evidence, requirement, exchange, expected, found, cause, subject, operations, cases, doubt
            )
            required, kind = self._ledger.get(requirement), kind_of(exchange, found)
            # A missing response breaks no SHOULD: it says only what should be in a response.
            if required and required.level is Level.MUST and kind in _SILENCES and kind not in required.forbids:
                self.silent(exchange)
        return holds

    def silent(self, attempt: Attempt | None) -> None:
        """Record a missing response for the requirement about missing responses, to which by_cause() then assigns it.

        A raw request tests a rule of its own.
        """
        expected = _SILENT.get(attempt.kind) if isinstance(attempt, Unanswered) else None
        if isinstance(attempt, Unanswered) and expected and attempt.request.raw is None:
            kind = kind_of(attempt)
            cause = "hang" if kind is CauseKind.HANG else f"closed {attempt.problem}"
            self.check(self._on_silence.get(kind, ""), False, attempt, expected, found=attempt.problem, cause=cause)  # noqa: FBT003

    def record(self, case: Case, requirement: str = "") -> bool:
        """Record a case of the requirement that it names, or of the given one; return whether it holds."""
        return self.check(
            case.requirement or requirement,
            case.holds,
            case.exchange,
            case.expected,
            found=case.observed,
            cause=case.cause,
            subject=case.subject,
            operations=case.operations,
            doubt=case.doubt,
        )

    def on_failure(self, requirement: str) -> None:
        """Do nothing; a judge that wants to know at once of a failed case overrides it."""

    def _add_failure(
        self,
        evidence: Evidence,
        requirement: str,
        exchange: Attempt | None,
        expected: str,
        found: str,
        cause: str,
        subject: str,
        operations: Sequence[Showing],
        cases: int,
        doubt: str,
    ) -> None:
        """Add a failed case to an existing finding of its cause, or as a new finding."""
        kind = self._kind(requirement, exchange, found)
        observed = observed_in(exchange, found)
        causes = causes_of(kind, exchange)
        # Only the fault counts, not its circumstances: a missing header is one cause, whatever the responses' status.
        said = _VALUES.sub("#", f"{expected}|{found or observed}")
        key = f"{kind} {cause or ' '.join((_likeness(kind, exchange), said))} {doubt}"
        if key not in evidence.findings and len(evidence.findings) >= MAX_FINDINGS:
            key = _REST
        finding = evidence.findings.get(key)
        if finding is not None:
            finding.seen += cases
            finding.causes |= causes
            self.met.append(finding)
            unsent = isinstance(exchange, Unanswered) and exchange.kind is NoAnswer.CIRCUIT_OPEN
            smaller = exchange and finding.exchange and exchange.request.size < finding.exchange.request.size
            if finding.unsent > unsent or (smaller and finding.unsent >= unsent):
                finding.subject, finding.expected, finding.observed = subject, expected, observed
                finding.exchange = exchange
                finding.sequence = self._led_to(exchange)[-len(finding.sequence) or -1 :]
                finding.show(operations, first=True)
            else:
                finding.show(operations)
            return
        self._findings += 1
        sequence = self._led_to(exchange)
        evidence.findings[key] = finding = Finding(
            requirement,
            self._ledger[requirement].source if requirement in self._ledger else "",
            subject,
            expected,
            observed,
            exchange,
            kind,
            doubt=doubt,
            causes=causes,
            rest=key == _REST,
            sequence=sequence if len(evidence.findings) < MAX_SEQUENCES else sequence[-1:],
            met=self._findings,
        )
        finding.show(operations)
        self.met.append(finding)

    def _kind(self, requirement: str, exchange: Attempt | None, found: str) -> CauseKind:
        """Return the kind of cause of a failed case."""
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
        """Record whether one case of a property meets a requirement; a failed case ends the Hypothesis example.

        Raises:
            RefutedError: the case fails.
        """
        if not self.check(requirement, holds, exchange, expected, found=found, cause=cause):
            raise RefutedError(f"{requirement}: expected {expected}, got {observed_in(exchange, found)}")

    def skip(self, requirement: str, reason: str) -> None:
        """Record why a mandatory case could not be judged."""
        self._say(requirement, reason, lambda evidence: evidence.skips)

    def error(self, requirement: str, reason: str) -> None:
        """Record why judging was aborted."""
        self._say(requirement, reason, lambda evidence: evidence.errors)

    def fault(self, what: str, error: Exception, ids: Iterable[str] = ()) -> None:
        """Record an error of the suite that kept something from being judged, such as one operation."""
        said = (str(error).splitlines() or [""])[0][:_FAULT]
        name = "" if isinstance(error, PatternError) else f"{type(error).__name__}: "
        met, concerned = self._faults.setdefault(f"{name}{said}", ({}, set()))
        met[what] = None
        concerned.update(self._renamed.get(id_, id_) for id_ in ids)

    @property
    def faults(self) -> dict[str, list[str]]:
        """Return each suite error with what could not be judged because of it, and the requirements concerned."""
        found = self._faults.items()
        return {f"{few_of(list(met), _NAMED)}: not judged: {error}": sorted(ids) for error, (met, ids) in found}

    def note(self, requirement: str, remark: str) -> None:
        """Add a remark that changes no verdict."""
        self._say(requirement, remark, lambda evidence: evidence.notes)

    def not_seen(self, requirement: str, reason: str) -> None:
        """Record what the device's state did not allow to test; if nothing else is judged, that is the verdict."""
        self._say(requirement, reason, lambda evidence: evidence.unseen)

    def note_unclaimed(self, requirement: str, reason: str) -> None:
        """Record why a requirement does not apply: no address was given for the interface that it needs."""
        evidence = self.of(requirement)
        if evidence is not None:
            evidence.unclaimed = reason

    def _say(self, requirement: str, text: str, where: Callable[[Evidence], list[str]]) -> None:
        evidence = self.of(requirement)
        if evidence is not None and text not in where(evidence):
            where(evidence).append(text)

    def failure_counts(self) -> dict[str, int]:
        """Return the number of failures so far, by requirement."""
        return {id_: evidence.failures for id_, evidence in self.evidence.items() if evidence.findings}

    def knows(self, requirement: str) -> bool:
        """Return whether the contract has a requirement."""
        return requirement in self.evidence

    def counts(self, ids: Iterable[str]) -> dict[str, int]:
        """Return the number of cases by id, each for the part of its requirement that the id names."""
        found = {id_: self.of(id_) for id_ in ids}
        return {
            id_: evidence.parts.get(self._known_as(id_)[0], 0)
            for id_, evidence in found.items()
            if evidence is not None
        }

    def cases(self, requirement: str) -> int:
        """Return the number of cases of a requirement or a part of it; 0 if the contract lacks it."""
        evidence = self.of(requirement)
        if evidence is None:
            return 0
        return evidence.parts.get(requirement, 0) if requirement in self._renamed else evidence.cases

    def note_stopped(self, requirement: str, reason: str) -> None:
        """Record that a requirement was not tested because the run was aborted, and why."""
        evidence = self.of(requirement)
        if evidence is None:
            return
        if self.ended_by is None:
            self.error(requirement, reason)
        elif not evidence.findings:
            evidence.because = self.ended_by


def occasion_of(attempt: Attempt) -> str:
    """Return the form of a request: "PUT XML", "SOAP"; without a body, by the response's format."""
    request = attempt.request
    if request.raw is not None:
        return "raw bytes"
    if request.method == "POST" and any(name.lower() == "soapaction" for name, _ in request.headers):
        return "SOAP"
    media_type = request.media_type if request.body else ""
    if not request.body and isinstance(attempt, Exchange):
        media_type = attempt.response.media_type
    return _occasion(request.method, media_type)


@lru_cache(maxsize=256)
def _occasion(method: str, media_type: str) -> str:
    kinds = {"JSON": is_json(media_type), "XML": media_type.endswith("xml"), "text": media_type == "text/plain"}
    # Other media types count as one kind, because a device may invent any number.
    kind = next((name for name, fits in kinds.items() if fits), "other" if media_type else "without body")
    return f"{method} {kind}"


def _likeness(kind: CauseKind, exchange: Attempt | None) -> str:
    """Return the common part of two failures with the same cause, if the check named no cause.

    A server error is known by its method and what its response says: one fault behind many paths is one finding.
    """
    if kind is CauseKind.RULE or exchange is None:
        return ""
    method = exchange.request.method.replace("HEAD", "GET")
    said = "" if isinstance(exchange, Unanswered) else likeness(exchange)
    return f"{method} {said}"


_SHOWN: Final = 100


class CheckerListener(Listener):
    """Calls checkers with every exchange, whichever check sent it, errors included.

    Args:
        judge: records their cases.
        checkers: the checkers.
        by_rule: whether a server error that they judge is a broken rule of its own (see Judge.by_rule).
    """

    def __init__(self, judge: Judge, checkers: Iterable[Checker], *, by_rule: bool = True) -> None:
        self._judge, self._by_rule = judge, by_rule
        self._checkers = tuple(checkers)

    def on_response(self, exchange: Exchange) -> None:
        """Judge an exchange."""
        self._check(exchange)

    def on_no_response(self, request: Unanswered) -> None:
        """Judge a request without a response."""
        self._check(request)

    def acted_by_hand(self, *, deletes: bool) -> None:
        """Tell a raw request to the checkers that remember earlier writes."""
        for checker in self._checkers:
            if (forget := getattr(checker, "forget", None)) is not None:
                forget(deletes=deletes)

    def _check(self, attempt: Attempt) -> None:
        """Call each checker; an error in one must not end judging."""
        with self._judge.by_rule() if self._by_rule else nullcontext():
            for checker in self._checkers:
                try:
                    for case in checker(attempt):
                        self._judge.record(case)
                except Exception as error:  # noqa: BLE001 - whatever it is, it is told
                    request = attempt.request
                    self._judge.fault(f"{request.method} {request.target.partition('?')[0][:_SHOWN]}", error)
