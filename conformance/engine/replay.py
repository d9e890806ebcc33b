"""Sending a finding's requests again, in their order and at their pace, and saying whether it is still there."""

from __future__ import annotations

import time
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Any

from conformance.engine.judged_again import observed_to_fail
from conformance.engine.sending_again import is_same, send_again
from conformance.engine.sequence import read_request
from conformance.transport.exchange import Exchange, NoAnswer, Response, Unanswered

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from conformance.contract.pack import Contract
    from conformance.transport.client import Connection
    from conformance.transport.exchange import Attempt, Request

# A pause between two requests is kept, as what is judged may be what comes after it; never longer than this, s.
_LONGEST_PAUSE_S = 10.0
_BY_JUDGEMENT = "judged as in the run"
_BY_KIND = "by status, media type and whether there is content"


class Outcome(StrEnum):
    """What became of a finding."""

    STILL_THERE = "still there"
    GONE = "gone"
    NOT_REPLAYED = "cannot be sent again"
    UNREACHABLE = "the robot cannot be reached"


@dataclass(frozen=True)
class Replayed:
    """One finding that was sent again.

    Attributes:
        requirement: its id.
        message: what was found.
        outcome: what became of it.
        came: what came now, in a few words.
        sent: how many requests went out.
        told_by: what tells the outcome, in a few words.
    """

    requirement: str
    message: str
    outcome: Outcome
    came: str = ""
    sent: int = 0
    told_by: str = ""


def findings(result: Mapping[str, Any], requirement: str | None) -> Iterator[tuple[str, dict[str, Any]]]:
    """The findings of a result, of one requirement or of all, by its id."""
    for item in result["requirements"]:
        if requirement in {None, item["id"]}:
            yield from ((item["id"], failure) for failure in item["failures"])


def replay(
    id_: str,
    failure: Mapping[str, Any],
    connection: Connection,
    rest: str | None = None,
    contract: Contract | None = None,
) -> Replayed:
    """Send one finding's requests again.

    What the observers found in the recorded answer by itself, they judge in the new one. Of all else only the kind of
    the answer can be compared.

    Args:
        id_: of the requirement.
        failure: the finding, as in result.json.
        connection: to the robot.
        rest: base URL of its REST interface, or None.
        contract: by which its observers judge; None: nothing but the kind of response is compared.

    Raises:
        ValueError, KeyError, TypeError: the result is not well made.
    """
    message, sequence = str(failure["message"]), failure.get("sequence") or []
    requests = [request for item in sequence if (request := read_request(item)) is not None]
    if failure["response"] is None or not requests or len(requests) < len(sequence):
        return Replayed(id_, message, Outcome.NOT_REPLAYED)
    came: list[Attempt] = []
    began = time.monotonic()
    for item, request in zip(sequence, requests, strict=True):
        due = began + float(item["at_s"])
        time.sleep(min(max(0.0, due - time.monotonic()), _LONGEST_PAUSE_S))
        attempt = send_again(request, connection)
        if isinstance(attempt, Unanswered) and attempt.kind is NoAnswer.REFUSED:
            return Replayed(id_, message, Outcome.UNREACHABLE, attempt.problem)
        came.append(attempt)
    there, told_by = _still_there(id_, failure["response"], requests[-1], came[-1], rest, contract)
    outcome = Outcome.STILL_THERE if there else Outcome.GONE
    return Replayed(id_, message, outcome, came[-1].came, len(requests), told_by)


def _still_there(
    id_: str, recorded: Mapping[str, Any], request: Request, came: Attempt, rest: str | None, contract: Contract | None
) -> tuple[bool, str]:
    """Whether an answer is what was found, and what tells it."""
    if recorded["status"] is None or not isinstance(came, Exchange):
        return recorded["status"] is None and not isinstance(came, Exchange), _BY_KIND
    fields = tuple(
        (name, str(value))
        for name, values in recorded["headers"].items()
        for value in (values if isinstance(values, list) else [values])
    )
    before = Response(recorded["status"], fields, (recorded["body"] or "").encode(), 0.0)
    # Of a long body the result has only the beginning, of which nobody can judge.
    if (
        rest
        and contract
        and "body_length" not in recorded
        and observed_to_fail(contract, rest, id_, Exchange(request, before))
    ):
        return observed_to_fail(contract, rest, id_, Exchange(request, came.response)), _BY_JUDGEMENT
    return is_same(before, came), _BY_KIND
