"""Mutants that break what one exchange promises for the next: keys, conditions, refusals, safe methods, files."""

import json
import math
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any
from uuid import uuid4

from conformance.api.rest.patches import JSON_PATCH
from conformance.documents.json_schema import kinds_of
from conformance.documents.openapi import Operation, is_json
from conformance.documents.representation import flat
from conformance.scenarios.keys import UNSPENT
from conformance.scenarios.reaching import key_of
from proof.mutation.messages import Change, Forward, Request, Response
from proof.selftest.generated.mutant import GeneratedMutant, Tally
from proof.selftest.generated.places import Exchange

_SUCCESS, _REFUSED = range(200, 300), range(400, 500)
_NOT_ACCEPTABLE, _FAILED, _UNSUPPORTED, _REQUIRED, _PART, _CURRENT = 406, 412, 415, 428, 206, 304
_WRITING = frozenset({"PUT", "PATCH", "DELETE"})
_OCTETS, _CSV, _KEY = "application/octet-stream", "text/csv", "Idempotency-Key"
_TRIED = 3  # resources that are tried
_DECIMALS = 2  # decimals that the mutant keeps


@dataclass
class _Past:
    """A mutant's memory of earlier exchanges.

    Attributes:
        tags: the entity tags that each path has had.
        writes: the first and the last request that wrote, by path.
        keyed: the first request and response of each idempotency key.
    """

    tags: dict[str, list[str]] = field(default_factory=dict)
    writes: dict[str, list[Request]] = field(default_factory=dict)
    keyed: dict[str, tuple[Request, Response]] = field(default_factory=dict)


# Function by which a mutant handles a request. Returns the client's response, and whether it was altered.
_Act = Callable[[Request, Forward, _Past], tuple[Response, bool]]


def of_promises(operation: Operation, exchange: Exchange) -> Iterator[GeneratedMutant]:
    """Yield mutants of an operation that break a promise of an earlier exchange."""
    for name, says, act in _rows(operation):
        yield GeneratedMutant.of(name, exchange, "promise", f"{exchange.name} {says}.", _changing(exchange, act))


_Row = tuple[str, str, _Act]


def _rows(operation: Operation) -> Iterator[_Row]:
    declared = operation.responses
    if operation.method == "GET":
        yield from _of_reads(operation)
    if operation.method == "POST" and key_of(operation) is not None:
        yield "key-again", "performs a request again that has a known key", _again
        yield "key-any-body", "takes a known key with any body", _any_body
        yield "key-old", "answers a new key as the first one", _old_key
        if UNSPENT.search(operation.text):
            yield "key-spent", "refuses a key that came with a refused request", _spent_key
    if operation.method in _WRITING:
        yield from _of_conditions(operation)
    if operation.method in {"PUT", "PATCH", "POST"}:
        if str(_NOT_ACCEPTABLE) in declared:
            yield "applies-406", "performs what it refuses with 406", _resent(_NOT_ACCEPTABLE, "Accept", "*/*")
        if str(_UNSUPPORTED) in declared and operation.bodies:
            yield (
                "type-any",
                "takes its content by any media type",
                _resent(_UNSUPPORTED, "Content-Type", next(iter(operation.bodies)), is_told=True),
            )
        yield from _of_values(operation)


def _of_reads(operation: Operation) -> Iterator[_Row]:
    yield "read-acts", "writes what was there before (RFC 9110 9.2.1)", _reverting("GET")
    yield "head-acts", "writes by HEAD what was there before (RFC 9110 9.2.1)", _reverting("HEAD")
    if str(_CURRENT) in operation.responses:
        yield "stale-304", "answers 304 for each tag that it ever sent (RFC 9110 13.1.2)", _stale_copy
    if str(_PART) in operation.responses:
        yield "part-shifted", "sends a part that begins one later (RFC 9110 15.3.7.1)", _edit_reads(_shift, _PART)
        yield "part-total", "tells another length of the whole (RFC 9110 14.4)", _edit_reads(_other_total, _PART)
        yield "range-stale", "ignores If-Range (RFC 9110 13.1.5)", _without("If-Range")
    yield "digest", "sends the digest of something else (RFC 9530)", _edit_reads(_other_digest)
    if _CSV in operation.formats:
        yield "row-lost", "leaves out the last row of a table", _edit_reads(_fewer_rows)
        yield "row-quotes", "sends quotes in quoted values as they are (RFC 4180 2)", _edit_reads(_single_quotes)
    if kinds_of(operation.shape or {}) == {"array"}:
        yield "list-other", "shows other numbers in lists than in their items", _edit_reads(_other_numbers)


