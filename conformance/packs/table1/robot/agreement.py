"""Compare a value with the values read before and after it, for states that may change between reads."""

import json
from dataclasses import dataclass
from typing import Any

from conformance.documents.json_schema import is_number
from conformance.documents.json_text import clip


@dataclass(frozen=True)
class Slack:
    """How far a number may lie outside the two numbers read before and after it, when those two differ."""

    absolute: float = 0.02
    relative: float = 0.05


def disagreement(before: Any, between: Any, after: Any, slack: Slack, where: str = "") -> str:
    """Return a description of where ``between`` differs from both neighbours, or an empty text.

    Only fields that all three values have are compared. The caller must remove stamps, which advance between reads.
    """
    if isinstance(before, dict) and isinstance(after, dict):
        return _in_fields(before, between, after, slack, where)
    if isinstance(before, list) and isinstance(after, list):
        return _in_lists(before, between, after, slack, where)
    if is_number(before) and is_number(after):
        low, high = sorted((float(before), float(after)))
        # A value that did not change is exactly the same double over every interface (contract.md#equivalence).
        room = 0.0 if low == high else slack.absolute + slack.relative * max(abs(low), abs(high))
        if not is_number(between) or not low - room <= float(between) <= high + room:
            wanted = f"{low!r}" if low == high else f"{low!r} to {high!r}"
            return f"{where} is {clip(between)} for {wanted}"
        return ""
    return "" if between in (before, after) else f"{where} is {clip(between)} for {clip(before)}"


def _in_fields(before: dict[str, Any], between: Any, after: dict[str, Any], slack: Slack, where: str) -> str:
    for name, value in before.items():
        first = value
        if name not in after or (name == "stamp" and first != after[name]):
            continue
        path = f"{where}.{name}" if where else name
        last = after[name]
        if name == "orientation" and isinstance(between, dict):
            # A quaternion and its negative are the same orientation: compare the nearer one.
            first, last = _nearer_sign(first, between.get(name)), _nearer_sign(last, between.get(name))
        if not isinstance(between, dict) or name not in between:
            return f"{path} is missing"
        problem = disagreement(first, between[name], last, slack, path)
        if problem:
            return problem
    return ""


def _nearer_sign(quaternion: Any, like: Any) -> Any:
    """Return a quaternion or its negative, whichever is nearer to ``like``; return other values unchanged."""
    try:
        aside = sum(float(quaternion[axis]) * float(like[axis]) for axis in "xyzw") < 0
        return {**quaternion, **{axis: -quaternion[axis] for axis in "xyzw"}} if aside else quaternion
    except (TypeError, KeyError, ValueError):
        return quaternion


def _in_lists(before: list[Any], between: Any, after: list[Any], slack: Slack, where: str) -> str:
    lengths = {len(before), len(after)}
    if not isinstance(between, list) or len(between) not in lengths:
        return f"{where} has {len(between) if isinstance(between, list) else 'no'} items for {len(before)}"
    if len(lengths) > 1:
        return ""
    for index, triple in enumerate(zip(before, between, after, strict=True)):
        problem = disagreement(*triple, slack, f"{where}[{index}]")
        if problem:
            return problem
    return ""


def unstamped(value: Any) -> Any:
    """Return a copy of a message without timestamps, which may legitimately differ between responses."""
    if isinstance(value, dict):
        return {name: unstamped(item) for name, item in value.items() if name != "stamp"}
    return [unstamped(item) for item in value] if isinstance(value, list) else value


def stamp_of(message: Any) -> tuple[float, float]:
    """Return the timestamp (sec, nanosec) in a message's header; zeros where it cannot be read."""
    header = message.get("header") if isinstance(message, dict) else None
    stamp = header.get("stamp") if isinstance(header, dict) else None
    if not isinstance(stamp, dict) or not is_number(stamp.get("sec")) or not is_number(stamp.get("nanosec")):
        return 0.0, 0.0
    return float(stamp["sec"]), float(stamp["nanosec"])


def entries_of(listed: list[Any], names: tuple[str, ...]) -> list[str]:
    """Return the given fields of each list entry as sorted texts, so that lists compare equal in any order."""
    return sorted(json.dumps([entry.get(name) for name in names]) for entry in listed)
