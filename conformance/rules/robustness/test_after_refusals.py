"""After the refusal of a request with content, the next request on the connection is answered (RFC 9112 9.3)."""

from __future__ import annotations

import time
from dataclasses import replace
from itertools import cycle

import pytest

from conformance.api.expectation import expect
from conformance.api.rest import by_hand
from conformance.api.rest.applicable import allows, reads
from conformance.api.rest.calls import Call
from conformance.api.rest.inputs import request_of, usual_inputs
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.values import Values
from conformance.api.rest.variations import unknown_variations
from conformance.contract.classes import TAKEN_OCTETS
from conformance.documents.openapi import Operation, operations_of
from conformance.transport import raw
from conformance.transport.exchange import Attempt, Exchange, NoAnswerError, NotPermittedError, Outgoing
from conformance.verdict.evidence import Judge

pytestmark = [pytest.mark.phase("acting"), pytest.mark.needs("rest")]
_ID = "robustness/recovers"
_TEXT = "text/plain"
# Statuses that a valid read may get regardless of the refused request before it.
_OTHERWISE = frozenset({401, 403, 404, 409, 410, 423, 429, 503})
_OK, _REDIRECTED = 200, 400
# A server may keep the connection open without reading: the suite waits _WAITS times for _THINK_S, s.
_THINK_S, _WAITS = 3.0, 2


@pytest.mark.requirement(_ID)
def test_reads_behind_refused_content(api: RestInterface, judge: Judge, values: Values) -> None:
    """Send content that is refused, small and 64 KiB, and a valid read behind it on the same connection."""
    found = [call for call in reads(api) if call.operation.label in api.working]
    taking = [item for item in operations_of(api.run.contract) if item.bodies and allows(api, item)]
    calls, waited = cycle(found), 0
    for number, operation in enumerate(api.run.effort.subsample(taking, 2) if found else ()):
        for request in _refusable(operation, values, number) if operation.label not in api.streams else ():
            if waited >= _WAITS:
                return
            call, begun = next(calls), time.monotonic()
            answer = _behind(api, request, call)
            waited += time.monotonic() - begun > _THINK_S
            if answer is not None and _is_lost(answer):
                if not call.send(api).response.ok:
                    continue  # what fails alone too has another reason
                # Once more: the first time, it may have had another reason as well.
                answer = _behind(api, request, call) or answer
            if answer is not None:
                expect(judge, _ID, answer).that(
                    not _is_lost(answer),
                    f"status 200 for GET {call.path}, as on a connection of its own, behind a refused "
                    f"{operation.label} with {len(request.body):,} bytes of content, or a closed connection",
                    cause=f"{operation.label} {answer.came}",
                )


def _refusable(operation: Operation, values: Values, number: int) -> list[Outgoing]:
    """Return requests with content that a device refuses by its media type, as unreadable, and for an unknown id."""
    usual = usual_inputs(operation, values)[0]
    valid = request_of(operation, usual)
    small, large = valid.body or b"{}", (valid.body or b"{}").ljust(TAKEN_OCTETS)
    # It ends in a space, so that no server takes its end for the name of a method.
    cut = b'{"roaas": '.ljust(0 if number % 2 else TAKEN_OCTETS)
    other = replace(valid.having_type(_TEXT), body=large if number % 2 else small)
    found = [replace(valid, body=cut), *([other] if _TEXT not in operation.bodies else [])]
    unknown = list(unknown_variations(operation, usual))[-1:]
    return found + [
        replace(request_of(operation, variation.inputs), body=small if number % 2 else large) for variation in unknown
    ]


def _behind(api: RestInterface, request: Outgoing, call: Call) -> Attempt | None:
    """Send a request and a read behind it; return the outcome of the read, None if it may stay unanswered."""
    fields = [f"{name}: {value}" for name, value in request.headers]
    fields.append(f"Content-Length: {len(request.body)}")
    first = raw.head(api.client, request.method, request.target, *fields) + request.body
    octets = first + raw.head(api.client, "GET", call.path, "Connection: close")
    try:
        longest = min(api.client.connection.timeout_s, _THINK_S + 4 * api.run.effort.usual_ms / 1000)
        came = by_hand.talk(api, octets, answers=2, refused=True, timeout_s=longest)
    except (NoAnswerError, NotPermittedError):
        return None  # the survey tells what breaks a connection
    refused, behind = raw.read_one(api.client, octets, came, request.method)
    if not isinstance(refused, Exchange) or refused.response.status < _REDIRECTED:
        return None
    # A server may close the connection after an error, before it reads on.
    return raw.read_one(api.client, octets, raw.rest_of(came, behind), "GET")[0] if behind else None


def _is_lost(attempt: Attempt) -> bool:
    """Return whether a valid read was not taken for one."""
    if not isinstance(attempt, Exchange):
        return True
    status = attempt.response.status
    return not (_OK <= status < _REDIRECTED or status in _OTHERWISE)
