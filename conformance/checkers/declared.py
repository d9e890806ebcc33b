"""Whether the description declares a response for its operation: status, media type, schema, Vary."""

from collections import defaultdict
from collections.abc import Iterator
from functools import lru_cache
from http import HTTPStatus
from typing import Any

from conformance.api.rest.formats import are_data, quality
from conformance.api.rest.statuses import CRASHES, is_cut_off
from conformance.api.rest.validity import INVALID, VALID
from conformance.checkers.occasion import METHODS, Occasion
from conformance.documents.json_schema import Schema
from conformance.documents.json_shape import Shape, shape_of
from conformance.documents.json_text import read_json
from conformance.documents.openapi import Operation, is_json, is_xml, resource_at
from conformance.documents.patterns import PatternError
from conformance.documents.representation import UnreadableError, flat, read
from conformance.verdict.evidence import Case
from conformance.verdict.finding import Showing, likeness

# Statuses that any request may get by RFC 9110 and RFC 6585: authentication and rate limit. 5xx is judged elsewhere.
_ANY_REQUEST = frozenset({401, 429})
# Statuses that a request with more than method, path and Accept may get.
_ODD_REQUEST = frozenset({400, 408, 411, 413, 414, 415, 417, 431})
# Bodies larger than this are not kept for comparison, octets.
_LARGE = 1 << 14
_JUDGED = 40  # responses of an operation that are searched for writeOnly members
_ITEMS = 20  # items of a list that are searched
_DEEPEST = 5  # levels of a body that are searched
# A body that begins so is nested more deeply than the parsers of many frameworks go.
_NESTED = b"[" * 1000
_OK, _NO_CONTENT, _ERROR, _NOT_FOUND, _NO_METHOD, _NOT_ACCEPTABLE, _SERVER_ERROR = 200, 204, 400, 404, 405, 406, 500


def crash(occasion: Occasion) -> Iterator[Case]:
    """Judge that the device does not fail, whatever a request to a path of the description contains (CWE-248)."""
    operation, request, has_crashed = occasion.operation, occasion.request, occasion.response.status in CRASHES
    label = operation.label if operation is not None else ""
    if has_crashed and operation is None and request.method in METHODS:
        resource = resource_at(occasion.contract, occasion.context.target.partition("?")[0])
        label = next(iter(resource.operations.values())).label if resource is not None else ""
    if label:
        yield Case(
            holds=not has_crashed,
            exchange=occasion.exchange,
            expected="a status below 500",
            cause=likeness(occasion.exchange) if has_crashed else "",
            subject=label,
            operations=(Showing(label, 1, request),) if has_crashed else (),
            requirement="robustness/no-server-error",
            doubt="frameworks whose JSON parser gives up so are widely used"
            if request.body.startswith(_NESTED)
            else "",
        )


def server_error(occasion: Occasion) -> Iterator[Case]:
    """Judge a 5xx response: it is wrong for an invalid request, and undeclared for a valid one."""
    status = occasion.response.status
    if occasion.operation is None or status < _ERROR or not occasion.context.usual or is_cut_off(occasion.exchange):
        return
    said, crashed, retry = occasion.validity, status >= _SERVER_ERROR, ""
    if status == HTTPStatus.SERVICE_UNAVAILABLE:
        crashed, retry = occasion.response.header("retry-after") is None, " without Retry-After"
    operation = said.operation.id if said.operation else occasion.request.method
    for verdict, id_, expected in (
        (INVALID, "http/no-server-error", f"a status below 500 for invalid input ({said.why})"),
        (VALID, "http/declared-status", f"a status that the contract declares for {operation}"),
    ):
        if said.verdict == verdict and (crashed or verdict == INVALID):
            yield occasion.case(id_, not crashed, expected, f"status {status}{retry}", cause=f"{status} {operation}")


def status(occasion: Occasion) -> Iterator[Case]:
    """Judge the status of a response below 500."""
    operation = occasion.operation
    if operation is not None and occasion.response.status < _SERVER_ERROR:
        yield occasion.case(
            "http/declared-status",
            _status_fits(occasion, operation),
            f"a status that the contract declares for {operation.id}: {', '.join(operation.responses)}",
            f"status {occasion.response.status}",
            cause=f"{operation.id} {occasion.response.status}",
        )


def _status_fits(occasion: Occasion, operation: Operation) -> bool:
    status, context = occasion.response.status, occasion.context
    if status in _ANY_REQUEST or operation.schemas_for(status) is not None:
        return True
    if status == _OK and operation.schemas_for(_NO_CONTENT) is not None:
        return True  # a robot may send 200 instead of 204
    if status == _NOT_ACCEPTABLE:
        return context.accept not in {None, "*/*"}
    if context.plain and not operation.parameters:
        return False
    if status in _ODD_REQUEST:
        return True
    # A device may refuse invalid input with any 4xx (contract, fine print), with 404 only if a value is in the path.
    has_input = bool(occasion.request.body or operation.parameters or operation.bodies)
    elsewhere = status == _NO_METHOD or (status == _NOT_FOUND and not operation.parameter("path"))
    refused = has_input and _ERROR <= status < _SERVER_ERROR and not elsewhere
    return refused and not (status != _NOT_FOUND and context.usual and occasion.is_valid)


