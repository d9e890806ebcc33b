"""Responses against the description: status, media type, body and headers (OpenAPI 3.1, 4.8.16 to 4.8.21)."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from typing import Any

from conformance.api.rest.statuses import ANY_TIME, CRASHES
from conformance.api.rest.validity import INVALID
from conformance.api.rest.variations import Kind
from conformance.documents.json_schema import Schema, kinds_of
from conformance.documents.json_shape import shape_of, wrong_formats
from conformance.documents.json_text import clip, read_json
from conformance.documents.openapi import Operation, is_json, operations_of
from conformance.documents.parameter_reading import parts_of
from conformance.documents.patterns import SlowPatternError
from conformance.rules.told_once import Fault, held_back, told_once, without_numbers
from conformance.scenarios.anonymous import anonymous_requests
from conformance.scenarios.generated import generated_requests
from conformance.scenarios.held import held_operations
from conformance.scenarios.neighbours import neighbours
from conformance.scenarios.other_exchanges import others
from conformance.scenarios.own_things import own_things
from conformance.scenarios.rule import NotSeen, Outcome, rule
from conformance.scenarios.survey import Probe, Survey, survey
from conformance.transport.exchange import Exchange, Response
from conformance.verdict.evidence import Case
from conformance.verdict.run import Run

# Statuses without content (RFC 9110 15.3.5, 15.3.6, 15.4.5).
_BODILESS = frozenset({204, 205, 304})
_ON = (survey, held_operations, generated_requests, neighbours, own_things, others)
# Statuses that any server may send unless the request was the operation's usual one.
_OF_REQUEST = frozenset({405, 406, 415, 501})
# Those of these statuses that the application sends, in the media type that it declares for them.
_OF_APPLICATION = frozenset({412, 415, 428})
# Statuses by which a device says that it does not know what a request refers to.
_NO_SUCH_THING = frozenset({400, 404, 409, 422})
_ASKED_FOR = frozenset({206, 304})  # statuses that only requests with one of the headers _ASKING get (RFC 9110 13, 14)
_ASKING = frozenset({"range", "if-range", "if-match", "if-none-match", "if-modified-since", "if-unmodified-since"})
_BAD_REQUEST, _FORBIDDEN, _NOT_FOUND = 400, 403, 404
# Statuses with which frameworks refuse input, and statuses for a thing that does not exist.
_OF_INPUT, _ABSENT = frozenset({400, 422}), frozenset({404, 410})
_PLAIN = frozenset({Kind.USUAL, Kind.AGAIN, Kind.EXAMPLE, Kind.DEFAULT, Kind.ENUM, Kind.OPTIONAL})


def _judgeable(trace: Survey, run: Run) -> Iterator[tuple[Probe, Operation, Response]]:
    """Yield the probes whose responses the description speaks of."""
    by_label = {item.label: item for item in operations_of(run.contract)}
    for probe in trace.probes:
        operation = by_label.get(probe.operation)
        if probe.exchange is None or operation is None or probe.exchange.request.method != operation.method:
            continue
        answer = probe.exchange.response
        if operation.responses and probe.kind is not Kind.ANONYMOUS and not _by_server(probe, answer, operation):
            yield probe, operation, answer


def _by_server(probe: Probe, answer: Response, operation: Operation) -> bool:
    """Return whether a web server may have refused a request before the application saw it: strange, or too many.

    A router that reads path parameters by their types, as those of Flask and ASP.NET do, finds none for a wrong value.
    """
    strange = probe.kind in {Kind.ODD, Kind.GENERATED, Kind.OTHER}
    is_routed = answer.status == _NOT_FOUND and operation.parameter("path") and (strange or probe.kind is Kind.INVALID)
    refuses = (strange and answer.status in {_BAD_REQUEST, _FORBIDDEN}) or is_routed
    refuses = refuses and not is_json(answer.media_type)
    return bool(refuses) or (answer.put_off_s is not None and str(answer.status) not in operation.responses)


def _in_question(probe: Probe, status: int) -> bool:
    """Return whether the description has to declare a status, because the application decided it.

    HTTP has no part and no 304 that nobody asked for. A router may not find an odd path by itself.
    """
    if status in _ASKED_FOR:
        names = {name.lower() for name, _ in probe.exchange.request.headers} if probe.exchange else _ASKING
        return not names & _ASKING
    if status == _NOT_FOUND and probe.kind is Kind.ODD and probe.place.startswith("path "):
        return False
    if probe.invents and status in _NO_SUCH_THING:
        return False
    if status == _BAD_REQUEST and (probe.kind is Kind.MALFORMED or _is_unreadable(probe)):
        return False  # any server may answer 400 to content that it cannot read (RFC 9110 15.5.1)
    return status not in ANY_TIME and (probe.kind in _PLAIN or status not in _OF_REQUEST)


def _is_unreadable(probe: Probe) -> bool:
    """Return whether a request's content is no JSON or form, although its Content-Type says so."""
    request = probe.exchange.request if probe.exchange else None
    if request is not None and request.media_type == "multipart/form-data":
        content_type = next(value for name, value in request.headers if name.lower() == "content-type")
        return parts_of(request.body, content_type) is None
    if request is None or not is_json(request.media_type):
        return False
    return bool(request.body and read_json(request.body).unreadable)


