"""Whether a failure comes back: what fails once in a while is told as such, and is a failure all the same."""

from __future__ import annotations

import time
from http import HTTPStatus
from operator import itemgetter
from typing import TYPE_CHECKING

from conformance.documents.json_text import read_json
from conformance.documents.openapi import is_json
from conformance.documents.xml import NotXmlError, parse
from conformance.engine.sending_again import is_same, send_again
from conformance.transport.exchange import SAFE_METHODS, Exchange
from conformance.verdict.evidence import Again

if TYPE_CHECKING:
    from collections.abc import Iterator

    from conformance.api.rest.interface import RestInterface
    from conformance.transport.client import Connection
    from conformance.transport.exchange import Attempt, Request, Response
    from conformance.verdict.evidence import Finding
    from conformance.verdict.run import Run

_TIMES = 5
# For so long findings are looked at, the first of each requirement before others, s.
_LONGEST_S = 8.0


def look_again(run: Run, connection: Connection, rest: RestInterface | None = None) -> None:
    """Send the request of each finding again, and put down how often the failure came back.

    Where an observer judges the requirement by every answer, its word counts; else an answer of the same kind. What is
    not safe is sent again where the robot may be moved and an error of the server came: that is wrong in any state of
    the robot, and of what else came it may be the first time that makes the difference.

    Args:
        run: with its findings.
        connection: of the run.
        rest: the robot's REST interface, by which it is left at rest.
    """
    moves, until = False, time.monotonic() + _LONGEST_S
    try:
        for _, id_, finding, exchange in sorted(_again(run), key=itemgetter(0)):
            if time.monotonic() > until:
                break
            moves |= exchange.request.method not in SAFE_METHODS
            evidence = run.judge.evidence[id_]
            came_back = 0
            for _ in range(_TIMES):
                cases, seen = evidence.cases, evidence.failures
                answer = send_again(exchange.request, connection)
                judged = evidence.cases > cases
                came_back += evidence.failures > seen if judged else _comes_back(exchange.response, answer)
            finding.again = Again(came_back, _TIMES)
    finally:
        if moves and rest is not None:
            rest.device.leave_at_rest(rest)


def _again(run: Run) -> Iterator[tuple[int, str, Finding, Exchange]]:
    """The findings whose request may be sent again, each with its number among those of its requirement."""
    for id_, evidence in run.judge.evidence.items():
        if run.contract.ledger[id_].class_ not in run.claims:
            continue
        for number, finding in enumerate(list(evidence.findings.values())):
            exchange = finding.exchange
            if isinstance(exchange, Exchange) and exchange.request.raw is None and _may(run, exchange):
                yield number, id_, finding, exchange


def _may(run: Run, exchange: Exchange) -> bool:
    request: Request = exchange.request
    if request.method in SAFE_METHODS:
        return not request.body
    return run.allow_motion and exchange.response.status >= HTTPStatus.INTERNAL_SERVER_ERROR


def _comes_back(before: Response, answer: Attempt) -> bool:
    """Whether an answer is of the same kind, and its content as readable: a fault is no error page with its status."""
    if not isinstance(answer, Exchange) or not is_same(before, answer):
        return False
    return _is_readable(before) == _is_readable(answer.response)


def _is_readable(response: Response) -> bool:
    """Whether content is of its media type, as far as that is JSON or XML."""
    if is_json(response.media_type):
        return not read_json(response.body).unreadable
    if not response.media_type.endswith("xml"):
        return True
    try:
        parse(response.body)
    except NotXmlError:
        return False
    return True
