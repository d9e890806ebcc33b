"""Robots that take garbage over REST: what is invalid is repaired before it is looked at."""

from __future__ import annotations

import json
import math
import re
from typing import TYPE_CHECKING, Any
from urllib.parse import parse_qsl, urlencode

from conformance.selftest.mutants.changes import (
    GOAL,
    LINEAR,
    PLAN,
    VELOCITY,
    altered,
    becomes,
    deliveries,
    parsed,
    plain,
    refusal,
    rest,
    rewritten,
    status,
    success,
)
from conformance.selftest.mutants.delivery import any_code, finite, lenient, segments
from conformance.selftest.mutants.mutant import Fault

if TYPE_CHECKING:
    from collections.abc import Callable

    from conformance.selftest.wire import Answer, Ask

    Forward = Callable[[Ask], Answer]

_PUT = rest("PUT", VELOCITY, LINEAR, GOAL)
_ZERO = {"x": 0.0, "y": 0.0, "z": 0.0}
_UNIT = {**_ZERO, "w": 1.0}
_VECTORS = {VELOCITY: {"linear": _ZERO, "angular": _ZERO}, LINEAR: _ZERO}
_GOAL = {"goal": {"target_pose": {"header": {"frame_id": "map"}, "pose": {"position": _ZERO, "orientation": _UNIT}}}}
_TIME = {"sec": 0, "nanosec": 0}
_OPTIONAL = {"header": {"stamp": _TIME, "frame_id": ""}, "goal_id": {"stamp": _TIME, "id": "x"}, "stamp": _TIME}


def _pattern(ask: Ask) -> Any:
    return _VECTORS.get(ask.path, _GOAL)


def _is_json(ask: Ask) -> bool:
    return _PUT(ask) and ask.media_type == "application/json"


def _repairing(repair: Callable[[Any, Any], Any]) -> Callable[[], Any]:
    """JSON that is well-formed is made to fit by ``repair(value, pattern)``."""

    def edit(ask: Ask) -> None:
        value = parsed(ask.body)
        if isinstance(value, dict):
            ask.body = json.dumps(repair(value, _pattern(ask))).encode()

    return rewritten(_is_json, edit)


def _filled(value: Any, pattern: Any) -> Any:
    """Missing fields become zero."""
    if not isinstance(pattern, dict) or not isinstance(value, dict):
        return value
    return {
        **value,
        **{key: _filled(value.get(key, pattern[key]), pattern[key]) for key in pattern},
    }


def _known(value: Any, pattern: Any) -> Any:
    """Unknown fields are left out."""
    if not isinstance(pattern, dict) or not isinstance(value, dict):
        return value
    parts = {**_OPTIONAL, **pattern} if "goal" in pattern or "frame_id" in pattern or "id" in pattern else pattern
    return {key: _known(part, parts[key]) for key, part in value.items() if key in parts}


def _typed(value: Any, pattern: Any) -> Any:
    """Values of another type are made numbers, as a lenient language does."""
    if isinstance(pattern, dict):
        given = value if isinstance(value, dict) else pattern
        return {key: _typed(part, pattern[key]) if key in pattern else part for key, part in given.items()}
    if isinstance(pattern, float) and not (isinstance(value, int | float) and not isinstance(value, bool)):
        try:
            number = float(value)
        except (TypeError, ValueError):
            return pattern
        return number if math.isfinite(number) else pattern
    return str(value) if isinstance(pattern, str) and not isinstance(value, str) else value


def _finite(value: Any, pattern: Any) -> Any:
    """Numbers that are not finite become zero."""
    if isinstance(value, dict):
        return {key: _finite(part, pattern) for key, part in value.items()}
    return 0.0 if isinstance(value, float) and not math.isfinite(value) else value


def _bounded(value: Any, pattern: Any) -> Any:
    """Values beyond the contract's bounds are cut to them."""
    if isinstance(value, dict):
        made = {key: _bounded(part, pattern) for key, part in value.items()}
        if isinstance(made.get("id"), str):
            made["id"] = (made["id"] or "x")[:255]
        for key, low, high in (("sec", -(2**31), 2**31 - 1), ("nanosec", 0, 2**32 - 1)):
            if isinstance(made.get(key), int | float):
                made[key] = int(max(low, min(high, made[key])))
        return made
    return value


def _swallowed(where: Callable[[Ask], bool]) -> Callable[[], Any]:
    """What is refused there is answered as if it were fine."""

    def change(ask: Ask, forward: Forward) -> Answer:
        answer = forward(ask)
        return plain(204)(ask) if where(ask) and not success(answer) and answer.status != 409 else answer

    return lambda: change


def _malformed(ask: Ask) -> bool:
    return (
        _is_json(ask) and bool(ask.body) and parsed(ask.body) is None and ask.body.strip() != b"null" and not _deep(ask)
    )


def _deep(ask: Ask) -> bool:
    return _is_json(ask) and (ask.body.count(b"[") > 1000 or ask.body.count(b"{") > 1000)