def body(occasion: Occasion) -> Iterator[Case]:
    """Judge the body of a success by the schema of its operation."""
    operation, answer = occasion.operation, occasion.response
    content = operation.schemas_for(answer.status) if operation and answer.ok and not occasion.context.is_head else None
    if operation is None or not content:
        return
    media_type = answer.media_type
    if not answer.body:
        # Only a GET must return content: the response to a PUT need not repeat the request body.
        if operation.method == "GET" and answer.status != _NO_CONTENT:
            yield occasion.case("http/declared-body", False, f"a body as {' or '.join(content)}", "no body")  # noqa: FBT003
        elif media_type in content and answer.status != _NO_CONTENT:
            # The response says that it contains a document, and clients will read it.
            yield from _shape(occasion, operation, content[media_type])
        return
    yield occasion.case(
        "http/declared-body",
        media_type in content,
        f"a body as {' or '.join(content)}",
        f"a body as {media_type}" if media_type else "a body without Content-Type",
        cause=f"{operation.id} {media_type}",
    )
    if media_type in content:
        yield from _shape(occasion, operation, content[media_type])


def _shape(occasion: Occasion, operation: Operation, schema: Schema) -> Iterator[Case]:
    media_type = occasion.response.media_type
    if is_json(media_type):
        id_, kind = "http/declared-body", "JSON"
    elif is_xml(media_type):
        id_, kind = "rest-formats/xml", "XML"
    elif media_type == "text/plain" and operation.shape is not None:
        id_, kind, schema = "rest-formats/text", "YAML", operation.shape
    else:
        return
    body = occasion.response.body
    judge = _fault if len(body) < _LARGE else _fault.__wrapped__
    try:
        fault = judge(shape_of(schema), media_type, body)
    except PatternError:
        return  # another requirement says that the schema cannot be used
    cause = f"{operation.id} {kind} {fault.split(':', 1)[0]}"
    yield occasion.case(id_, not fault, f"{kind} that is valid by the schema of {operation.id}", fault, cause=cause)


@lru_cache(maxsize=256)
def _fault(shape: Shape, media_type: str, body: bytes) -> str:
    """Return the fault of a body, or an empty text. Results are cached, because most responses repeat."""
    try:
        problem = shape.problem(read(media_type, body, shape.schema))
    except UnreadableError as error:
        return str(error)
    return f"a body in which {problem}" if problem else ""


class WriteOnly:
    """Judges whether a response contains members that the description marks as writeOnly (OpenAPI 3.0, 4.7.24.2)."""

    def __init__(self) -> None:
        self._seen: dict[str, int] = defaultdict(int)

    def __call__(self, occasion: Occasion) -> Iterator[Case]:
        """Yield the cases of one exchange; the first ones of each operation are judged."""
        operation, answer = occasion.operation, occasion.response
        content = operation.schemas_for(answer.status) if operation and answer.ok and answer.body else None
        if operation is None or not content or not is_json(answer.media_type) or answer.media_type not in content:
            return
        self._seen[operation.id] += 1
        if self._seen[operation.id] > _JUDGED or len(answer.body) > _LARGE:
            return
        name = _shown_of(content[answer.media_type], read_json(answer.body).value)
        if name is not None:
            expected, cause = "a response without what is writeOnly", f"{operation.id} {name}"
            found, doubt = f"{name} in the response", "OpenAPI does not forbid it"
            yield occasion.case("description/read-only", not name, expected, found, cause=cause, doubt=doubt)


def _shown_of(schema: Schema, value: Any, depth: int = 0) -> str | None:
    """Return the writeOnly member that a response shows; empty if it shows none; None if the schema has none."""
    given = flat(schema)
    if isinstance(value, list):
        inner = given.get("items")
        found = [_shown_of(inner, item, depth + 1) for item in value[:_ITEMS]] if isinstance(inner, dict) else []
    elif isinstance(value, dict) and depth < _DEEPEST:
        found = []
        for name, part in given.get("properties", {}).items():
            if not isinstance(part, dict):
                continue
            if flat(part).get("writeOnly"):
                # A mask such as **** shows nothing.
                is_shown = value.get(name) is not None and bool(str(value[name]).strip("*x\u2022"))
                found.append(name if is_shown else "")
            elif name in value:
                found.append(_shown_of(part, value[name], depth + 1))
    else:
        return None
    told = [text for text in found if text is not None]
    return max(told) if told else None


class Negotiation:
    """Judges the format of a successful read by Accept, and Vary where the device chooses among several formats."""

    def __init__(self) -> None:
        self._sent: dict[str, set[str]] = defaultdict(set)

    def __call__(self, occasion: Occasion) -> Iterator[Case]:
        """Yield the cases of one exchange."""
        operation, answer, context = occasion.operation, occasion.response, occasion.context
        if operation is None or operation.method != "GET" or not answer.ok or not operation.formats:
            return
        if answer.media_type and context.usual:
            # A format excluded by q=0 breaks another rule than a format that Accept does not mention.
            ruled_out = "q=0" in (context.accept or "").lower().replace(" ", "")
            yield occasion.case(
                "http/q-zero" if ruled_out else "http/not-acceptable",
                quality(answer.media_type, context.accept) > 0,
                f"an acceptable format or status 406 when Accept is {context.accept}",
                f"status {answer.status} with {answer.media_type}",
                cause="not acceptable",
            )
        if len(operation.formats) == 1 or context.is_head:
            return
        # An operation may have other formats for other values, and a description may name a format that is never sent.
        sent = self._sent[context.target]
        sent.add(answer.media_type)
        if len(sent) > 1 or are_data(operation.formats):
            vary = (answer.header("vary") or "").lower()
            names_accept = "*" in vary or "accept" in [name.strip() for name in vary.split(",")]
            found = f"Vary: {answer.header('vary')}" if vary else "no header field Vary"
            yield occasion.case("rest-formats/vary", names_accept, "Vary: Accept", found)
