"""Check whether a finding still occurs: send its requests again, or run the checks of its requirement again."""

import itertools
import math
import tempfile
import time
from collections.abc import Collection, Iterable, Mapping
from contextlib import closing
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

import msgspec

from conformance.api.rest.guard import Guard
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.stops import UNDELIVERED, stop_device
from conformance.checkers.rest import RestCheckers
from conformance.commandline.endings import ignore_signals
from conformance.contract.described import MOTION
from conformance.contract.pack import Contract
from conformance.documents.openapi import operations_of
from conformance.engine.certification import certify
from conformance.engine.permission import moves, strangers
from conformance.engine.refused import is_refused
from conformance.engine.resending import SECURITY, fails_by_description, read_sequence, send_again
from conformance.engine.robot_under_test import RobotUnderTest
from conformance.statement.endpoints import Endpoints
from conformance.statement.statement import Calls, Statement, empty_statement
from conformance.target.connecting import connection_of
from conformance.transport.client import Connection, HttpClient
from conformance.transport.exchange import Attempt, Exchange, NoAnswer, Request, Response, Unanswered
from conformance.verdict.effort import Effort
from conformance.verdict.evidence import CheckerListener
from conformance.verdict.run import Run
from conformance.verdict.time_limit import TimeLimit

# Longest pause between two requests that is repeated, s: the effect may need the pause.
_LONGEST_PAUSE_S = 10.0
# Time limit of a replay, s: _LEAST_S, plus _EACH_S for each recorded request, but no more than _MOST_S.
_LEAST_S, _EACH_S, _MOST_S = 60.0, 2.0, 1800.0
_BY_JUDGEMENT = "as in the run"
_BY_STATUS = "by the status"
_BY_SILENCE = "by the missing response"
_ALONE = (
    "from the request alone: the failure shows only beside other responses. --statement FILE runs the requirement's "
    "own checks again; `roaas certify --init FILE URL` writes such a file"
)
# Statuses by which a gateway or device says that the device is temporarily unavailable.
_AWAY = frozenset({502, 503, 504})
_SERVER_ERROR = 500
# Characters in the text on a missing response that tell its kind.
_ALIKE = 20


class Outcome(StrEnum):
    """The outcome of a replay."""

    STILL_THERE = "still there"
    GONE = "gone"
    UNKNOWN = "cannot tell"


@dataclass(frozen=True)
class Replayed:
    """A finding after its replay.

    Attributes:
        requirement: id of the requirement.
        message: the text of the finding.
        outcome: whether it still occurs.
        came: description of the new response.
        sent: number of requests sent.
        told_by: how the outcome was decided, in a few words.
        why: why it cannot be told, where that is not the new response.
    """

    requirement: str
    message: str
    outcome: Outcome
    came: str = ""
    sent: int = 0
    told_by: str = ""
    why: str = ""


def replay(
    id_: str,
    failure: Mapping[str, Any],
    connection: Connection,
    rest: str | None = None,
    contract: Contract | None = None,
    until: float = math.inf,
) -> Replayed:
    """Send one finding's requests again.

    Args:
        id_: id of the requirement.
        failure: the finding, as in result.json.
        connection: settings for the robot's clients.
        rest: base URL of the robot's REST interface, or None.
        contract: whose checkers and description judge, or None.
        until: when no further request is sent, by time.monotonic().

    Raises:
        ValueError, KeyError, TypeError: the result is malformed.
    """
    message, sequence = str(failure["message"]), failure.get("sequence") or []
    requests = read_sequence(sequence)
    if failure["response"] is None or not requests or len(requests) < len(sequence):
        return Replayed(id_, message, Outcome.UNKNOWN, why=_ALONE)
    came: list[Attempt] = []
    began = time.monotonic()
    for item, request in zip(sequence, requests, strict=True):
        due = began + float(item["at_s"])
        time.sleep(max(0.0, min(_LONGEST_PAUSE_S, *(moment - time.monotonic() for moment in (due, until)))))
        if time.monotonic() >= until:
            why = f"the time of the replay was over before {len(requests) - len(came)} of {len(requests)} requests"
            return Replayed(id_, message, Outcome.UNKNOWN, why=why)
        attempt = send_again(request, connection)
        if isinstance(attempt, Unanswered) and attempt.kind is NoAnswer.REFUSED:
            return Replayed(id_, message, Outcome.UNKNOWN, attempt.problem)
        came.append(attempt)
    there, told_by = _still_there(id_, failure["response"], requests[-1], came[-1], rest, contract)
    outcome = Outcome.UNKNOWN if there is None else Outcome.STILL_THERE if there else Outcome.GONE
    why = _ALONE if there is None and not told_by else ""
    return Replayed(id_, message, outcome, came[-1].came, len(requests), told_by, why)


