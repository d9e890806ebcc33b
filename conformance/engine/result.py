"""The content of result.json (format roaas-result/1)."""

import datetime as dt
import hashlib
import platform
from collections.abc import Collection, Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import msgspec
from msgspec import to_builtins
from msgspec.json import encode

from conformance.commandline.out_folder import without_folders, write_json
from conformance.contract.classes import Interface
from conformance.contract.ledger import Requirement
from conformance.contract.toml_file import Text, TomlFileError, read_toml
from conformance.documents.openapi import operations_of
from conformance.engine.resending import as_json
from conformance.engine.robot_under_test import RobotUnderTest
from conformance.engine.suite import contract_digests, suite_digest, suite_version, version_of
from conformance.explaining.advice import topic_of
from conformance.transport.exchange import Attempt, Unanswered
from conformance.verdict.baseline import NOTHING, Accepted
from conformance.verdict.causes import Cause
from conformance.verdict.finding import Finding, count_of
from conformance.verdict.run import Run
from conformance.verdict.verdicts import ClassValue, Value, Verdict, overall, verdict_line, views

_KNOWN = Path(__file__).with_name("web_servers.toml")
_SERVER_SHOWN = 80


class _Remedy(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One way to meet rules that a web server breaks by default.

    Attributes:
        words: such as "behind nginx"; a text follows that says what is met.
        meets: ids of the rules that are met then.
        servers: how the Server field begins, in lower case; empty means any server.
    """

    words: Text
    meets: tuple[Text, ...]
    servers: tuple[Text, ...] = ()


class _File(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    smuggling: tuple[Text, ...]
    remedy: tuple[_Remedy, ...]


@cache
def _known_servers() -> _File:
    return read_toml(_KNOWN, _File, TomlFileError)


def web_server(verdicts: Sequence[Verdict], server: str) -> dict[str, Any]:
    """Return server, text and smuggling for result.json; empty if no rule was judged.

    Args:
        verdicts: on the rules of the class.
        server: the value of the Server field; empty if the server sends none.
    """
    judged = [verdict for verdict in verdicts if verdict.evidence.cases]
    if not judged:
        return {}
    failed = {
        verdict.requirement.id: verdict.requirement for verdict in judged if verdict.value in {Value.FAIL, Value.WARN}
    }
    tricked = [id_ for id_ in failed if id_ in _known_servers().smuggling]
    text = " ".join(_sentences(failed.values(), len(judged), tricked, server))
    return {"server": server or None, "text": text, "smuggling": tricked}


def _sentences(failed: Collection[Requirement], judged: int, tricked: list[str], server: str) -> Iterator[str]:
    name = f"{server[:_SERVER_SHOWN]} by its Server field" if server else "which sends no Server field"
    if not failed:
        yield f"Its web server, {name}, meets each of the {count_of(judged, 'rule')} judged."
        return
    count = f"{len(failed)} of {count_of(judged, 'rule')}"
    named = ", ".join(f"{requirement.id} ({requirement.level}, {requirement.source})" for requirement in failed)
    yield f"Its web server, {name}, does not meet {count}: {named}."
    if tricked:
        yield (
            f"This weighs most behind a proxy or a firewall: {', '.join(tricked)}. Where two servers read such a "
            "request differently, a client can hide a second request in it (request smuggling)."
        )
    yield from _remedies([requirement.id for requirement in failed], server)
    yield "Most often the server does this, not the API, and the verdict stays; --class web-server judges by it."


def _remedies(failed: Sequence[str], server: str) -> Iterator[str]:
    """Yield this server's known remedies, each with the rules that it repairs."""
    for remedy in _known_servers().remedy:
        mended = [id_ for id_ in failed if id_ in remedy.meets]
        if mended and (not remedy.servers or server.lower().startswith(remedy.servers)):
            met = "every rule is met" if len(mended) == len(failed) else f"these are met: {', '.join(mended)}"
            yield f"{remedy.words[0].upper()}{remedy.words[1:]}, {met}."


RESULT_FORMAT = "roaas-result/1"
RESULT_NAME = "result.json"
_SHOWN_BODY = 4096  # characters of a body that the result keeps; it always has the length
_SHOWN_CURL = 20_000  # longest command, characters
_COMMANDS = 30  # operations of a finding for which the result has a curl command
_SHORT_CURL = 2000  # longest such command, characters
_LIBRARIES = ("schemathesis", "hypothesis", "zeep", "lxml", "xmlschema", "h11")


def result_document(
    robot: RobotUnderTest,
    verdicts: list[Verdict],
    causes: list[Cause],
    classes: Mapping[str, tuple[ClassValue, str]],
    *,
    started: dt.datetime,
    finished: dt.datetime,
    command: str,
    notes: list[str],
    interrupted: bool,
    accepted: Accepted = NOTHING,
) -> dict[str, Any]:
    """Return the content of result.json for a run."""
    run, statement = robot.run, robot.run.statement
    if not run.digests:
        # Digests are computed at the start: the files may be gone when the run ends.
        run.digests.update(suite=suite_digest(run.contract), contract=contract_digests(run.contract))
    aside = [one for one in verdicts if one.requirement.class_ in run.beside]
    verdicts = [one for one in verdicts if one not in aside]
    ids = {one.requirement.id for one in verdicts}
    causes = [cause for cause in causes if cause.finding.requirement in ids]
    value = overall(classes, enough=run.is_decided)
    return {
        "format": RESULT_FORMAT,
        "verdict": value,
        "verdict_line": verdict_line(run, value, verdicts),
        **({"stop_undelivered": run.stop_undelivered} if run.stop_undelivered else {}),
        **({"accepted_until": accepted.until} if accepted.until else {}),
        **({"refused": run.refused} if run.refused else {}),
        "interrupted": interrupted,
        "suite": {"version": suite_version(), "contract": run.contract.label, "digest": run.digests["suite"]},
        "pack": {"name": run.contract.name, "version": run.contract.version, "title": run.contract.title},
        "requirement_set": run.requirement_set.facts if run.requirement_set else None,
        "digests": {
            "statement": run.given.statement,
            "contract": run.digests["contract"],
            **({"map": _digest(statement.motion_map)} if statement.motion_map else {}),
        },
        "baseline": {"digest": run.given.baseline} if run.given.baseline else None,
        **({"stale": list(accepted.stale)} if accepted.stale else {}),
        **({"selected": sorted(run.selection.ids)} if run.selection.ids is not None else {}),
        "nonce": run.given.nonce,
        "places": run.given.places,
        "target": _target(robot),
        "statement": {
            "robot": statement.robot,
            "endpoints": {
                key: _without_folders(value)
                for key, value in to_builtins(statement.endpoints).items()
                if value is not None
            },
            "claims": list(run.claims),
            **statement.figures,
            "motion_allowed": run.allow_motion,
        },
        "seed": run.seed,
        "effort": run.effort.name,
        "speed": {
            "class": run.effort.speed.name,
            "usual_ms": round(run.effort.usual_ms, 3),
            "share_of_cases": run.effort.speed.share,
            "share_tried": round(run.share, 4),
        },
        "command": command,
        "started": rfc3339(started),
        "finished": rfc3339(finished),
        "duration_s": round((finished - started).total_seconds(), 3),
        "requests": robot.connection.sent,
        "resent_requests": robot.connection.resent,
        "environment": {
            "python": platform.python_version(),
            "platform": platform.platform(),
            "libraries": {name: version_of(name) for name in _LIBRARIES},
        },
        "classes": {name: value for name, (value, _) in classes.items()},
        "class_titles": {name: run.contract.classes[name].title for name in classes},
        "class_views": dict(views(verdicts, run.contract.acting)),
        "class_reasons": {name: reason for name, (_, reason) in classes.items() if reason},
        "requirements": [_requirement(verdict) for verdict in verdicts],
        "causes": [_cause(cause) for cause in causes],
        "contract_sections": {anchor: section._asdict() for anchor, section in run.contract.cited_sections.items()},
        "notes": notes,
        **_faults(run),
        **left_out(robot),
        **_api(robot, causes),
        **_beside(robot, aside),
    }


def _digest(value: Any) -> str:
    """Return a digest of data."""
    return f"sha256:{hashlib.sha256(encode(value, order='deterministic')).hexdigest()}"


def _faults(run: Run) -> dict[str, Any]:
    """Return what an error in the suite kept from being judged, under its key in result.json; empty if none."""
    faults = [{"text": text, "requirements": ids} for text, ids in run.judge.faults.items()]
    return {"suite_errors": faults} if faults else {}


def left_out(robot: RobotUnderTest) -> dict[str, Any]:
    """Return what ``--minutes`` left out, under its key in result.json; empty if nothing."""
    run, limit = robot.run, robot.run.limit
    if not limit.is_struck:
        return {}
    unjudged = [
        id_
        for id_, evidence in run.judge.evidence.items()
        if limit.reason in {*evidence.notes, *evidence.unseen}
        and not evidence.cases
        and run.contract.ledger[id_].binds(run.claims)
    ]
    return {
        "left_out": {
            "minutes": limit.minutes,
            "text": limit.left_out(len(operations_of(run.contract)), unjudged),
            "operations": list(limit.uncalled),
            "fewer": limit.fewer,
            "requirements": unjudged,
        }
    }


def _beside(robot: RobotUnderTest, aside: list[Verdict]) -> dict[str, Any]:
    """Return the verdicts on the web server, under their key; empty if they are in the verdict, or none was judged."""
    found = web_server(aside, robot.rest.server if robot.rest else "")
    return {"web_server": {**found, "requirements": [_requirement(verdict) for verdict in aside]}} if found else {}


def _without_folders(value: Any) -> Any:
    """Return a statement's values without the folders of its files."""
    if isinstance(value, dict):
        return {key: _without_folders(inner) for key, inner in value.items()}
    return without_folders(value) if isinstance(value, str) else value


def _api(robot: RobotUnderTest, causes: list[Cause]) -> dict[str, Any]:
    """Return the calls of a described API's operations, under their key in result.json."""
    if robot.log is None or robot.rest is None:
        return {}
    findings = [cause.finding for cause in causes]
    return {
        "api": robot.log.document(robot.rest.call_rules, findings, robot.rest.usual_status, robot.run.mapped_calls),
        **({"ros": list(robot.ros_ends.document(findings))} if robot.ros_ends else {}),
    }


def _target(robot: RobotUnderTest) -> dict[str, Any]:
    where = robot.run.statement.endpoints
    target: dict[str, Any] = {"rest": where.rest}
    for name, wsdl in ((Interface.PUBLISHERS, where.publishers_wsdl), (Interface.SUBSCRIBERS, where.subscribers_wsdl)):
        service = robot.soap.there.get(name)
        target[f"{name}_wsdl"] = wsdl and without_folders(wsdl)
        target[f"{name}_endpoint"] = service.client.base_url + service.path if service else None
    return {**target, "ros_domain_id": robot.run.statement.domain_id}


def _requirement(verdict: Verdict) -> dict[str, Any]:
    requirement = verdict.requirement
    shown = verdict.value not in {"not-claimed", "skip"}
    expected = verdict.expected_failure
    return {
        "id": requirement.id,
        "class": requirement.class_,
        **({"also": list(requirement.also)} if requirement.also else {}),
        **({"aliases": list(requirement.aliases)} if requirement.aliases else {}),
        "topic": requirement.topic,
        **({"breaks": requirement.breaks} if requirement.breaks else {}),
        "level": requirement.level,
        "source": requirement.source,
        "origin": requirement.origin,
        "text": requirement.text,
        "verdict": verdict.value,
        "cases": verdict.evidence.cases,
        **({"occasions": occasions} if (occasions := dict(verdict.evidence.occasions.most_common())) else {}),
        "reason": verdict.reason,
        "untestable": requirement.untestable,
        "checks": sorted(verdict.evidence.checks - {""}),
        **_advice(verdict),
        "failures": [_failure(finding) for finding in verdict.evidence.findings.values()] if shown else [],
        **({} if verdict.because is None else {"because_of": verdict.because.number}),
        **({} if verdict.scored else {"scored": False}),
        **({"expected_failure": {"reason": expected[0], "expires": expected[1]}} if expected else {}),
    }


def _advice(verdict: Verdict) -> dict[str, str]:
    """Return why a requirement that is not met matters and how to meet it; empty if it is met or nothing is known."""
    topic = topic_of(verdict.requirement.id) if verdict.value in {Value.FAIL, Value.WARN} else None
    return {"why": topic.why, "fix": topic.fix} if topic else {}


def _cause(cause: Cause) -> dict[str, Any]:
    finding = cause.finding
    return {
        "number": finding.number,
        "kind": finding.cause,
        "requirement": finding.requirement,
        "text": finding.text,
        "blocks": list(cause.blocks),
    }


def _failure(finding: Finding) -> dict[str, Any]:
    return {
        "number": finding.number,
        "message": finding.text,
        "subject": finding.subject,
        "expected": finding.expected,
        "observed": finding.observed,
        "cause": finding.cause,
        **({"doubt": finding.doubt} if finding.doubt else {}),
        "seen": finding.seen,
        **({"operations": _operations(finding)} if finding.operations else {}),
        "request": _request(finding.exchange) if finding.exchange else None,
        "response": _response(finding.exchange) if finding.exchange else None,
        **({"again": {"came_back": finding.again.came_back, "sent": finding.again.sent}} if finding.again else {}),
        "sequence": as_json(finding.sequence),
    }


def _operations(finding: Finding) -> list[dict[str, Any]]:
    """Return all operations that show a finding; the first ones with a command that shows it for each."""
    found = []
    for place, one in enumerate(finding.operations.values()):
        curl = one.request.curl() if one.request and place < _COMMANDS else ""
        command = {"curl": curl} if curl and len(curl) <= _SHORT_CURL else {}
        found.append({"operation": one.operation, "seen": one.seen, **command})
    return found


def _request(exchange: Attempt) -> dict[str, Any]:
    request = exchange.request
    curl = request.curl()
    if len(curl) > _SHOWN_CURL:
        curl = f"# as a command the request has {len(curl)} characters: roaas replay sends it"
    shown = {"method": request.method, "url": request.url, "headers": _headers(request.headers), "curl": curl}
    return {**shown, **_body(request.raw if request.raw is not None else request.body)}


def _response(exchange: Attempt) -> dict[str, Any]:
    if isinstance(exchange, Unanswered):
        return {"status": None, "headers": {}, "body": None, "elapsed_ms": None, "error": exchange.problem}
    response = exchange.response
    return {
        "status": response.status,
        "headers": _headers(response.headers),
        "elapsed_ms": round(response.elapsed_ms, 3),
        **_body(response.body),
    }


def _headers(pairs: tuple[tuple[str, str], ...]) -> dict[str, str | list[str]]:
    headers: dict[str, str | list[str]] = {}
    for name, value in pairs:
        before = headers.get(name)
        headers[name] = value if before is None else [*([before] if isinstance(before, str) else before), value]
    return headers


def _body(body: bytes) -> dict[str, Any]:
    if not body:
        return {"body": None}
    shown = body[:_SHOWN_BODY].decode("utf-8", "replace")
    return {"body": shown} if len(body) <= _SHOWN_BODY else {"body": shown, "body_length": len(body)}


def rfc3339(moment: dt.datetime) -> str:
    """Return a time in UTC with microseconds (RFC 3339 5.6)."""
    return moment.strftime("%Y-%m-%dT%H:%M:%S.%fZ")


def write_result(document: dict[str, Any], directory: Path) -> Path:
    """Write result.json atomically; return its path.

    Raises:
        OSError: the file cannot be written.
    """
    directory.mkdir(parents=True, exist_ok=True)
    return write_json(directory / RESULT_NAME, document, indent=1, ensure_ascii=False)