def _of_conditions(operation: Operation) -> Iterator[_Row]:
    if str(_REQUIRED) in operation.responses:
        yield "match-missing", "does without If-Match (RFC 6585 3)", _knowing(_REQUIRED, is_told=True)
        yield "applies-428", "performs what it refuses with 428", _knowing(_REQUIRED)
    if str(_FAILED) in operation.responses:
        yield "match-first", "looks at the first tag of If-Match alone (RFC 9110 13.1.1)", _first_tag
        yield "match-stale", "takes each tag that it ever sent (RFC 9110 13.1.1)", _stale_tag
        yield "applies-412", "performs what it refuses with 412", _knowing(_FAILED)
    if any(parameter.name.lower() == "if-none-match" for parameter in operation.parameter("header")):
        yield "none-ignored", "ignores If-None-Match (RFC 9110 13.1.2)", _without("If-None-Match")


def _of_values(operation: Operation) -> Iterator[_Row]:
    if next(iter(operation.bodies), "") == _OCTETS:
        yield "file-tail", "keeps the end of the file before, where that is longer", _longer
        yield "file-cut", "keeps files without their last byte", _edit_body(lambda body: body[:-1])
    media_type = next(filter(is_json, operation.bodies), "")
    parts = flat(operation.bodies[media_type].schema).get("properties", {}) if media_type else {}
    formats = {name: flat(one).get("format") for name, one in parts.items() if isinstance(one, dict)}
    doubles = {name for name, one in formats.items() if one == "double"}
    times = {name for name, one in formats.items() if one == "date-time"}
    if JSON_PATCH in next(iter(operation.bodies), ""):
        yield (
            "patch-copies",
            "copies what a JSON patch moves (RFC 6902 4.4)",
            _edit_body(lambda body: _steps(body, "copy")),
        )
        yield "patch-untested", "ignores the tests of a JSON patch (RFC 6902 4.6)", _edit_body(_steps)
    if doubles:
        yield "digits", "keeps two decimals of doubles", _edit_body(lambda body: _members(body, doubles, _round))
    if times:
        yield "offset", "takes each time as UTC", _edit_body(lambda body: _members(body, times, _as_utc))


def _changing(exchange: Exchange, act: _Act) -> Callable[[Tally], Change]:
    """Return a change that acts on an operation's requests, knowing earlier exchanges."""

    def make(tally: Tally) -> Change:
        past = _Past()

        def change(request: Request, forward: Forward) -> Response:
            own = request.side == "rest" and re.fullmatch(exchange.path, request.path) is not None
            is_concerned = own and request.method in {exchange.method, "HEAD" if exchange.method == "GET" else ""}
            response, altered = act(request, forward, past) if is_concerned else (forward(request), False)
            if altered:
                tally()
            if request.side == "rest" and response.status in _SUCCESS:
                tag = response.field("ETag")
                if request.method == "GET" and tag and tag not in past.tags.setdefault(request.path, []):
                    past.tags[request.path].append(tag)
                if request.method == "PUT" and is_json(request.media_type):
                    past.writes[request.path] = [*past.writes.pop(request.path, [])[:1], request]
            return response

        return change

    return make


def _edit_reads(edit: Callable[[Response], object], *statuses: int) -> _Act:
    """Return an act that alters responses to GET; those that it cannot alter it leaves."""

    def act(request: Request, forward: Forward, _: _Past) -> tuple[Response, bool]:
        response = forward(request)
        if request.method != "GET" or response.status not in (statuses or _SUCCESS):
            return response, False
        altered = response.copy()
        edit(altered)
        return altered, (altered.body, altered.fields) != (response.body, response.fields)

    return act


def _edit_body(edit: Callable[[bytes], bytes]) -> _Act:
    """Return an act that alters the body of a request."""

    def act(request: Request, forward: Forward, _: _Past) -> tuple[Response, bool]:
        altered = request.copy(body=edit(request.body))
        if altered.field("Content-Length") is not None:
            altered.put("Content-Length", str(len(altered.body)))
        response = forward(altered)
        return response, altered.body != request.body and response.status in _SUCCESS

    return act


