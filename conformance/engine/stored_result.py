"""Read a result.json that may come from anybody, and judge its run again without the device (``roaas judge``)."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final

import msgspec

from conformance.api.device import device_of
from conformance.api.rest.interface import RestInterface
from conformance.api.soap.resources import resources_of
from conformance.api.soap.service import SoapService
from conformance.checkers.rest import RestCheckers
from conformance.checkers.soap import SoapCheckers, answers_of
from conformance.checkers.soap_memory import SoapThings
from conformance.commandline.given_files import read_json, read_octets
from conformance.commandline.help_pages import inert
from conformance.contract.classes import Interface
from conformance.contract.generic import generic_ledger
from conformance.engine.certification import draw_verdicts
from conformance.engine.planning import collect_checks
from conformance.engine.robot_under_test import RobotUnderTest
from conformance.history.events import Began, Ended, HistoryError, Sent, Span, Withdrawn, read_history
from conformance.history.writing import HISTORY_NAME
from conformance.scenarios.rule import Rule, record
from conformance.scenarios.scenario import Recordings, Scenario
from conformance.scenarios.stored import TRACES_NAME, read_traces
from conformance.transport.client import Connection, HttpClient
from conformance.transport.exchange import Attempt, Exchange, Listener
from conformance.transport.parallel import is_busy
from conformance.transport.passage import Heard
from conformance.transport.raw import tell
from conformance.transport.reach import split
from conformance.verdict.evidence import Checker, CheckerListener, Judge
from conformance.verdict.verdicts import Verdict


@dataclass(frozen=True)
class Judged:
    """The outcome of judging a stored run again.

    Attributes:
        verdicts: those with a case, in the ledger's order.
        requests: the requests in the history.
        ended: whether the history is whole: the run was not killed.
        faults: what could not be judged, because of an error of the suite.
        lacking: the requirements with a trace that is judged by a map, which the statement does not have.
    """

    verdicts: tuple[Verdict, ...]
    requests: int
    ended: bool
    faults: tuple[str, ...]
    lacking: tuple[str, ...]


def judge_stored(robot: RobotUnderTest, result: Mapping[str, Any], folder: Path) -> Judged:
    """Judge the history and the traces in a result's folder; at least one of them must exist.

    Args:
        robot: with statement and contract; it is not asked.
        result: the content of result.json.
        folder: the folder of the result.

    Raises:
        HistoryError, TracesError: one of the files cannot be read, neither is there, or the history is another run's.
    """
    run, requests, ended = robot.run, 0, True
    there = {name for name in (HISTORY_NAME, TRACES_NAME) if (folder / name).exists()}
    marks = (item.get_closest_marker("rule") for item in collect_checks(robot)) if TRACES_NAME in there else ()
    rules = [mark.args for mark in marks if mark is not None]
    known = [scenario for _, scenario in rules]
    traces = read_traces(folder / TRACES_NAME, known, run.judge.fault) if known else Recordings()
    if HISTORY_NAME in there or not there:
        requests, ended = _judge_history(robot, result, folder / HISTORY_NAME)
    lacking = _judge_traces(robot, rules, traces)
    for evidence in run.judge.evidence.values():
        # Parts that need an experiment cannot be judged again from records.
        evidence.parts = {part: cases for part, cases in evidence.parts.items() if cases}
    judged = tuple(verdict for verdict in draw_verdicts(run)[0] if verdict.evidence.cases)
    return Judged(judged, requests, ended, tuple(run.judge.faults), lacking)


def _judge_history(robot: RobotUnderTest, result: Mapping[str, Any], path: Path) -> tuple[int, bool]:
    """Judge each exchange as in the run; return how many requests there are, and whether the run ended."""
    events, judge = list(read_history(path)), robot.run.judge
    began = next((event.started for event in events if isinstance(event, Began)), "")
    if began and began != result["started"]:
        raise HistoryError(
            f"{path} is the history of another run: it began at {began}, this one at {result['started']}"
        )
    withdrawn = {event.id for event in events if isinstance(event, Withdrawn)}
    listeners, requests = list(_listeners(robot, result["target"])), 0
    for event in events:
        if isinstance(event, Span):
            judge.begin(event.name)
        elif isinstance(event, Sent):
            requests += 1
            if event.request is not None and event.request.raw is not None:
                tell(listeners, event.request.raw)
            if event.outcome is not None and event.id not in withdrawn and _is_heard(event, event.outcome):
                _tell(judge, listeners, event.outcome)
    return requests, bool(events) and isinstance(events[-1], Ended)


def _is_heard(event: Sent, outcome: Attempt) -> bool:
    return event.heard is Heard.ALWAYS or (event.heard is Heard.UNLESS_BUSY and not is_busy(outcome))


def _tell(judge: Judge, listeners: list[Listener], outcome: Attempt) -> None:
    judge.note_sent(outcome)
    for listener in listeners:
        if isinstance(outcome, Exchange):
            listener.on_response(outcome)
        else:
            listener.on_no_response(outcome)


def _listeners(robot: RobotUnderTest, target: Mapping[str, Any]) -> Iterator[Listener]:
    """Yield the listeners that judge a run's exchanges, whichever check sent them."""
    run, services = robot.run, list(_services(robot, target))
    checkers: list[Checker] = []
    rest = target.get("rest")
    api = RestInterface(run, HttpClient(str(rest), Connection())) if rest else None
    device = api.device if api is not None else device_of(run)
    yield CheckerListener(run.judge, device.checkers(api, services), by_rule=False)
    if api is not None:
        checkers.append(RestCheckers(run.contract, api.client.base_url, [service.endpoint for service in services]))
    if services:
        checkers.append(SoapCheckers({service.endpoint: answers_of(service.contract) for service in services}))
    if (resources := resources_of(run.contract)) is not None:
        checkers.append(SoapThings(resources))
    yield CheckerListener(run.judge, checkers)