def _successes_unseen(trace: Survey, run: Run, declares: Callable[[Operation, str], object]) -> Iterator[NotSeen]:
    """Yield operations whose success the device's state prevented, if only a success can be judged."""
    held = [
        operation.label
        for operation in operations_of(run.contract)
        if any(key.startswith("2") and declares(operation, key) for key in operation.responses)
        and trace.is_held(operation.label)
    ]
    yield from held_back(probe for label in held for probe in trace.of(label, Kind.USUAL) if not probe.invents)


@rule("description/status-declared", on=_ON)
def status_declared(trace: Survey, run: Run) -> Iterable[Outcome]:
    """Judge whether each status is declared for its operation; a crash is another requirement's affair."""
    yield from _declared(trace, run, _is_no_refusal)


@rule("description/errors-declared", on=_ON)
def errors_declared(trace: Survey, run: Run) -> Iterable[Outcome]:
    """Judge whether the statuses are declared that refuse wrong input, or name a thing that is not there."""
    yield from _declared(trace, run, lambda *given: not _is_no_refusal(*given))


def _is_no_refusal(probe: Probe, operation: Operation, status: int) -> bool:
    """Return whether a status is another one than those by which frameworks refuse input without saying so."""
    may_be_absent = probe.kind not in _PLAIN or any(operation.parameter("path"))
    return status not in _OF_INPUT and not (status in _ABSENT and may_be_absent)


def _declared(trace: Survey, run: Run, asked: Callable[[Probe, Operation, int], bool]) -> Iterator[Outcome]:
    lacking = {item.label for item in operations_of(run.contract) if trace.lacks(item)}
    judged = {
        id(probe): (operation, answer)
        for probe, operation, answer in _judgeable(trace, run)
        if _in_question(probe, answer.status) and answer.status not in CRASHES and probe.operation not in lacking
        if asked(probe, operation, answer.status)
    }

    def fault(probe: Probe) -> Fault | None:
        operation, answer = judged[id(probe)]
        if operation.response_key(answer.status) is not None:
            return None
        return Fault(
            str(answer.status),
            f"status {answer.status}",
            f"a status that is declared: {', '.join(operation.responses)}",
        )

    yield from told_once((one for one in trace.probes if id(one) in judged), "a declared status", fault)


@rule("description/media-type", on=_ON)
def media_type(trace: Survey, run: Run) -> Iterable[Outcome]:
    """Judge whether each body has a media type that is declared for its status."""
    judged: dict[int, tuple[dict[str, Schema], Response]] = {}
    for probe, operation, answer in _judgeable(trace, run):
        content = operation.schemas_for(answer.status)
        is_in_question = _in_question(probe, answer.status) or (
            answer.status in _OF_APPLICATION and str(answer.status) in operation.responses
        )
        if content and answer.body and answer.status not in CRASHES and is_in_question:
            judged[id(probe)] = content, answer

    def fault(probe: Probe) -> Fault | None:
        content, answer = judged[id(probe)]
        if any(_matches(name, answer.media_type) for name in content):
            return None
        found = f"status {answer.status} with {answer.media_type or 'no Content-Type'}"
        return Fault(f"{answer.status} {answer.media_type}", found, f"a body as {' or '.join(content)}")

    yield from _successes_unseen(trace, run, lambda operation, key: operation.responses[key])
    yield from told_once((one for one in trace.probes if id(one) in judged), "a declared media type", fault)


def _matches(declared: str, given: str) -> bool:
    """Return whether a media type fits a declared media type or range (OpenAPI 3.1, 4.8.14)."""
    if declared in {given, "*/*"} or (declared.endswith("/*") and given.startswith(declared[:-1])):
        return True
    return declared == "application/json" and not given.startswith("text/") and given.endswith("+json")


@rule("description/body-schema", on=_ON)
def body_schema(trace: Survey, run: Run) -> Iterable[Outcome]:
    """Judge whether each JSON body is valid by the schema that is declared for its status, errors included."""
    judged = {
        id(probe): (answer.status, wrong)
        for probe, (_, answer), wrong in _with_fault(trace, run)
        if not (wrong and _is_echo(probe))
    }

    def fault(probe: Probe) -> Fault | None:
        status, wrong = judged[id(probe)]
        return Fault(f"{status} {without_numbers(wrong)}", f"status {status} with {wrong}") if wrong else None

    yield from _successes_unseen(trace, run, lambda operation, key: any(map(is_json, operation.responses[key])))
    yield from told_once(
        (one for one in trace.probes if id(one) in judged), "JSON that is valid by the declared schema", fault
    )


