"""Check whether a finding still occurs: send its requests again, or run the checks of its requirement again."""

import tempfile
import time
from collections.abc import Collection, Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

import msgspec

from conformance.api.rest.interface import RestInterface
from conformance.api.rest.observers import Observer
from conformance.contract.generic import generic_ledger
from conformance.contract.pack import Contract
from conformance.engine.certification import certify
from conformance.engine.connecting import connection_of
from conformance.engine.resending import is_same, read_request, send_again
from conformance.engine.robot_under_test import RobotUnderTest
from conformance.statement.statement import Statement, empty_statement
from conformance.transport.client import Connection, HttpClient
from conformance.transport.exchange import Attempt, Exchange, NoAnswer, Request, Response, Unanswered
from conformance.verdict.effort import Effort
from conformance.verdict.run import Run

# A pause between two requests is kept, as what is judged may be what comes after it; never longer than this, s.
_LONGEST_PAUSE_S = 10.0
_BY_JUDGEMENT = "as in the run"
_BY_KIND = "by status, media type and whether there is content"


class Outcome(StrEnum):
    """The outcome of a replay."""

    STILL_THERE = "still there"
    GONE = "gone"
    NOT_REPLAYED = "cannot be sent again"
    UNREACHABLE = "the robot cannot be reached"


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
    """

    requirement: str
    message: str
    outcome: Outcome
    came: str = ""
    sent: int = 0
    told_by: str = ""


def findings(result: Mapping[str, Any], chosen: str | None) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield (requirement id, finding) for all findings of a result.

    Args:
        result: the result.
        chosen: only those of this requirement (by any id that it had), or the one with this number; None: all.
    """
    known = generic_ledger().get(chosen or "")
    names = {chosen, *(known.aliases if known else ())}
    for item in (*result["requirements"], *result.get("web_server", {}).get("requirements", ())):
        whole = chosen is None or not names.isdisjoint({item["id"], *item.get("aliases", ())})
        for failure in item["failures"]:
            if whole or chosen == str(failure.get("number")):
                yield item["id"], failure


def replay(
    id_: str,
    failure: Mapping[str, Any],
    connection: Connection,
    rest: str | None = None,
    contract: Contract | None = None,
) -> Replayed:
    """Send one finding's requests again.

    Findings of observers are judged again by the new response. For others, only status and media type are compared.

    Args:
        id_: id of the requirement.
        failure: the finding, as in result.json.
        connection: settings for the robot's clients.
        rest: base URL of the robot's REST interface, or None.
        contract: whose observers judge; None: only status and media type are compared.

    Raises:
        ValueError, KeyError, TypeError: the result is malformed.
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


def judged_by_checks(
    contract: Contract,
    statement: Statement,
    requirements: Collection[str],
    *,
    allow_motion: bool,
    seed: int,
    effort: str,
) -> list[dict[str, Any]]:
    """Run the checks of some requirements on a robot.

    Args:
        contract: the contract.
        statement: of the robot.
        requirements: ids.
        allow_motion: whether the robot may be moved.
        seed: seed of everything random, as in the recorded run.
        effort: effort of the recorded run.

    Returns:
        The requirements as in result.json, in the ledger's order.

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
    )
    with tempfile.TemporaryDirectory() as folder:
        certification = certify(RobotUnderTest(run, connection_of(statement.endpoints)), Path(folder))
    judged: list[dict[str, Any]] = certification.document["requirements"]
    return judged


def _still_there(
    id_: str, recorded: Mapping[str, Any], request: Request, came: Attempt, rest: str | None, contract: Contract | None
) -> tuple[bool, str]:
    """Return whether the new response shows the finding again, and how that was decided."""
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
        and _observed_to_fail(contract, rest, id_, Exchange(request, before))
    ):
        return _observed_to_fail(contract, rest, id_, Exchange(request, came.response)), _BY_JUDGEMENT
    return is_same(before, came), _BY_KIND


def _observed_to_fail(contract: Contract, base_url: str, requirement: str, exchange: Exchange) -> bool:
    """Return whether the REST observers, which judge single responses, fail a requirement for this exchange.

    Args:
        contract: the contract.
        base_url: base URL of the robot's REST interface.
        requirement: id of the requirement.
        exchange: any exchange; one with another interface fails nothing.
    """
    run = Run(empty_statement(contract), contract)
    with closing(HttpClient(base_url, Connection())) as client:
        api = RestInterface(run, client)
        for observer in (Observer(api), *api.device.observers(api)):
            observer.answered(exchange)
    evidence = run.judge.of(requirement)
    return bool(evidence and evidence.failures)
