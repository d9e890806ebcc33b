"""Store requests in result.json, send them again, and count how often a failure occurs again."""

import base64
import re
import time
import zlib
from collections.abc import Iterable, Sequence
from contextlib import closing
from dataclasses import replace
from http import HTTPStatus
from typing import Any, Final
from urllib.parse import urlsplit

from conformance.api.rest.interface import RestInterface
from conformance.api.rest.stops import stop_device
from conformance.api.rest.variations import Kind
from conformance.commandline.secrecy import SECRETS
from conformance.contract.pack import Contract
from conformance.documents.openapi import matching
from conformance.documents.traceback import unreadable
from conformance.scenarios.rule import Rule
from conformance.scenarios.survey import Probe, Survey
from conformance.statement.statement import empty_statement
from conformance.transport import raw
from conformance.transport.client import Connection, HttpClient
from conformance.transport.credentials import Credentials, is_shown
from conformance.transport.exchange import (
    SAFE_METHODS,
    Attempt,
    Exchange,
    Listener,
    NoAnswerError,
    Request,
    Response,
    Unanswered,
)
from conformance.transport.pace import Hangs
from conformance.verdict.evidence import Case, Judge
from conformance.verdict.finding import Again, Finding, Sent
from conformance.verdict.run import Run

_MOST = 64 * 1024  # longest request in a result, compressed, bytes
_MOST_SENT = 25 * 1024 * 1024  # bytes that are sent for one finding
_MOST_IN_ALL = 4 * _MOST_SENT
# Grammar of a method and a target (RFC 9110 5.6.2, 5.5; RFC 9112 3.2): another request cannot hide in them.
_TOKEN = re.compile(r"[!#$%&'*+.^_`|~0-9A-Za-z-]+")
_TARGET = re.compile(r"https?://[\x21-\x7e]+")
_VALUE = re.compile(r"[^\x00\r\n]*")
# Headers that the client writes itself.
_OF_THE_CLIENT = frozenset({"host", "content-length", "connection"})
_TIMES = 5  # how often a finding's request is repeated
_LONGEST_S = 8.0  # time for all findings, s; the first one of each requirement is repeated first


class SentListener(Listener):
    """A listener that reports each request to the judge before any checker judges it."""

    def __init__(self, judge: Judge) -> None:
        self._judge = judge

    def on_response(self, exchange: Exchange) -> None:
        """Report a request with its response."""
        self._judge.note_sent(exchange)

    def on_no_response(self, request: Unanswered) -> None:
        """Report a request without a response."""
        self._judge.note_sent(request)


def as_json(sequence: Sequence[Sent]) -> list[dict[str, Any]]:
    """Return a sequence of requests as JSON; ``at_s`` is the time since the first request, s."""
    return [
        {
            "at_s": round(sent.at_s - sequence[0].at_s, 3),
            "method": sent.request.method,
            "url": sent.request.url,
            "headers": [list(pair) for pair in sent.request.headers],
            "body": _pack(sent.request.body),
            "raw": None if sent.request.raw is None else _pack(sent.request.raw),
        }
        for sent in sequence
    ]


def mask(findings: Iterable[Finding], credentials: Credentials) -> None:
    """Put variables in place of secrets in the exchanges of findings, before anything encodes or cuts them."""
    if not SECRETS:
        return

    def mask_one(request: Request) -> Request:
        body = SECRETS.masked_bytes(credentials.hidden_bytes(request.body))
        octets = None if request.raw is None else SECRETS.masked_bytes(request.raw)
        return request if (body, octets) == (request.body, request.raw) else replace(request, body=body, raw=octets)

    for finding in findings:
        if isinstance(finding.exchange, Exchange):
            response = finding.exchange.response
            response = replace(response, octets=SECRETS.masked_bytes(response.octets))
            finding.exchange = replace(finding.exchange, request=mask_one(finding.exchange.request), response=response)
        elif finding.exchange is not None:
            finding.exchange = finding.exchange._replace(request=mask_one(finding.exchange.request))
        finding.sequence = tuple(message._replace(request=mask_one(message.request)) for message in finding.sequence)
        for label, one in finding.operations.items():
            finding.operations[label] = one._replace(request=one.request and mask_one(one.request))