def _without(name: str) -> _Act:
    """Return an act that takes a header field out of requests."""

    def act(request: Request, forward: Forward, _: _Past) -> tuple[Response, bool]:
        altered, has_it = request.copy(), request.field(name) is not None
        altered.drop(name)
        response = forward(altered)
        return response, has_it and response.status in _SUCCESS

    return act


def _reverting(method: str) -> _Act:
    """Return an act that restores a resource's first value."""

    def act(request: Request, forward: Forward, past: _Past) -> tuple[Response, bool]:
        response = forward(request)
        twice = [one for path, one in past.writes.items() if len(one) > 1 and path != request.path]
        if request.method != method or not twice:
            return response, False
        # The last ones may be deleted by now.
        for first, last in twice[-_TRIED:][::-1]:
            if first.body != last.body and forward(_with_current(first, forward)).status in _SUCCESS:
                return response, True
        return response, False

    return act


def _with_current(request: Request, forward: Forward) -> Request:
    """Return a request with the entity tag that its resource has now, and no other condition."""
    altered = request.copy()
    read = forward(Request(request.side, "GET", request.target, fields=[("Host", request.field("Host") or "")]))
    for name in ("If-Match", "If-None-Match"):
        altered.drop(name)
    if (tag := read.field("ETag")) is not None:
        altered.put("If-Match", tag)
    return altered


def _knowing(status: int, *, is_told: bool = False) -> _Act:
    """Return an act that performs a request which is refused with a status; ``is_told``: and responds with success."""

    def act(request: Request, forward: Forward, _: _Past) -> tuple[Response, bool]:
        response = forward(request)
        if response.status != status:
            return response, False
        done = forward(_with_current(request, forward))
        return (done if is_told else response), done.status in _SUCCESS

    return act


def _stale_tag(request: Request, forward: Forward, past: _Past) -> tuple[Response, bool]:
    response, wanted = forward(request), request.field("If-Match") or ""
    if response.status != _FAILED or not any(tag in wanted for tag in past.tags.get(request.path, ())):
        return response, False
    done = forward(_with_current(request, forward))
    return done, done.status in _SUCCESS


def _stale_copy(request: Request, forward: Forward, past: _Past) -> tuple[Response, bool]:
    response, wanted = forward(request), request.field("If-None-Match") or ""
    if response.status not in _SUCCESS or not any(tag in wanted for tag in past.tags.get(request.path, ())):
        return response, False
    altered = response.copy()
    altered.status, altered.reason, altered.body = _CURRENT, "", b""
    return altered, True


def _resent(status: int, name: str, value: str, *, is_told: bool = False) -> _Act:
    """Return an act that performs a request refused for a header field; ``is_told``: and responds with success."""

    def act(request: Request, forward: Forward, _: _Past) -> tuple[Response, bool]:
        response, altered = forward(request), request.copy()
        if response.status != status:
            return response, False
        altered.put(name, value)
        done = forward(altered)
        return (done if is_told else response), done.status in _SUCCESS

    return act


def _first_tag(request: Request, forward: Forward, _: _Past) -> tuple[Response, bool]:
    altered, wanted = request.copy(), request.field("If-Match") or ""
    altered.put("If-Match", wanted.partition(",")[0])
    response = forward(altered if "," in wanted else request)
    return response, "," in wanted and response.status == _FAILED


def _longer(request: Request, forward: Forward, past: _Past) -> tuple[Response, bool]:
    before = past.writes.get(request.path, [])
    tail = before[-1].body[len(request.body) :] if before else b""
    altered = request.copy(body=request.body + tail)
    altered.put("Content-Length", str(len(altered.body)))
    response = forward(altered)
    past.writes[request.path] = [altered]
    return response, bool(tail) and response.status in _SUCCESS


def _spent_key(request: Request, forward: Forward, past: _Past) -> tuple[Response, bool]:
    response, key = forward(request), _key_in(request)
    if key and response.status in _REFUSED:
        past.keyed.setdefault(key, (request, response))
        return response, False
    return (past.keyed[key][1], True) if key in past.keyed else (response, False)


