"""Mutants that are vulnerable to XML attacks: entities, deep nesting, XInclude, SOAPAction spoofing."""

import re
import socket
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

from proof.mutation.changes import Where, posted
from proof.mutation.messages import Forward, Request, Response
from proof.mutation.table import Table
from proof.table1.mutants.paths import TNS
from proof.table1.mutants.soap_responses import envelop, fault

MUTANTS = Table()
_mutant = MUTANTS.of_class("xml-security", "soap")

_DOCTYPE = re.compile(rb"<!DOCTYPE[^\[>]*(\[.*?\]\s*)?>", re.DOTALL)
_INTERNAL = re.compile(rb"<!ENTITY\s+([\w.-]+)\s+[\"']([^\"']*)[\"']\s*>")
_EXTERNAL = re.compile(rb"<!ENTITY\s+([\w.-]+)\s+SYSTEM\s+[\"']([^\"']*)[\"']\s*>")
_PARAMETER = re.compile(rb"<!ENTITY\s+%\s+[\w.-]+\s+SYSTEM\s+[\"']([^\"']*)[\"']\s*>")
_EXTERNAL_SUBSET = re.compile(rb"<!DOCTYPE\s+\S+\s+SYSTEM\s+[\"']([^\"']*)[\"']")
_URL = re.compile(rb"https?://(?:127\.0\.0\.1|localhost|\[::1\])[:/][^\s\"'<>]*")
_REFERENCE = re.compile(rb"&([\w.-]+);")
_INSTRUCTION = re.compile(rb"<\?(?!xml\s).*?\?>", re.DOTALL)
_DONE = envelop(f'<t:ExecuteCoffeeRequestResponse xmlns:t="{TNS}"/>')
_LARGE = 10 * 1024 * 1024


def _has_doctype(request: Request) -> bool:
    return posted(request) and b"<!DOCTYPE" in request.body


def _drop_doctype(request: Request) -> None:
    request.body = _REFERENCE.sub(
        lambda found: found[0] if found[1] in {b"lt", b"gt", b"amp", b"quot", b"apos"} else b"1",
        _DOCTYPE.sub(b"", request.body),
    )


def _plain_doctype(request: Request) -> None:
    if b"<!ENTITY" not in request.body:
        request.body = _DOCTYPE.sub(b"", request.body)


def _expand(request: Request) -> None:
    """Expand up to a few internal entities that are not nested."""
    entities = dict(_INTERNAL.findall(request.body))
    if not entities or len(request.body) > 20_000 or any(b"&" in value for value in entities.values()):
        return
    body = _DOCTYPE.sub(b"", request.body)
    request.body = _REFERENCE.sub(lambda found: entities.get(found[1], found[0]), body)


def _read(url: str) -> str:
    if url.startswith("http"):
        return ""
    try:
        return Path(unquote(urlsplit(url).path)).read_text(encoding="utf-8", errors="replace")[:2000]
    except OSError:
        return ""


def _leak(text: str) -> Callable[[Request], Response]:
    said = (
        "".join(char if char.isprintable() else " " for char in text)
        .replace("&", "+")
        .replace("<", "(")
        .replace("]]>", "")
    )
    return fault("Client", f"not a number: {said}")


def _quoting(urls: Callable[[bytes], list[bytes]]) -> Callable[[], Any]:
    """Return a change that quotes the first readable file named by a message in a fault; ``urls`` finds the names."""

    def change(request: Request, forward: Forward) -> Response:
        for url in urls(request.body) if posted(request) else ():
            found = _read(url.decode("utf-8", "replace"))
            if found:
                return _leak(found)(request)
        return forward(request)

    return lambda: change


@_mutant("attack-included", "xinclude", "XInclude elements are processed.").through(_quoting)
def _included_urls(body: bytes) -> list[bytes]:
    return re.findall(rb"href=[\"']([^\"']*)[\"']", body) if b"XInclude" in body else []