def read_request(item: dict[str, Any]) -> Request | None:
    """Return a request from its JSON, or None if it was too large to be stored.

    Raises:
        ValueError, KeyError, TypeError: the JSON is malformed.
    """
    body, octets = _unpack(item["body"]), None if item["raw"] is None else _unpack(item["raw"])
    if body is None or (item["raw"] is not None and octets is None):
        return None
    headers = tuple((str(name), str(value)) for name, value in item["headers"])
    method, url = str(item["method"]), str(item["url"])
    parts = [(_TARGET, url)]
    if octets is None:
        parts += [
            (_TOKEN, method),
            *((_TOKEN, name) for name, _ in headers),
            *((_VALUE, value) for _, value in headers),
        ]
    for pattern, text in parts:
        if not pattern.fullmatch(text):
            raise ValueError(f"{text[:80]!r} cannot be a part of a request")
    return Request(method, url, headers, body, octets)


def read_sequence(items: Iterable[dict[str, Any]]) -> list[Request]:
    """Return the requests of a finding from their JSON, without those that were too large to be stored.

    Raises:
        ValueError, KeyError, TypeError: the JSON is malformed, or the requests are larger in all than a run stores.
    """
    found: list[Request] = []
    octets = 0
    for request in map(read_request, items):
        if request is not None:
            found.append(request)
            octets += len(request.body) + len(request.raw or b"")
        if octets > _MOST_IN_ALL:
            raise ValueError(f"requests of more than {_MOST_IN_ALL:,} octets")
    return found


def send_again(request: Request, connection: Connection) -> Attempt:
    """Send a request over a new connection and return the result."""
    where = urlsplit(request.url)
    with closing(HttpClient(f"{where.scheme}://{where.netloc}", connection, Hangs())) as client:
        try:
            if request.raw is not None:
                if connection.credentials.awaits_challenge:
                    client.send("GET", where.path)
                octets = connection.credentials.reveal(request.raw)
                return raw.read_one(client, octets, raw.talk(client, octets, answers=1), request.method)[0]
            fields = [pair for pair in request.headers if pair[0].lower() not in _OF_THE_CLIENT]
            own = [(name, value) for name, value in fields if not is_shown(value)]
            authorized = len(own) < len(fields) or not connection.credentials.fields(shown=True)
            if not any(name.lower() == "accept" for name, _ in own):
                own.append(("Accept", ""))
            target = where.path + (f"?{where.query}" if where.query else "")
            return client.send(
                request.method,
                target,
                headers=own,
                body=connection.credentials.reveal(request.body),
                fresh=True,
                authorized=authorized,
            )
        except NoAnswerError as none:
            return none.unanswered


def is_same(before: Response, came: Attempt) -> bool:
    """Return whether two responses have the same status and media type, and both or neither have a body."""
    if not isinstance(came, Exchange):
        return False
    now = came.response
    same_kind = (before.status, before.media_type) == (now.status, now.media_type)
    return same_kind and bool(before.body) == bool(now.body)