def replay_and_stop(
    chosen: Collection[tuple[str, Mapping[str, Any]]],
    result: Mapping[str, Any],
    connection: Connection,
    contract: Contract | None,
    minutes: float | None = None,
) -> tuple[list[Replayed], str]:
    """Send several findings' requests again, and then stop the robot if they may have moved it.

    The stop goes to the address of the result's robot, if one of the findings' requests went there.

    Args:
        chosen: ids of requirements with findings.
        result: the result.
        connection: settings for the robot's clients.
        contract: the contract that judged, or None.
        minutes: for how long requests are sent at most, min; None means as `longest_s` returns.

    Returns:
        What came of each, and why the robot may still move, or an empty text.

    Raises:
        ValueError, KeyError, TypeError: the result is malformed.
    """
    rest, found, unstopped = result["target"].get("rest"), [], ""
    until = time.monotonic() + (longest_s(chosen) if minutes is None else 60 * minutes)
    stop: _Stop | None = None
    try:
        for id_, failure in chosen:
            if stop is None and moves(failure, contract, rest or "") and not (rest and strangers(failure, [rest])):
                stop = _Stop(result, connection, rest, contract)
            found.append(replay(id_, failure, connection, rest if contract else None, contract, until))
    finally:
        if stop is not None:
            with ignore_signals():
                unstopped = stop.send()
    return found, unstopped


def longest_s(chosen: Iterable[tuple[str, Mapping[str, Any]]]) -> float:
    """Return for how long the requests of findings are sent at most, with the recorded pauses, s."""
    usual_s = 0.0
    for _, failure in chosen:
        at_s = [float(item["at_s"]) for item in failure.get("sequence") or ()]
        pauses = (later - earlier for earlier, later in itertools.pairwise(at_s))
        usual_s += _EACH_S * len(at_s) + sum(min(max(0.0, pause), _LONGEST_PAUSE_S) for pause in pauses)
    return min(_LEAST_S + usual_s, _MOST_S)


class _Stop:
    """Stops the result's robot by its contract; a guard process does so if this process is killed."""

    def __init__(
        self, result: Mapping[str, Any], connection: Connection, rest: str | None, contract: Contract | None
    ) -> None:
        self._problem = ""
        self._api: RestInterface | None = None
        self._guard: Guard | None = None
        moved = bool(result.get("statement", {}).get("motion_allowed"))
        if contract is None or not rest:
            self._problem = f"{UNDELIVERED}: nothing at hand says how it is stopped" if moved else ""
            return
        if moved and MOTION in result["classes"] and not any(operation.stop for operation in operations_of(contract)):
            self._problem = f"{UNDELIVERED}: only its statement says how it is stopped: give --statement"
            return
        calls, where = Calls(("*",)), Endpoints(rest=rest)
        statement = msgspec.structs.replace(empty_statement(contract), calls=calls, endpoints=where)
        self._api = RestInterface(Run(statement, contract, allow_motion=True), HttpClient(rest, connection))
        self._guard = Guard(self._api)
        self._guard.start()

    def send(self) -> str:
        """Stop the robot; return why it may still move, or an empty text."""
        if self._api is None or self._guard is None:
            return self._problem
        problem = stop_device(self._api)
        self._api.client.close()
        self._guard.release(stopped=not problem)
        return problem


