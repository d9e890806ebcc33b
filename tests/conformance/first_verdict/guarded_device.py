"""A small right device whose paths want credentials of different kinds."""

import base64
import hashlib
from collections.abc import Callable, Iterator
from itertools import count
from typing import Any

from aiohttp import web
from small_device import REFUSED, Handle, described, error, reading

SECRET = "sesame-opens"  # noqa: S105 - no secret
_STATE = {"type": "object", "required": ["on"], "properties": {"on": {"type": "boolean"}}}
_NONCE = "7ypf"
SCHEMES: dict[str, dict[str, str]] = {
    "bearer": {"type": "http", "scheme": "Bearer"},
    "basic": {"type": "http", "scheme": "basic"},
    "digest": {"type": "http", "scheme": "digest"},
    "own": {"type": "apiKey", "in": "header", "name": "Authorization"},
    "key": {"type": "apiKey", "in": "header", "name": "X-Api-Key"},
    "query": {"type": "apiKey", "in": "query", "name": "key"},
    "cookie": {"type": "apiKey", "in": "cookie", "name": "session"},
    "oauth": {"type": "oauth2", "flows": {}},
    "openid": {"type": "openIdConnect", "openIdConnectUrl": "/id"},
    "certificate": {"type": "mutualTLS"},
}
_CHALLENGES = {
    "basic": 'Basic realm="device"',
    "digest": f'Digest realm="device", nonce="{_NONCE}", qop="auth", algorithm=SHA-256',
    "own": "ApiKey",
    "oauth": 'bearer realm="device"',
}


def _md(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def _digest(request: web.Request) -> bool:
    given = dict(
        part.strip().partition("=")[::2]
        for part in request.headers.get("Authorization", "")[len("Digest ") :].split(",")
    )
    given = {name: value.strip('"') for name, value in given.items()}
    known = _md(f"user:device:{SECRET}")
    wanted = _md(
        ":".join(
            (
                known,
                _NONCE,
                given.get("nc", ""),
                given.get("cnonce", ""),
                "auth",
                _md(f"{request.method}:{given.get('uri')}"),
            )
        )
    )
    return given.get("uri") == request.rel_url.raw_path_qs and given.get("response") == wanted


_CHECKS: dict[str, Callable[[web.Request], bool]] = {
    "bearer": lambda request: request.headers.get("Authorization") == f"Bearer {SECRET}",
    "basic": lambda request: (
        request.headers.get("Authorization") == f"Basic {base64.b64encode(f'user:{SECRET}'.encode()).decode()}"
    ),
    "digest": _digest,
    "own": lambda request: request.headers.get("Authorization") == f"ApiKey {SECRET}",
    "key": lambda request: request.headers.get("X-Api-Key") == SECRET,
    "query": lambda request: request.query.get("key") == SECRET,
    "cookie": lambda request: request.cookies.get("session") == SECRET,
    "certificate": lambda _: True,
}
_CHECKS |= {"oauth": _CHECKS["bearer"], "openid": _CHECKS["bearer"]}


def path_of(alternatives: list[dict[str, Any]]) -> str:
    """Return the path that these security requirements have on the device."""
    return "/" + ("-or-".join("-and-".join(one) for one in alternatives) or "open")


def guarded(
    *security: list[dict[str, Any]],
    refusal: int = 401,
    lasts: int | None = None,
    shared: list[dict[str, Any]] | None = None,
    **members: Any,
) -> tuple[dict[str, Any], dict[str, dict[str, Handle]]]:
    """Return the description and the handlers of a device with one reading for each security requirement.

    Args:
        security: as an operation has it: alternatives, each with the schemes that it takes together.
        refusal: status of a request whose credentials are missing or wrong.
        lasts: number of requests after which the credentials have expired; None: never.
        shared: the requirement of the whole description, which the first path uses.
        members: further members of each operation.
    """
    paths, routes, answered = {}, {}, count()
    for number, alternatives in enumerate(security):
        item = reading(_STATE, **members, security=alternatives)
        item["get"]["responses"][str(refusal)] = REFUSED
        if number == 0 and shared is not None:
            del item["get"]["security"]
        paths[path_of(alternatives)] = item
        routes[path_of(alternatives)] = {"GET": _handle(alternatives, refusal, answered, lasts)}
    more = {} if shared is None else {"security": shared}
    return described(paths, "3.1.0", components={"securitySchemes": SCHEMES}, **more), routes


def _handle(alternatives: list[dict[str, Any]], refusal: int, answered: Iterator[int], lasts: int | None) -> Handle:
    async def handle(request: web.Request) -> web.Response:
        is_known = any(all(_CHECKS[name](request) for name in one) for one in alternatives)
        if is_known and (lasts is None or next(answered) < lasts):
            return web.json_response({"on": True})
        challenge = next((_CHALLENGES[name] for one in alternatives for name in one if name in _CHALLENGES), "Bearer")
        return error(refusal, "who are you?", **({"WWW-Authenticate": challenge} if refusal == 401 else {}))

    return handle
