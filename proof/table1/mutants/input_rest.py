"""Mutants that repair or accept invalid REST input instead of refusing it."""

import json
import math
import re
from collections.abc import Callable
from typing import Any
from urllib.parse import parse_qsl

from proof.mutation.changes import parsed, plain, query, rest, rewritten, success
from proof.mutation.messages import Forward, Request, Response
from proof.mutation.table import Table
from proof.table1.mutants.delivery import any_code, finite, lenient, segments
from proof.table1.mutants.paths import GOAL, LINEAR, PLAN, VELOCITY

MUTANTS = Table()
_mutant = MUTANTS.of_class("strict-input", "rest")

_PUT = rest("PUT", VELOCITY, LINEAR, GOAL)
_ZERO = {"x": 0.0, "y": 0.0, "z": 0.0}
_UNIT = {**_ZERO, "w": 1.0}
_VECTORS = {VELOCITY: {"linear": _ZERO, "angular": _ZERO}, LINEAR: _ZERO}
_GOAL = {"goal": {"target_pose": {"header": {"frame_id": "map"}, "pose": {"position": _ZERO, "orientation": _UNIT}}}}
_TIME = {"sec": 0, "nanosec": 0}
_OPTIONAL = {"header": {"stamp": _TIME, "frame_id": ""}, "goal_id": {"stamp": _TIME, "id": "x"}, "stamp": _TIME}


def _pattern(request: Request) -> Any:
    return _VECTORS.get(request.path, _GOAL)


def _is_json(request: Request) -> bool:
    return _PUT(request) and request.media_type == "application/json"


def _repairing(repair: Callable[[Any, Any], Any]) -> Callable[[], Any]:
    """Return a change that replaces a JSON request body by ``repair(value, pattern)``."""

    def edit(request: Request) -> None:
        value = parsed(request.body)
        if isinstance(value, dict):
            request.body = json.dumps(repair(value, _pattern(request))).encode()

    return rewritten(_is_json, edit)


def _fill(value: Any, pattern: Any) -> Any:
    """Fill in a JSON body's missing members with the values of a complete one."""
    if not isinstance(pattern, dict) or not isinstance(value, dict):
        return value
    return {**value, **{key: _fill(value.get(key, pattern[key]), pattern[key]) for key in pattern}}


def _drop_unknown(value: Any, pattern: Any) -> Any:
    """Remove members that the complete body does not have."""
    if not isinstance(pattern, dict) or not isinstance(value, dict):
        return value
    parts = {**_OPTIONAL, **pattern} if "goal" in pattern or "frame_id" in pattern or "id" in pattern else pattern
    return {key: _drop_unknown(part, parts[key]) for key, part in value.items() if key in parts}


def _convert(value: Any, pattern: Any) -> Any:
    """Convert values of another type to numbers, as a loosely typed language does."""
    if isinstance(pattern, dict):
        given = value if isinstance(value, dict) else pattern
        return {key: _convert(part, pattern[key]) if key in pattern else part for key, part in given.items()}
    if isinstance(pattern, float) and not (isinstance(value, int | float) and not isinstance(value, bool)):
        try:
            number = float(value)
        except (TypeError, ValueError):
            return pattern
        return number if math.isfinite(number) else pattern
    return str(value) if isinstance(pattern, str) and not isinstance(value, str) else value


def _finite(value: Any, pattern: Any) -> Any:
    """Replace NaN and infinite numbers by 0."""
    if isinstance(value, dict):
        return {key: _finite(part, pattern) for key, part in value.items()}
    return 0.0 if isinstance(value, float) and not math.isfinite(value) else value


def _bound(value: Any, pattern: Any) -> Any:
    """Clamp values to the contract's bounds."""
    if isinstance(value, dict):
        made = {key: _bound(part, pattern) for key, part in value.items()}
        if isinstance(made.get("id"), str):
            made["id"] = (made["id"] or "x")[:255]
        for key, low, high in (("sec", -(2**31), 2**31 - 1), ("nanosec", 0, 2**32 - 1)):
            if isinstance(made.get(key), int | float):
                made[key] = int(max(low, min(high, made[key])))
        return made
    return value


def _swallow(where: Callable[[Request], bool]) -> Callable[[], Any]:
    """Return a change that answers 204 where the robot refuses a request of ``where``."""

    def change(request: Request, forward: Forward) -> Response:
        response = forward(request)
        return plain(204)(request) if where(request) and not success(response) and response.status != 409 else response

    return lambda: change


@_mutant("input-malformed-fine", "json-malformed", "Malformed JSON returns 204.").through(_swallow)
def _is_malformed(request: Request) -> bool:
    return (
        _is_json(request)
        and bool(request.body)
        and parsed(request.body) is None
        and request.body.strip() != b"null"
        and not _deep(request)
    )


def _deep(request: Request) -> bool:
    return _is_json(request) and (request.body.count(b"[") > 1000 or request.body.count(b"{") > 1000)


@_mutant("input-huge-fine", "json-huge-number", "A JSON integer of thousands of digits returns 204.").through(_swallow)
def _huge(request: Request) -> bool:
    return _is_json(request) and bool(re.search(rb"\d{1000}", request.body))


@_mutant("input-any-encoding", "json-encoding", "A JSON body that is not UTF-8 returns 204.").through(_swallow)
def _other_encoding(request: Request) -> bool:
    if not _is_json(request):
        return False
    try:
        request.body.decode("utf-8")
    except UnicodeDecodeError:
        return True
    return request.body.startswith(b"\xef\xbb\xbf") or b"\x00" in request.body


@_mutant("input-any-root", "json-root", "A JSON body that is not an object returns 204.").through(_swallow)
def _no_object(request: Request) -> bool:
    return (
        _is_json(request)
        and not isinstance(parsed(request.body), dict)
        and bool(request.body)
        and (parsed(request.body) is not None or request.body.strip() == b"null")
    )


def _twice(request: Request) -> None:
    value = parsed(request.body)
    if isinstance(value, dict):
        request.body = json.dumps(value).encode()


@_mutant("input-xml-fine", "xml-body", "XML of the wrong shape returns 204.").through(_swallow)
def _xml(request: Request) -> bool:
    return _PUT(request) and request.media_type.endswith("xml")


def _numbers(given: dict[str, str]) -> None:
    for name, text in given.items():
        if name != "frame_id" and not re.fullmatch(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d{1,2})?", text):
            given[name] = "0"


@_mutant("input-query-complete", "query-missing", "A missing x or y in a query takes the value of the query before.")
class _Remembered:
    def __init__(self) -> None:
        self._last = {"x": "0", "y": "0"}

    def __call__(self, request: Request, forward: Forward) -> Response:
        if not rest("GET", PLAN)(request):
            return forward(request)
        request = request.copy()
        query(lambda given: given.update({name: value for name, value in self._last.items() if name not in given}))(
            request
        )
        response = forward(request)
        if success(response):
            self._last = {name: text for name, text in parse_qsl(request.query) if name in self._last}
        return response


def _path(request: Request) -> None:
    for edit in (lenient, finite, any_code):
        segments(edit)(request)


_mutant("input-empty-fine", "json-empty", "An empty body returns 204.").made(
    _swallow(lambda request: _is_json(request) and not request.body.strip())
)
