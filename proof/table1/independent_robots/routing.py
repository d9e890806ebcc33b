"""Shared by robots on Python's web frameworks: the handlers of `plain`, found by the framework's router."""

import socket
from collections.abc import Iterable
from email.message import Message
from http import HTTPStatus

from proof.table1.independent_robots.body import Body
from proof.table1.independent_robots.plain import BUILD
from proof.table1.independent_robots.plain.reading import RefusedError
from proof.table1.independent_robots.plain.rest import DELIVERY, Handler, Rest, refusal
from proof.table1.independent_robots.plain.server import MAX_BODY, Answer

__all__ = ["MAX_BODY", "bound", "call", "message", "problem", "resources"]
_DESCRIPTIONS = {"/openapi.json", "/application.wadl"}


def resources() -> dict[str, dict[str, Handler]]:
    """Return the handlers of a new robot, by path (parameters in braces) and method."""
    rest = Rest(Body(BUILD))
    found = {path: methods for path, methods in rest.resources.items() if path not in _DESCRIPTIONS}
    return found | {DELIVERY: {"PUT": rest.deliver}}


def message(fields: Iterable[tuple[str, str]]) -> Message:
    """Return header fields as the message object that handlers expect."""
    headers = Message()
    for name, value in fields:
        headers.add_header(name, value)
    return headers


def call(handler: Handler, headers: Message, body: bytes, target: str) -> Answer:
    """Call a handler and return its response; a RefusedError becomes a problem."""
    try:
        return handler(headers, body, target)
    except RefusedError as refused:
        return refusal(refused, headers)


def problem(status: int, detail: str | None, headers: Message) -> Answer:
    """Return a problem in place of a framework's own error page."""
    return refusal(RefusedError(status, detail or HTTPStatus(status).phrase), headers)


def bound(port: int) -> tuple[socket.socket, str]:
    """Return a socket that listens on loopback, and its URL."""
    sock = socket.create_server(("127.0.0.1", port), backlog=128)
    return sock, f"http://127.0.0.1:{sock.getsockname()[1]}"
