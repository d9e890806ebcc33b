"""What the status of an answer comes to."""

from http import HTTPStatus

from conformance.contract.sizes import TAKEN_OCTETS
from conformance.transport.exchange import Attempt, Exchange, NoAnswer, Unanswered
from conformance.verdict.evidence import Judge

# These refuse the request for another reason than its content.
_NO_REFUSALS = frozenset({401, 405, 406, 408, 429})


def is_refusal(exchange: Exchange) -> bool:
    """Whether a request was refused because of what is in it."""
    status = exchange.response.status
    return HTTPStatus.BAD_REQUEST <= status < HTTPStatus.INTERNAL_SERVER_ERROR and status not in _NO_REFUSALS


def is_taken(exchange: Exchange) -> bool:
    """Whether a valid request was taken, or only put off: a goal of the robot's own may be active."""
    return exchange.response.ok or exchange.response.status == HTTPStatus.CONFLICT


def is_cut_off(attempt: Attempt) -> bool:
    """Whether the robot closed the connection on content that it need not take (contract, fine print).

    A gateway in front of it, which finds it closed, answers 502 in its place (RFC 9110 15.6.3).
    """
    if len(attempt.request.body) <= TAKEN_OCTETS:
        return False
    if isinstance(attempt, Unanswered):
        return attempt.kind is NoAnswer.CLOSED
    return attempt.response.status == HTTPStatus.BAD_GATEWAY


def judge_status(
    judge: Judge,
    requirement: str,
    holds: bool,  # noqa: FBT001 - as Judge.check()
    exchange: Exchange,
    expected: str,
    *,
    cause: str = "",
) -> bool:
    """Judge one case by a status, each of which is a cause of its own; see Judge.check()."""
    status = exchange.response.status
    return judge.check(requirement, holds, exchange, expected, found=f"status {status}", cause=cause or f"{status}")
