"""Findings: what the suite did, what it expected by which rule, and what it got; and the one text that says so."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from http import HTTPStatus
from typing import TYPE_CHECKING, NamedTuple

from conformance.contract.classes import CauseKind
from conformance.documents.readable import unreadable
from conformance.transport.exchange import Exchange, NoAnswer, Unanswered

if TYPE_CHECKING:
    from conformance.transport.exchange import Attempt, Request

_KINDS = {
    NoAnswer.REFUSED: CauseKind.NO_RESPONSE,
    NoAnswer.CLOSED: CauseKind.NO_RESPONSE,
    NoAnswer.TLS: CauseKind.NO_RESPONSE,
    NoAnswer.TIMEOUT: CauseKind.HANG,
    NoAnswer.CIRCUIT_OPEN: CauseKind.HANG,
    NoAnswer.MALFORMED: CauseKind.UNREADABLE,
}
# Fields that every request has, or that say nothing about what is special in it.
_USUAL_FIELDS = frozenset({"host", "content-length", "connection", "authorization", "user-agent"})
_SHOWN_TARGET = 120
_SHOWN_FIELD = 100
_SHOWN_BODY = 200
_SHOWN_CURL = 2000
_FAULT = re.compile(rb"<(?:[\w.-]+:)?Fault[\s>]")


class Sent(NamedTuple):
    """A request, and when it was answered or given up, s on the monotonic clock."""

    at_s: float
    request: Request


class Again(NamedTuple):
    """How often a failure came back when its request was sent again.

    Attributes:
        came_back: how often the response failed, or was of the same kind.
        sent: how often the request was sent.
        judged: whether an observer judged each response; else only their kind was compared.
    """

    came_back: int
    sent: int
    judged: bool = True


@dataclass
class Finding:
    """One reason for which a requirement is not met.

    Attributes:
        requirement: id of the requirement.
        source: the text that the requirement quotes.
        subject: what was tested: ``GET /robot/pose/``.
        expected: what the requirement asks for here.
        observed: what came instead.
        exchange: the smallest failing request with what became of it, or None where none was sent.
        cause: the kind of cause.
        causes: what identifies the causes that it was found with; another finding may have them as well.
        among: for how many requirements at once it was put down; 1: a check judged this one by itself.
        alone: whether this requirement keeps the finding, because its request ended the robot.
        seen: how often it was found.
        sequence: the requests of its check up to it, so that they can be sent again.
        again: how often it came back; None: it was not tried again.
        met: the place in the order in which the run met its findings.
        number: its place among the findings of a result; 0 until the run is over.
    """

    requirement: str
    source: str
    subject: str
    expected: str
    observed: str
    exchange: Attempt | None
    cause: CauseKind = CauseKind.RULE
    causes: set[str] = field(default_factory=set)
    among: int = 1
    alone: bool = False
    seen: int = 1
    sequence: tuple[Sent, ...] = ()
    again: Again | None = None
    met: int = 0
    number: int = 0

    @property
    def unsent(self) -> bool:
        """Return whether the request was not even sent, because its endpoint had hung before."""
        return isinstance(self.exchange, Unanswered) and self.exchange.kind is NoAnswer.CIRCUIT_OPEN

    @property
    def text(self) -> str:
        """Return the finding in words: what the suite did, what it expected, what it got, and how often."""
        rule = ", ".join(filter(None, (self.requirement, self.source)))
        did = f"Sent {_described(self.exchange.request)}." if self.exchange else f"Tested {self.subject}."
        parts = [did, f"Expected {_clause(self.expected)} ({rule}).", f"Got {_clause(self.observed)}."]
        if self.seen > 1:
            parts.append(f"Seen {self.seen} times.")
        if self.again is not None:
            came_back, sent, judged = self.again
            what = "it failed" if judged else "it had the same kind of response"
            parts.append(
                f"{'Sent' if came_back == sent else 'Intermittent: sent'} again, {what} {came_back} of {sent} times."
            )
        return " ".join(parts)

    @property
    def brief(self) -> str:
        """Return subject and observation, for a sentence that points to the finding."""
        return f"{self.subject}: {_clause(self.observed)}"


def in_full(finding: Finding) -> str:
    """Return a finding in words, with a command that sends its request again."""
    curl = f"\n  {finding.exchange.request.curl()[:_SHOWN_CURL]}" if finding.exchange else ""
    return f"{finding.text}{curl}"


def kind_of(exchange: Attempt | None, found: str = "") -> CauseKind:
    """Return the kind of cause that an exchange is by itself; RULE where a well-formed response came.

    Where a check found something else than that, such as an effect of the request, the finding breaks its own rule.
    """
    if isinstance(exchange, Unanswered):
        return _KINDS[exchange.kind] if not found or exchange.problem in found else CauseKind.RULE
    if exchange is None:
        return CauseKind.RULE
    response = exchange.response
    if response.status >= HTTPStatus.INTERNAL_SERVER_ERROR:
        # SOAP says what is wrong with a request by a fault with status 500 (BP 1.1 R1126).
        fault = response.status == HTTPStatus.INTERNAL_SERVER_ERROR and _FAULT.search(response.body)
        says_so = not found or str(response.status) in found
        return CauseKind.SERVER_ERROR if says_so and not fault else CauseKind.RULE
    if response.body and unreadable(response.media_type, response.body):
        return CauseKind.UNREADABLE
    return CauseKind.RULE


def causes_of(kind: CauseKind, exchange: Attempt | None) -> set[str]:
    """Return what identifies a cause that other checks may meet as well: kind, endpoint and, if any, status.

    The set is empty where a response breaks a rule: that is no other requirement's cause.
    """
    if kind is CauseKind.RULE or exchange is None:
        return set()
    # HEAD is GET without its content: one handler answers both (RFC 9110 9.3.2).
    parts = [kind.value, exchange.request.endpoint.replace("HEAD ", "GET ", 1)]
    if isinstance(exchange, Exchange):
        parts.append(f"{exchange.response.status}")
        if kind is CauseKind.UNREADABLE:
            parts.append(exchange.response.media_type)
    return {" ".join(parts)}


def subject_of(exchange: Attempt | None, check_name: str) -> str:
    """Return what was tested: method and target of the request; the check where no request was sent."""
    if exchange is None:
        return f"by the check {check_name}" if check_name else "the robot"
    request = exchange.request
    return f"{request.method} {_cut(request.target, _SHOWN_TARGET)}".strip()


def observed_in(exchange: Attempt | None, found: str) -> str:
    """Return what came: the response in a few words, with what a check found in it."""
    if exchange is None:
        return found or "something else"
    if isinstance(exchange, Unanswered):
        said = found if exchange.problem in found else ": ".join(filter(None, (exchange.problem, found)))
        return said if said.startswith("no response") else f"no response: {said}"
    status = str(exchange.response.status)
    came = ", ".join(filter(None, (status, exchange.response.media_type)))
    said = found.removeprefix("status ")
    if said == came or said.endswith(f" is answered {status}"):
        return came
    if not said.startswith(status):
        return f"{came}: {found}" if found else came
    rest = said.removeprefix(status)
    # "200 with application/json" and the like name the media type themselves.
    return said if rest.startswith((" with ", " as ")) else f"{came}{rest}"


def _described(request: Request) -> str:
    """Return a request in a few words: its first line, what is special in its fields, and its body."""
    if request.raw is not None:
        return f"the bytes {_quoted(request.raw)}"
    what = f"`{request.method} {_cut(request.target, _SHOWN_TARGET)}`"
    fields = [
        f"`{name}: {_cut(value, _SHOWN_FIELD)}`"
        for name, value in request.headers
        if name.lower() not in _USUAL_FIELDS and (name.lower(), value) != ("accept", "*/*")
    ]
    if fields:
        what += f" with {', '.join(fields)}"
    if request.body:
        what += f"{' and' if fields else ' with'} the body {_quoted(request.body)}"
    return what


def _quoted(octets: bytes) -> str:
    text = octets[:_SHOWN_BODY].decode("utf-8", "backslashreplace")
    shown = "".join(char if char.isprintable() else char.encode("unicode_escape").decode() for char in text)
    more = f" ({len(octets):,} bytes in all)" if len(octets) > _SHOWN_BODY else ""
    return f"`{shown}{'…' if more else ''}`{more}"


def _cut(text: str, most: int) -> str:
    return text if len(text) <= most else f"{text[:most]}…"


def _clause(text: str) -> str:
    """Return a text as a part of a sentence, which ends with its own full stop."""
    return text.strip().removesuffix(".")
