"""Findings and their text: the suite's request, the expected and the actual response, and the rule."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from http import HTTPStatus
from typing import NamedTuple

from conformance.contract.classes import CauseKind
from conformance.documents.traceback import unreadable
from conformance.transport.exchange import Attempt, Exchange, NoAnswer, Request, Unanswered

_KINDS = {
    NoAnswer.REFUSED: CauseKind.NO_RESPONSE,
    NoAnswer.CLOSED: CauseKind.NO_RESPONSE,
    NoAnswer.TLS: CauseKind.NO_RESPONSE,
    NoAnswer.TIMEOUT: CauseKind.HANG,
    NoAnswer.CIRCUIT_OPEN: CauseKind.HANG,
    NoAnswer.HURRIED: CauseKind.HANG,
    NoAnswer.BAD_GATEWAY: CauseKind.NO_RESPONSE,
    NoAnswer.UNAVAILABLE: CauseKind.NO_RESPONSE,
    NoAnswer.GATEWAY_TIMEOUT: CauseKind.HANG,
    NoAnswer.MALFORMED: CauseKind.UNREADABLE,
}
# Headers that every request has or that do not explain a failure.
_USUAL_FIELDS = frozenset({"host", "content-length", "connection", "authorization", "user-agent"})
_SHOWN_TARGET = 120  # characters of a target
_SHOWN_FIELD = 100
_SHOWN_BODY = 200
_SHOWN_CURL = 2000
# Operations that one text names; result.json and the pages have all.
_NAMED = 10
# Numbers, times and ids, which differ between responses with the same fault.
_NUMBERS = re.compile(r"[0-9a-f.:TZ+-]*\d[0-9a-f.:TZ+-]*")
_FAULT = re.compile(rb"<(?:[\w.-]+:)?Fault[\s>]")


class Sent(NamedTuple):
    """A request, and when it was answered or given up, s on the monotonic clock."""

    at_s: float
    request: Request


class Showing(NamedTuple):
    """How one operation of a description shows a failure: its label, how often, and its smallest failing request."""

    operation: str
    seen: int = 1
    request: Request | None = None


class Again(NamedTuple):
    """How often a failure occurred again when its request was repeated.

    Attributes:
        came_back: number of repetitions that failed in the same way.
        sent: number of repetitions.
        judged: whether a checker judged each response; otherwise only the kinds of the responses were compared.
    """

    came_back: int
    sent: int
    judged: bool = True


@dataclass
class Finding:
    """One reason why a requirement is not met.

    Attributes:
        requirement: id of the requirement.
        source: the clause that the requirement cites.
        subject: what was tested: ``GET /robot/pose/``.
        expected: what the requirement demands here.
        observed: what the suite got instead.
        exchange: the smallest failing request with its result, or None if none was sent.
        cause: the kind of cause.
        doubt: what a right device may do that looks the same, as a sentence; such a finding only warns.
        causes: keys of its causes; findings with a common key have the same cause.
        operations: by label, how each operation of a description shows it; the first is that of the exchange.
        rest: whether it stands for all further causes, because the requirement has too many findings.
        among: number of requirements that the same check recorded it for.
        alone: whether only this requirement keeps the finding, because its request made the robot stop responding.
        seen: number of failed cases.
        sequence: the requests of its check up to the failing one, for replay.
        again: the result of repeating the request; None if it was not repeated.
        met: position in the order in which the run recorded findings.
        number: its number in the result; 0 until the run is over.
    """

    requirement: str
    source: str
    subject: str
    expected: str
    observed: str
    exchange: Attempt | None
    cause: CauseKind = CauseKind.RULE
    doubt: str = ""
    causes: set[str] = field(default_factory=set)
    operations: dict[str, Showing] = field(default_factory=dict)
    rest: bool = False
    among: int = 1
    alone: bool = False
    seen: int = 1
    sequence: tuple[Sent, ...] = ()
    again: Again | None = None
    met: int = 0
    number: int = 0

    def show(self, operations: Sequence[Showing], *, first: bool = False) -> None:
        """Add operations that show it; those of its own exchange go ``first``."""
        there = self.operations
        for showing in operations:
            was = there.get(showing.operation, Showing(showing.operation, 0))
            smaller = min(filter(None, (was.request, showing.request)), key=lambda sent: sent.size, default=None)
            there[showing.operation] = Showing(showing.operation, was.seen + showing.seen, smaller)
        if first:
            own = {showing.operation: there[showing.operation] for showing in operations}
            self.operations = own | there

    @property
    def unsent(self) -> bool:
        """Return whether the request was not sent because its endpoint had hung before."""
        return isinstance(self.exchange, Unanswered) and self.exchange.kind is NoAnswer.CIRCUIT_OPEN

    @property
    def text(self) -> str:
        """Return the finding as text: request, expected, actual, and how often."""
        rule = ", ".join(filter(None, (self.requirement, self.source)))
        did = f"Sent {_request_text(self.exchange.request)}." if self.exchange else f"Tested {self.subject}."
        parts = [did, f"Expected {_clause(self.expected)} ({rule}).", f"Got {_clause(self.observed)}."]
        if self.doubt:
            parts.append(f"This is a warning, because a right device may do the same: {self.doubt}.")
        if self.seen > 1:
            parts.append(f"Seen {self.seen} times.")
        others = [f"`{showing.operation}`" for showing in list(self.operations.values())[1:]]
        if others:
            parts.append(f"The same for {count_of(len(others), 'other operation')}: {few_of(others)}.")
        if self.rest:
            parts.append("It stands for all further causes: the requirement has too many findings.")
        if self.again is not None:
            parts.append(_repetition_text(self.again))
        return " ".join(parts)

    @property
    def brief(self) -> str:
        """Return subject and observation in one sentence, for a reference to the finding."""
        return f"{self.subject}: {_clause(self.observed.split('. ', 1)[0])}"


def count_of(number: int, what: str) -> str:
    """Return a number with its noun: "1 more operation", "9 more operations"."""
    return f"{number} {what}{'' if number == 1 else 's'}"


def few_of(names: Sequence[str], most: int = _NAMED) -> str:
    """Return the first names, and how many more there are: "GET /a, GET /b and 37 more"."""
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")


def in_full(finding: Finding) -> str:
    """Return the finding as text, with a command that sends its request again."""
    curl = finding.exchange.request.curl() if finding.exchange else ""
    return f"{finding.text}\n  {curl}" if curl and len(curl) <= _SHOWN_CURL else finding.text


def kind_of(exchange: Attempt | None, found: str = "") -> CauseKind:
    """Return the kind of cause of an exchange; RULE if a well-formed response was received.

    If a check found something else, such as a wrong effect of the request, the kind is RULE as well.
    """
    if isinstance(exchange, Unanswered):
        return _KINDS[exchange.kind] if not found or exchange.problem in found else CauseKind.RULE
    if exchange is None:
        return CauseKind.RULE
    response = exchange.response
    if response.status >= HTTPStatus.INTERNAL_SERVER_ERROR:
        # A SOAP fault with status 500 describes what is wrong with a request (BP 1.1 R1126).
        fault = response.status == HTTPStatus.INTERNAL_SERVER_ERROR and _FAULT.search(response.body)
        says_so = not found or str(response.status) in found
        return CauseKind.SERVER_ERROR if says_so and not fault else CauseKind.RULE
    if response.body and unreadable(response.media_type, response.body):
        return CauseKind.UNREADABLE
    return CauseKind.RULE


def likeness(exchange: Exchange) -> str:
    """Return the common part of responses with the same fault: status, media type, text without numbers and path."""
    response, path = exchange.response, exchange.request.target.partition("?")[0]
    said = response.body[:_SHOWN_BODY].decode("latin-1")
    said = said.replace(path, "#") if len(path) > 1 else said
    return f"{response.status} {response.media_type} {_NUMBERS.sub('#', said)}"


def causes_of(kind: CauseKind, exchange: Attempt | None) -> set[str]:
    """Return the keys of a cause that other checks may meet as well: kind, endpoint and status, if any.

    The set is empty for a broken rule, which is no other requirement's cause.
    """
    if kind is CauseKind.RULE or exchange is None:
        return set()
    # HEAD and GET count as one endpoint: one handler answers both (RFC 9110 9.3.2).
    parts = [kind.value, exchange.request.endpoint.replace("HEAD ", "GET ", 1)]
    if isinstance(exchange, Exchange):
        parts.append(f"{exchange.response.status}")
        if kind is CauseKind.UNREADABLE:
            parts.append(exchange.response.media_type)
    return {" ".join(parts)}


def subject_of(exchange: Attempt | None, check_name: str) -> str:
    """Return the tested thing: method and target of the request, or the check's name if none was sent."""
    if exchange is None:
        return f"by the check {check_name}" if check_name else "the robot"
    request = exchange.request
    return f"{request.method} {_cut(request.target, _SHOWN_TARGET)}".strip()