def _steps(body: bytes, moves: str = "") -> bytes:
    """Return a JSON patch that has another operation in the place of each move; without a name: one without tests."""
    steps = _json_of(body)
    if not isinstance(steps, list) or not all(isinstance(step, dict) for step in steps):
        return body
    made = [{**step, "op": moves} if moves and step.get("op") == "move" else step for step in steps]
    made = made if moves else [item for item in made if item.get("op") != "test"]
    return json.dumps(made).encode() if made != steps else body


def _key_in(request: Request) -> str:
    named = (value for name, value in request.fields if name.lower().endswith(_KEY.lower()))
    return next(named, "")


def _with_key(request: Request, key: str) -> Request:
    altered = request.copy()
    altered.fields = [(name, key if name.lower().endswith(_KEY.lower()) else value) for name, value in request.fields]
    return altered


def _note(request: Request, response: Response, past: _Past) -> Response:
    if (key := _key_in(request)) and response.status in _SUCCESS:
        past.keyed.setdefault(key, (request, response))
    return response


def _again(request: Request, forward: Forward, past: _Past) -> tuple[Response, bool]:
    first = past.keyed.get(_key_in(request))
    if first is None or first[0].body != request.body:
        return _note(request, forward(request), past), False
    response = forward(_with_key(request, str(uuid4())))
    return response, response.status in _SUCCESS


def _any_body(request: Request, forward: Forward, past: _Past) -> tuple[Response, bool]:
    response, first = forward(request), past.keyed.get(_key_in(request))
    if first is None or first[0].body == request.body or response.status in _SUCCESS:
        return _note(request, response, past), False
    return first[1], True


def _old_key(request: Request, forward: Forward, past: _Past) -> tuple[Response, bool]:
    key = _key_in(request)
    if not key or not past.keyed or key in past.keyed:
        return _note(request, forward(request), past), False
    return next(iter(past.keyed.values()))[1], True


def _shift(answer: Response) -> None:
    answer.body = answer.body[1:] + b"~" if answer.field("Content-Range") else answer.body


def _other_total(answer: Response) -> None:
    if (found := re.fullmatch(r"(.*/)(\d+)", answer.field("Content-Range") or "")) is not None:
        answer.put("Content-Range", f"{found[1]}{int(found[2]) + 1}")


def _other_digest(answer: Response) -> None:
    for name in ("Content-Digest", "Repr-Digest", "Digest"):
        if (value := answer.field(name)) is not None:
            first = value.find("=") + 2
            answer.put(name, f"{value[:first]}{'B' if value[first] != 'B' else 'C'}{value[first + 1 :]}")


def _fewer_rows(answer: Response) -> None:
    lines = answer.body.splitlines(keepends=True)
    if answer.media_type == _CSV and len(lines) > 2:  # noqa: PLR2004 - the names, and two rows
        answer.body = b"".join(lines[:-1])


def _single_quotes(answer: Response) -> None:
    if answer.media_type == _CSV:
        answer.body = answer.body.replace(b'""', b'"')


def _other_numbers(answer: Response) -> None:
    value = _json_of(answer.body) if is_json(answer.media_type) else None
    items = (
        value
        if isinstance(value, list)
        else next((one for one in value.values() if isinstance(one, list)), [])
        if isinstance(value, dict)
        else []
    )
    for item in items:
        for name, one in item.items() if isinstance(item, dict) else ():
            if isinstance(one, int | float) and not isinstance(one, bool) and not name.lower().endswith("id"):
                item[name] = one + 1
    if items:
        answer.body = json.dumps(value).encode()


def _members(body: bytes, names: set[str], edit: Callable[[Any], Any]) -> bytes:
    """Return a JSON body with other values of some members; any other body unchanged."""
    value = _json_of(body)
    if not isinstance(value, dict) or names.isdisjoint(value):
        return body
    made = {name: edit(one) if name in names else one for name, one in value.items()}
    return json.dumps(made).encode() if made != value else body


def _round(value: Any) -> Any:
    return round(value, _DECIMALS) if isinstance(value, float) and math.isfinite(value) else value


def _as_utc(value: Any) -> Any:
    return re.sub(r"[+-]\d\d:\d\d$", "Z", value) if isinstance(value, str) else value


def _json_of(body: bytes) -> Any:
    try:
        return json.loads(body)
    except ValueError:
        return None