def _is_echo(probe: Probe) -> bool:
    """Return whether the device accepted a wrong body, which its response repeats: invalid_refused tells that."""
    is_wrong = probe.kind is Kind.INVALID or (probe.kind is Kind.GENERATED and probe.validity == INVALID)
    return probe.ok and is_wrong and probe.attempt.request.body != b""


@rule("description/formats", on=_ON)
def formats(trace: Survey, run: Run) -> Iterable[Outcome]:
    """Judge whether values in responses have the ``format`` that the schema names (date-time, int32, ...)."""
    judged = {
        id(probe): found for probe, found, wrong in _with_fault(trace, run) if "'format'" in str(found[0]) and not wrong
    }

    def fault(probe: Probe) -> Fault | None:
        schema, answer = judged[id(probe)]
        found = wrong_formats(schema, read_json(answer.body).value)
        told = "; ".join(f"{clip(value)} at /{place}, which is no {wanted}" for value, place, wanted in found)
        return Fault(" ".join(sorted({wanted for _, _, wanted in found})), told) if found else None

    yield from _successes_unseen(trace, run, lambda operation, key: "'format'" in str(operation.responses[key]))
    yield from told_once((one for one in trace.probes if id(one) in judged), "values of the declared format", fault)


def _with_schema(trace: Survey, run: Run) -> Iterator[tuple[Probe, tuple[Schema, Response]]]:
    """Yield the probes with a JSON response for which a usable schema is declared."""
    for probe, operation, answer in _judgeable(trace, run):
        content = operation.schemas_for(answer.status) or {}
        names = [name for name in content if _matches(name, answer.media_type) and is_json(answer.media_type)]
        whole = not answer.cut and (answer.body or operation.method != "HEAD")
        if names and whole and answer.status not in _BODILESS and _usable(content[names[0]]):
            yield probe, (content[names[0]], answer)


def _with_fault(trace: Survey, run: Run) -> Iterator[tuple[Probe, tuple[Schema, Response], str]]:
    """Yield each probe with its declared schema and the response's fault, or an empty text."""
    for probe, (schema, answer) in _with_schema(trace, run):
        try:
            yield probe, (schema, answer), _wrong(schema, answer)
        except SlowPatternError as error:
            run.judge.fault(probe.operation, error, ("description/body-schema",))


def _usable(schema: Schema) -> bool:
    try:
        shape_of(schema)
    except ValueError:
        return False  # the requirement description/file-valid judges the schema itself
    return True


def _wrong(schema: Schema, answer: Response) -> str:
    if not answer.body:
        return "an empty body, where JSON is declared"
    text = read_json(answer.body)
    if text.malformed:
        return f"a body that is not JSON: {text.problem}"
    problem = shape_of(schema).problem(text.value)
    return f"a body in which {problem}" if problem else ""


@rule("description/headers", on=_ON)
def headers(trace: Survey, run: Run) -> Iterable[Outcome]:
    """Judge whether each response has the headers that are declared as required, with valid values."""
    judged: dict[int, tuple[dict[str, tuple[bool, Schema]], Response]] = {}
    for probe, operation, answer in _judgeable(trace, run):
        key = operation.response_key(answer.status)
        if key is not None and operation.headers.get(key) and answer.status not in CRASHES:
            judged[id(probe)] = operation.headers[key], answer

    def fault(probe: Probe) -> Fault | None:
        declared, answer = judged[id(probe)]
        for name, (required, schema) in declared.items():
            value = answer.header(name)
            if value is None:
                if required:
                    return Fault(name, f"status {answer.status} without the header {name}")
            elif wrong := _wrong_header(schema, value):
                return Fault(f"{name} {wrong}", f"{name}: {value[:80]}, in which {wrong}")
        return None

    yield from _successes_unseen(trace, run, lambda operation, key: operation.headers.get(key))
    yield from told_once((one for one in trace.probes if id(one) in judged), "the declared headers", fault)


def _wrong_header(schema: Schema, value: str) -> str:
    """Return why a header's text cannot be read as a valid value."""
    kinds = kinds_of(schema)
    if not _usable(schema) or kinds & {"object", "array"}:
        return ""
    readings: list[Any] = [value] if not kinds or "string" in kinds else []
    if kinds & {"integer", "number"} and re.fullmatch(r"[+-]?\d+(?:\.\d+)?(?:[eE][+-]?\d+)?", value.strip()):
        readings.append(float(value) if "." in value or "e" in value.lower() else int(value))
    if "boolean" in kinds and value.strip().lower() in {"true", "false"}:
        readings.append(value.strip().lower() == "true")
    if not readings:
        return f"the value is no {' or '.join(sorted(kinds))}"
    problems = [shape_of(schema).problem(reading) for reading in readings]
    return "" if "" in problems else problems[0]


@rule("description/security", on=(anonymous_requests,))
def security(trace: tuple[Exchange, ...]) -> Iterable[Outcome]:
    """Judge whether operations that need credentials refuse requests without them, or with wrong ones."""
    for exchange in trace:
        expected = "a refusal, because the description requires credentials"
        yield Case(not exchange.response.ok, exchange, expected, cause="served")