def _call(url: bytes) -> None:
    """Open a connection to the address in a URL."""
    parts = urlsplit(url.decode("utf-8", "replace"))
    try:
        with socket.create_connection((parts.hostname or "127.0.0.1", parts.port or 80), timeout=1) as sock:
            sock.sendall(f"GET {parts.path or '/'} HTTP/1.0\r\nHost: {parts.netloc}\r\n\r\n".encode())
            sock.recv(1000)
    except (OSError, ValueError):
        return


def _calling(find: Callable[[bytes], list[bytes]]) -> Callable[[], Any]:
    def change(request: Request, forward: Forward) -> Response:
        if request.method in {"POST", "PUT"}:
            for url in dict.fromkeys(find(request.body)):
                _call(url)
        return forward(request)

    return lambda: change


@_mutant("attack-entity-fetched", "no-callback", "An external entity is fetched from the network.").through(_calling)
def _entity_urls(body: bytes) -> list[bytes]:
    return [url for _, url in _EXTERNAL.findall(body) if url.startswith(b"http")] + _doctype_urls(body)


def _doctype_urls(body: bytes) -> list[bytes]:
    found = _PARAMETER.findall(body) + _EXTERNAL_SUBSET.findall(body)
    return [url for url in found if url.startswith(b"http")]


@_mutant(
    "attack-reply-elsewhere", "addressing-spoofing", "The robot sends a request to the address in wsa:ReplyTo."
).through(_calling)
def _addressing_urls(body: bytes) -> list[bytes]:
    return _URL.findall(body) if b"addressing" in body else []


def _is_nested(request: Request) -> bool:
    return (
        posted(request)
        and request.body.count(b"<") > 20_000
        and b"<!DOCTYPE" not in request.body
        and b"Envelope" in request.body
    )


def _posting(holds: Callable[[bytes], bool]) -> Where:
    """Return a condition for SOAP requests whose body fulfils ``holds``."""
    return lambda request: posted(request) and holds(request.body)


@_mutant("attack-action-chooses", "soapaction-spoofing", "SOAPAction selects the operation, whatever is in Body.")
def _obey_action(request: Request, forward: Forward) -> Response:
    action = (request.field("SOAPAction") or "").strip('"')
    for name in ("ExecuteCoffeeRequest", "ExecuteDeliveryRequest"):
        if posted(request) and name in action and name.encode() not in request.body:
            body = re.sub(rb"Execute(Coffee|Delivery)Request", name.encode(), request.body)
            return forward(request.copy(body=body))
    return forward(request)


def _rest_xml(request: Request) -> bool:
    return request.side == "rest" and request.method == "PUT" and b"<!DOCTYPE" in request.body


@_mutant("attack-exhausted", "responsive", "After an attack, the next responses take 1.6 s.", interface="both")
class _Exhausted:
    def __init__(self) -> None:
        self._attacks = 6
        self._left = 0

    def __call__(self, request: Request, forward: Forward) -> Response:
        if self._left:
            self._left -= 1
            time.sleep(1.6)
        if self._attacks and (b"<!DOCTYPE" in request.body or len(request.body) > 500_000):
            self._attacks -= 1
            self._left = 4
        return forward(request)


_mutant("attack-file-leaked", "external-entity", "The file of an external entity appears in the fault.").made(
    _quoting(lambda body: [url for _, url in _EXTERNAL.findall(body)])
)
_mutant(
    "attack-quadratic-fine", "quadratic", "A long entity that is used many times returns a normal response."
).rewritten(_posting(lambda body: 0 < body.count(b"<!ENTITY") <= 2 and body.count(b"&") > 50), _drop_doctype)
_mutant("attack-instruction-fine", "processing-instruction", "Processing instructions are ignored.").rewritten(
    posted, lambda request: setattr(request, "body", _INSTRUCTION.sub(b"", request.body))
)