def observed_in(exchange: Attempt | None, found: str) -> str:
    """Return a description of the response, with the fault that a check found in it."""
    if exchange is None:
        return found or "something else"
    if isinstance(exchange, Unanswered):
        known = exchange.problem in found or found.startswith("no ")
        said = found if known else ": ".join(filter(None, (exchange.problem, found)))
        if exchange.kind is NoAnswer.MALFORMED:
            return said
        return said if said.startswith("no ") else f"no response: {said}"
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


def _repetition_text(again: Again) -> str:
    """Return a sentence on the repetitions of the request alone."""
    if again.came_back == again.sent:
        return f"Repeated {again.sent} times: {'failed' if again.judged else 'the same kind of response'} each time."
    what = "failed" if again.judged else "had the same kind of response"
    times = "once" if again.came_back == 1 else f"{again.came_back} times"
    return (
        f"In {again.sent} repetitions without the requests before it, the request {what} {times}: the failure is "
        "intermittent, or depends on the device's state: `roaas replay` sends the requests before it too."
    )


def _request_text(request: Request) -> str:
    """Return a short description of a request: first line, unusual headers, body."""
    if request.raw is not None:
        return f"the bytes {_quote(request.raw)}"
    what = f"`{request.method} {_cut(request.target, _SHOWN_TARGET)}`"
    fields = [
        f"`{name}: {_cut(value, _SHOWN_FIELD)}`"
        for name, value in request.headers
        if name.lower() not in _USUAL_FIELDS and (name.lower(), value) != ("accept", "*/*")
    ]
    if fields:
        what += f" with {', '.join(fields)}"
    if request.body:
        what += f"{' and' if fields else ' with'} the body {_quote(request.body)}"
    return what


def _quote(octets: bytes) -> str:
    text = octets[:_SHOWN_BODY].decode("utf-8", "backslashreplace")
    shown = "".join(char if char.isprintable() else char.encode("unicode_escape").decode() for char in text)
    more = f" ({len(octets):,} bytes in all)" if len(octets) > _SHOWN_BODY else ""
    return f"`{shown}{'…' if more else ''}`{more}"


def _cut(text: str, most: int) -> str:
    return text if len(text) <= most else f"{text[:most]}…"


def _clause(text: str) -> str:
    """Return a text without its final period, for use inside a sentence."""
    return text.strip().removesuffix(".")
