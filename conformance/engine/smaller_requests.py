"""Make a request smaller, to find the part that makes a device crash or hang."""

import json
from collections.abc import Iterator
from dataclasses import replace
from typing import Any, Final

from conformance.transport.credentials import is_shown
from conformance.transport.exchange import Request

# Headers that every request needs or that the client adds.
_KEPT: Final = frozenset({"host", "accept", "content-type", "content-length", "connection"})
# A text longer than this is also tried at half its length.
_LONG: Final = 64


def smaller(request: Request) -> Iterator[Request]:
    """Yield requests that lack one part of this one, the largest parts first."""
    if request.raw is not None:
        return
    if request.body:
        yield replace(request, body=b"", headers=_without(request, "content-type"))
    place, mark, query = request.url.partition("?")
    pairs = query.split("&") if mark else []
    if pairs:
        yield replace(request, url=place)
    for index in range(len(pairs)) if len(pairs) > 1 else ():
        yield replace(request, url=f"{place}?{'&'.join(pairs[:index] + pairs[index + 1 :])}")
    for index, pair in enumerate(pairs):
        if len(pair) > _LONG:
            # Do not cut a percent-escape in two: that would be another fault.
            half = pair[: len(pair) // 2].rstrip("%") if "%" not in pair[len(pair) // 2 - 2 :] else ""
            yield replace(request, url=f"{place}?{'&'.join([*pairs[:index], half, *pairs[index + 1 :]])}")
    for name in dict.fromkeys(name.lower() for name, value in request.headers if not is_shown(value)):
        if name not in _KEPT:
            yield replace(request, headers=_without(request, name))
    for body in _smaller_bodies(request.body):
        yield replace(request, body=body)


def _without(request: Request, name: str) -> tuple[tuple[str, str], ...]:
    return tuple(pair for pair in request.headers if pair[0].lower() != name)


def _smaller_bodies(body: bytes) -> Iterator[bytes]:
    try:
        value = json.loads(body)
    except (ValueError, RecursionError):
        if len(body) > 1:
            yield body[: len(body) // 2]
        return
    for one in _smaller_values(value):
        yield json.dumps(one, ensure_ascii=False).encode("utf-8", "surrogatepass")


def _smaller_values(value: Any) -> Iterator[Any]:
    """Yield JSON values that lack one member or item, or the second half of a long text; outer ones first."""
    if isinstance(value, str) and len(value) > _LONG:
        yield value[: len(value) // 2]
    if isinstance(value, list) and len(value) > _LONG:
        yield value[: len(value) // 2]
        return
    keys = range(len(value)) if isinstance(value, list) else list(value) if isinstance(value, dict) else ()
    for key in keys:
        lacking = value.copy()
        del lacking[key]
        yield lacking
    for key in keys:
        for inner in _smaller_values(value[key]):
            changed = value.copy()
            changed[key] = inner
            yield changed