def _services(robot: RobotUnderTest, target: Mapping[str, Any]) -> Iterator[SoapService]:
    """Yield the SOAP services of a contract that names them, as the run had them."""
    contract = robot.run.contract
    for name, path in (
        (Interface.PUBLISHERS, contract.publishers_path),
        (Interface.SUBSCRIBERS, contract.subscribers_path),
    ):
        if path and (endpoint := target.get(f"{name}_endpoint")):
            base, below = split(str(endpoint))
            yield SoapService(name, HttpClient(base, Connection()), below, contract_wsdl_path=path)


def _judge_traces(robot: RobotUnderTest, rules: list[tuple[Rule, Scenario]], traces: Recordings) -> tuple[str, ...]:
    """Judge the traces of scenarios by the contract's rules; return the requirements whose map is missing."""
    run, lacking = robot.run, dict[str, None]()
    maps = {"motion": run.statement.motion_map, "ros": run.statement.ros_map, "state_map": run.statement.state_map}
    known: dict[str, Any] = {"run": run, "statement": run.statement, "effort": run.effort} | maps
    for rule, scenario in rules:
        if (recording := traces.played.get(scenario.name)) is None:
            continue
        if any(name in rule.fixtures for name, found in maps.items() if found is None):
            lacking[rule.requirement] = None
        else:
            record(run.judge, rule.requirement, rule.outcomes(recording.trace, known.__getitem__))
    return tuple(lacking)


_FORMAT: Final = "roaas-result/1"
_SHOWN: Final = 300
#: Exceptions that a result file of the right types may still raise, for example if its description contradicts itself.
MALFORMED: Final = (ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError)


class StoredResultError(ValueError):
    """Raised for a file that is no result; the message is one line and safe to print."""


class _Sent(msgspec.Struct):
    at_s: float
    method: str
    url: str
    headers: list[tuple[str, str]]
    body: str | None
    raw: str | None


class _Response(msgspec.Struct):
    status: int | None
    headers: dict[str, str | list[str]] | None = None
    body: str | None = None


class _Failure(msgspec.Struct):
    message: str
    response: _Response | None
    number: int | str | None = None
    sequence: list[_Sent] | None = None


class _Requirement(msgspec.Struct):
    id: str
    failures: list[_Failure]
    aliases: list[str] = []


class _WebServer(msgspec.Struct):
    requirements: list[_Requirement] = []


class _Target(msgspec.Struct):
    rest: str | None = None


class _Result(msgspec.Struct):
    """The parts of a result that a replay reads."""

    requirements: list[_Requirement]
    web_server: _WebServer | None = None
    suite: dict[str, Any] = {}
    pack: dict[str, Any] = {}
    target: _Target = msgspec.field(default_factory=_Target)
    statement: dict[str, Any] = {}
    classes: dict[str, str] = {}
    seed: Annotated[int, msgspec.Meta(ge=0)] | None = None
    effort: str | None = None


def read_result(path: Path) -> dict[str, Any]:
    """Return the content of a result file.

    Raises:
        StoredResultError: it cannot be read, or is no result.
    """
    try:
        document = read_json(read_octets(path))
    except (OSError, ValueError) as error:
        raise StoredResultError(f"{path} cannot be read: {inert(str(error))[:_SHOWN]}") from error
    if not isinstance(document, dict) or document.get("format") != _FORMAT:
        raise StoredResultError(f"{path} is no {_FORMAT}")
    try:
        msgspec.convert(document, _Result)
    except (ValueError, OverflowError, RecursionError) as error:
        raise not_well_made(path, error) from error
    return document


def not_well_made(path: Path, error: Exception) -> StoredResultError:
    """Return the error for a result whose content raised another error."""
    said = inert(f"{type(error).__name__}: {error}")[:_SHOWN]
    return StoredResultError(f"{path} is no well-made {_FORMAT}: {said}")


def findings(result: Mapping[str, Any], chosen: str | None) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield (requirement id, finding) for all findings of a result.

    Args:
        result: the result.
        chosen: only those of this requirement (by any id that it had), or the one with this number; None means all.
    """
    known = generic_ledger().get(chosen or "")
    names = {chosen, *(known.aliases if known else ())}
    for item in (*result["requirements"], *result.get("web_server", {}).get("requirements", ())):
        whole = chosen is None or not names.isdisjoint({item["id"], *item.get("aliases", ())})
        for failure in item["failures"]:
            if whole or chosen == str(failure.get("number")):
                yield item["id"], failure