def judged_by_checks(
    contract: Contract,
    statement: Statement,
    requirements: Collection[str],
    *,
    allow_motion: bool,
    seed: int,
    effort: str,
    minutes: float | None = None,
) -> dict[str, Any]:
    """Run the checks of some requirements on a robot.

    Args:
        contract: the contract.
        statement: the statement of the robot.
        requirements: ids.
        allow_motion: whether the robot may be moved.
        seed: seed of everything random, as in the recorded run.
        effort: effort of the recorded run.
        minutes: for how long the checks send requests at most, min; None means half an hour.

    Returns:
        The content of a result.json with these requirements.

    Raises:
        ContractError: the contract has no such requirement.
        OSError: a file that the statement names cannot be read.
    """
    contract = Contract.load(contract.directory, only=tuple(sorted(requirements)))
    classes = {name for item in contract.ledger.values() for name in item.classes}
    claims = tuple(name for name in contract.classes if name in classes)
    run = Run(
        statement=msgspec.structs.replace(statement, claims=claims),
        contract=contract,
        claims=claims,
        allow_motion=allow_motion,
        seed=seed,
        effort=Effort(effort),
        limit=TimeLimit(minutes or _MOST_S / 60),
    )
    with tempfile.TemporaryDirectory() as folder:
        certification = certify(RobotUnderTest(run, connection_of(statement.endpoints)), Path(folder))
    return certification.document


def _still_there(
    id_: str, recorded: Mapping[str, Any], request: Request, came: Attempt, rest: str | None, contract: Contract | None
) -> tuple[bool | None, str]:
    """Return whether a new response shows the finding again (None if unclear), and how that was decided."""
    if not isinstance(came, Exchange):
        same = recorded["status"] is None and str(recorded.get("error", ""))[:_ALIKE] == came.problem[:_ALIKE]
        return (True if same else None), _BY_SILENCE
    status = came.response.status
    if status in _AWAY and status != recorded["status"]:
        return None, _BY_STATUS
    if recorded["status"] is None:
        return False, _BY_SILENCE
    fields = tuple(
        (name, str(value))
        for name, values in recorded["headers"].items()
        # The result has the decompressed content, where that is possible.
        if name.lower() != "content-encoding" or id_ == "http/content-coding"
        for value in (values if isinstance(values, list) else [values])
    )
    before = Exchange(request, Response(recorded["status"], fields, (recorded["body"] or "").encode(), 0.0))
    now = Exchange(request, came.response)
    # The device may refuse the request, or fail, before it reaches the fault.
    hidden = status != recorded["status"] and (is_refused(now) or status >= _SERVER_ERROR)
    # The result has only the beginning of a long body, which cannot be judged.
    if rest and contract and "body_length" not in recorded:
        for fails in (_observed_to_fail, fails_by_description):
            if fails(contract, rest, id_, before):
                return (None if hidden and id_ != SECURITY else fails(contract, rest, id_, now)), _BY_JUDGEMENT
    if recorded["status"] >= _SERVER_ERROR:
        return (None if is_refused(now) else status >= _SERVER_ERROR), _BY_STATUS
    return None, ""


def _observed_to_fail(contract: Contract, base_url: str, requirement: str, exchange: Exchange) -> bool:
    """Return whether the REST checkers, which judge single responses, fail a requirement for this exchange."""
    run = Run(empty_statement(contract), contract)
    with closing(HttpClient(base_url, Connection())) as client:
        api = RestInterface(run, client)
        CheckerListener(run.judge, [RestCheckers(contract, base_url), *api.device.checkers(api, ())]).on_response(
            exchange
        )
    evidence = run.judge.of(requirement)
    return bool(evidence and evidence.failures)