def look_again(run: Run, connection: Connection, rest: RestInterface | None = None) -> None:
    """Send the request of each finding again, and record how often the failure occurs again.

    If a checker or a rule on the description judges the requirement by single responses, its judgement counts;
    otherwise a response with the same status and media type. An unsafe request is repeated only if the robot may be
    moved and the response was 5xx, which is wrong in any state of the robot.

    Args:
        run: with its findings.
        connection: settings for the robot's clients.
        rest: the robot's REST interface, through which the robot is stopped afterwards.
    """
    findings = [
        (number, finding, finding.exchange)
        for id_, evidence in run.judge.evidence.items()
        if run.contract.ledger[id_].binds(run.claims)
        for number, finding in enumerate(evidence.findings.values())
        if isinstance(finding.exchange, Exchange) and _may_be_sent(run, finding.exchange)
    ]
    moves, until = False, time.monotonic() + _LONGEST_S
    try:
        for _, finding, exchange in sorted(findings, key=lambda item: item[0]):
            if time.monotonic() > until:
                break
            moves |= exchange.request.method not in SAFE_METHODS
            cases = run.judge.cases(finding.requirement)
            base_url = rest.client.base_url if rest is not None else ""
            by_rule = fails_by_description(run.contract, base_url, finding.requirement, exchange)
            base_url = base_url if by_rule else ""
            came_back = sum(_fails_again(run, finding, exchange, connection, base_url) for _ in range(_TIMES))
            finding.again = Again(came_back, _TIMES, judged=by_rule or run.judge.cases(finding.requirement) > cases)
    finally:
        if moves and rest is not None:
            stop_device(rest)


def _may_be_sent(run: Run, exchange: Exchange) -> bool:
    request = exchange.request
    if request.raw is not None:
        return False
    if request.method in SAFE_METHODS:
        return not request.body
    may_move = run.allow_motion and not run.stop_undelivered
    return may_move and exchange.response.status >= HTTPStatus.INTERNAL_SERVER_ERROR


def _fails_again(run: Run, finding: Finding, exchange: Exchange, connection: Connection, base_url: str) -> bool:
    """Send a finding's request once more; return whether the failure occurred again.

    With a base URL, the rule on the description judges the response.
    """
    evidence, before = run.judge.evidence[finding.requirement], exchange.response
    cases, failures = evidence.cases, evidence.failures
    came = send_again(exchange.request, connection)
    if evidence.cases > cases:
        return evidence.failures > failures
    if base_url:
        now = Exchange(exchange.request, came.response) if isinstance(came, Exchange) else None
        return now is not None and fails_by_description(run.contract, base_url, finding.requirement, now)
    if not isinstance(came, Exchange) or not is_same(before, came):
        return False
    # A SOAP fault and an error page with the same status are different responses.
    return bool(unreadable(before.media_type, before.body)) == bool(
        unreadable(came.response.media_type, came.response.body)
    )


def _pack(octets: bytes) -> str | None:
    """Return bytes compressed (RFC 1950) in base64, or None if that is still too large."""
    packed = zlib.compress(octets) if octets else b""
    return base64.b64encode(packed).decode() if len(packed) <= _MOST and len(octets) <= _MOST_SENT else None


def _unpack(text: str | None) -> bytes | None:
    """Return the original bytes; decompression stops at the size that a run writes, as the result may be hostile."""
    if not text:
        return None if text is None else b""
    packed = base64.b64decode(text)
    opened = zlib.decompressobj()
    try:
        octets = opened.decompress(packed, _MOST_SENT + 1) if len(packed) <= _MOST else b""
    except zlib.error as error:
        raise ValueError(str(error)) from error
    if not opened.eof:
        raise ValueError(f"a request that is cut short, or has more than {_MOST_SENT:,} octets")
    return octets


SECURITY: Final = "description/security"


def fails_by_description(contract: Contract, base_url: str, requirement: str, exchange: Exchange) -> bool:
    """Return whether one exchange fails a rule that compares single responses with the description."""
    # Imported late: the rules of described devices take a tenth of a second.
    from conformance.rules.description import test_answers  # noqa: PLC0415

    found = vars(test_answers).values()
    rule = next((one for one in found if isinstance(one, Rule) and one.requirement == requirement), None)
    path = exchange.request.url.removeprefix(base_url.rstrip("/")).partition("?")[0]
    operation = matching(contract, exchange.request.method, path) if rule else None
    if rule is None or operation is None:
        return False
    trace = (exchange,) if requirement == SECURITY else Survey((Probe(operation.label, Kind.USUAL, exchange=exchange),))
    run = Run(empty_statement(contract), contract)
    return any(isinstance(case, Case) and not case.holds for case in rule.outcomes(trace, {"run": run}.__getitem__))