def _huge(ask: Ask) -> bool:
    return _is_json(ask) and bool(re.search(rb"\d{1000}", ask.body))


def _other_encoding(ask: Ask) -> bool:
    if not _is_json(ask):
        return False
    try:
        ask.body.decode("utf-8")
    except UnicodeDecodeError:
        return True
    return ask.body.startswith(b"\xef\xbb\xbf") or b"\x00" in ask.body


def _no_object(ask: Ask) -> bool:
    return (
        _is_json(ask)
        and not isinstance(parsed(ask.body), dict)
        and bool(ask.body)
        and (parsed(ask.body) is not None or ask.body.strip() == b"null")
    )


def _twice(ask: Ask) -> None:
    value = parsed(ask.body)
    if isinstance(value, dict):
        ask.body = json.dumps(value).encode()


def _xml(ask: Ask) -> bool:
    return _PUT(ask) and ask.media_type.endswith("xml")


def _query(edit: Callable[[dict[str, str]], None]) -> Callable[[Ask], None]:
    def apply(ask: Ask) -> None:
        given = dict(parse_qsl(ask.query, keep_blank_values=True))
        edit(given)
        ask.target = f"{ask.path}?{urlencode(given)}"

    return apply


def _numbers(given: dict[str, str]) -> None:
    for name, text in given.items():
        if name != "frame_id" and not re.fullmatch(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d{1,2})?", text):
            given[name] = "0"


class _Remembered:
    """A missing x or y is the one of the query before."""

    def __init__(self) -> None:
        self._last = {"x": "0", "y": "0"}

    def __call__(self, ask: Ask, forward: Forward) -> Answer:
        """See proxy.Change."""
        if not rest("GET", PLAN)(ask):
            return forward(ask)
        ask = ask.copy()
        _query(lambda given: given.update({name: value for name, value in self._last.items() if name not in given}))(
            ask
        )
        answer = forward(ask)
        if success(answer):
            self._last = {name: text for name, text in parse_qsl(ask.query) if name in self._last}
        return answer


def _path(ask: Ask) -> None:
    for edit in (lenient, finite, any_code):
        segments(edit)(ask)


def _fault(name: str, says: str, id_: str, make: Any) -> Fault:
    return Fault(name, says, (f"strict-input/{id_}",), "rest", make)


FAULTS = (
    _fault("input-malformed-fine", "JSON that is none is answered 204.", "json-malformed", _swallowed(_malformed)),
    _fault("input-missing-is-zero", "A missing field counts as zero.", "json-missing", _repairing(_filled)),
    _fault("input-unknown-ignored", "Unknown fields are ignored.", "json-unknown", _repairing(_known)),
    _fault(
        "input-last-wins",
        "Of a name that is there twice, the last one counts.",
        "json-duplicate",
        rewritten(_is_json, _twice),
    ),
    _fault("input-coerced", "Strings, null and booleans count as numbers.", "json-type", _repairing(_typed)),
    _fault("input-nan-is-zero", "NaN and what overflows count as zero.", "json-non-finite", _repairing(_finite)),
    _fault("input-any-root", "A body that is no object is answered 204.", "json-root", _swallowed(_no_object)),
    _fault("input-deep-fine", "JSON nested deep is answered 204.", "json-depth", _swallowed(_deep)),
    _fault(
        "input-huge-fine", "An integer of thousands of digits is answered 204.", "json-huge-number", _swallowed(_huge)
    ),
    _fault(
        "input-any-encoding", "A body that is not UTF-8 is answered 204.", "json-encoding", _swallowed(_other_encoding)
    ),
    _fault(
        "input-empty-fine",
        "An empty body is answered 204.",
        "json-empty",
        _swallowed(lambda ask: _is_json(ask) and not ask.body.strip()),
    ),
    _fault("input-bounds-cut", "Values beyond their bounds are cut to them.", "json-bounds", _repairing(_bounded)),
    _fault(
        "input-path-lenient",
        "Whatever stands in a path counts as a number.",
        "path-parameter",
        rewritten(deliveries, _path),
    ),
    _fault(
        "input-query-lenient",
        "What is no number in a query counts as 0.",
        "query-parameter",
        rewritten(rest("GET", PLAN), _query(_numbers)),
    ),
    _fault(
        "input-query-complete",
        "A missing x or y is the one of the query before.",
        "query-missing",
        _Remembered,
    ),
    _fault("input-xml-fine", "XML of the wrong shape is answered 204.", "xml-body", _swallowed(_xml)),
    _fault(
        "input-malformed-422",
        "JSON that is none is 422.",
        "status-malformed",
        altered(_is_json, becomes(422), status(400)),
    ),
    _fault(
        "input-invalid-400",
        "JSON of the wrong shape is 400.",
        "status-invalid",
        altered(_is_json, becomes(400), status(422)),
    ),
    _fault(
        "input-crash-sometimes",
        "One refused body in 20 is answered 500.",
        "json-type",
        altered(_is_json, becomes(500), refusal, nth=20),
    ),
)
