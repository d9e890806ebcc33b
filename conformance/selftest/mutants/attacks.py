"""Robots that fall for attacks by XML."""

from __future__ import annotations

import re
import socket
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import unquote, urlsplit

from conformance.selftest.mutants.changes import TNS, instead, plain, rewritten
from conformance.selftest.mutants.mutant import Fault
from conformance.selftest.mutants.soap_processing import posted
from conformance.selftest.mutants.soap_services import enveloped, fault

if TYPE_CHECKING:
    from collections.abc import Callable

    from conformance.selftest.wire import Answer, Ask

    Forward = Callable[[Ask], Answer]

_DOCTYPE = re.compile(rb"<!DOCTYPE[^\[>]*(\[.*?\]\s*)?>", re.DOTALL)
_INTERNAL = re.compile(rb"<!ENTITY\s+([\w.-]+)\s+[\"']([^\"']*)[\"']\s*>")
_EXTERNAL = re.compile(rb"<!ENTITY\s+([\w.-]+)\s+SYSTEM\s+[\"']([^\"']*)[\"']\s*>")
_PARAMETER = re.compile(rb"<!ENTITY\s+%\s+[\w.-]+\s+SYSTEM\s+[\"']([^\"']*)[\"']\s*>")
_EXTERNAL_SUBSET = re.compile(rb"<!DOCTYPE\s+\S+\s+SYSTEM\s+[\"']([^\"']*)[\"']")
_URL = re.compile(rb"https?://(?:127\.0\.0\.1|localhost|\[::1\])[:/][^\s\"'<>]*")
_REFERENCE = re.compile(rb"&([\w.-]+);")
_INSTRUCTION = re.compile(rb"<\?(?!xml\s).*?\?>", re.DOTALL)
_DONE = enveloped(f'<t:ExecuteCoffeeRequestResponse xmlns:t="{TNS}"/>')
_LARGE = 10 * 1024 * 1024


def _declared(ask: Ask) -> bool:
    return posted(ask) and b"<!DOCTYPE" in ask.body


def _undeclared(ask: Ask) -> None:
    ask.body = _REFERENCE.sub(
        lambda found: found[0] if found[1] in {b"lt", b"gt", b"amp", b"quot", b"apos"} else b"1",
        _DOCTYPE.sub(b"", ask.body),
    )


def _plain_doctype(ask: Ask) -> None:
    if b"<!ENTITY" not in ask.body:
        ask.body = _DOCTYPE.sub(b"", ask.body)


def _expanded(ask: Ask) -> None:
    """Internal entities, a few of them and not nested, are put in their places."""
    entities = dict(_INTERNAL.findall(ask.body))
    if not entities or len(ask.body) > 20_000 or any(b"&" in value for value in entities.values()):
        return
    body = _DOCTYPE.sub(b"", ask.body)
    ask.body = _REFERENCE.sub(lambda found: entities.get(found[1], found[0]), body)


def _read(url: str) -> str:
    if url.startswith("http"):
        return ""
    try:
        return Path(unquote(urlsplit(url).path)).read_text(encoding="utf-8", errors="replace")[:2000]
    except OSError:
        return ""


def _leaked(text: str) -> Callable[[Ask], Answer]:
    said = (
        "".join(char if char.isprintable() else " " for char in text)
        .replace("&", "+")
        .replace("<", "(")
        .replace("]]>", "")
    )
    return fault("Client", f"not a number: {said}")


def _external(ask: Ask, forward: Forward) -> Answer:
    """An external entity's file is quoted in the fault."""
    for _, url in _EXTERNAL.findall(ask.body) if posted(ask) else ():
        found = _read(url.decode("utf-8", "replace"))
        if found:
            return _leaked(found)(ask)
    return forward(ask)


def _xinclude(ask: Ask, forward: Forward) -> Answer:
    """An xi:include's file is quoted in the fault."""
    if posted(ask) and b"XInclude" in ask.body:
        for url in re.findall(rb"href=[\"']([^\"']*)[\"']", ask.body):
            found = _read(url.decode("utf-8", "replace"))
            if found:
                return _leaked(found)(ask)
    return forward(ask)


def _call(url: bytes) -> None:
    """Open a connection to an address that a message names."""
    parts = urlsplit(url.decode("utf-8", "replace"))
    try:
        with socket.create_connection((parts.hostname or "127.0.0.1", parts.port or 80), timeout=1) as sock:
            sock.sendall(f"GET {parts.path or '/'} HTTP/1.0\r\nHost: {parts.netloc}\r\n\r\n".encode())
            sock.recv(1000)
    except (OSError, ValueError):
        return


def _calling(find: Callable[[bytes], list[bytes]]) -> Callable[[], Any]:
    def change(ask: Ask, forward: Forward) -> Answer:
        if ask.method in {"POST", "PUT"}:
            for url in dict.fromkeys(find(ask.body)):
                _call(url)
        return forward(ask)

    return lambda: change


def _entity_urls(body: bytes) -> list[bytes]:
    return [url for _, url in _EXTERNAL.findall(body) if url.startswith(b"http")] + _doctype_urls(body)


def _doctype_urls(body: bytes) -> list[bytes]:
    found = _PARAMETER.findall(body) + _EXTERNAL_SUBSET.findall(body)
    return [url for url in found if url.startswith(b"http")]


def _addressing_urls(body: bytes) -> list[bytes]:
    return _URL.findall(body) if b"addressing" in body else []


def _nested(ask: Ask) -> bool:
    return posted(ask) and ask.body.count(b"<") > 20_000 and b"<!DOCTYPE" not in ask.body and b"Envelope" in ask.body


def _many_entities(ask: Ask) -> bool:
    return posted(ask) and ask.body.count(b"<!ENTITY") > 2


def _one_long_entity(ask: Ask) -> bool:
    return posted(ask) and 0 < ask.body.count(b"<!ENTITY") <= 2 and ask.body.count(b"&") > 50


def _long_name(ask: Ask) -> bool:
    return posted(ask) and bool(re.search(rb"<[\w:.-]{5000,}", ask.body))


def _attributed(ask: Ask) -> bool:
    return posted(ask) and ask.body.count(b'="') > 5000


def _bomb(ask: Ask) -> bool:
    return posted(ask) and bool(ask.field("Content-Encoding"))


def _spoofed(ask: Ask, forward: Forward) -> Answer:
    """SOAPAction chooses what is run, whatever the body says."""
    action = (ask.field("SOAPAction") or "").strip('"')
    for name in ("ExecuteCoffeeRequest", "ExecuteDeliveryRequest"):
        if posted(ask) and name in action and name.encode() not in ask.body:
            body = re.sub(rb"Execute(Coffee|Delivery)Request", name.encode(), ask.body)
            return forward(ask.copy(body=body))
    return forward(ask)


def _rest_xml(ask: Ask) -> bool:
    return ask.side == "rest" and ask.method == "PUT" and b"<!DOCTYPE" in ask.body


class _Exhausted:
    """After each of the first attacks the robot needs a while for everything."""

    def __init__(self) -> None:
        self._attacks = 6
        self._left = 0

    def __call__(self, ask: Ask, forward: Forward) -> Answer:
        """See proxy.Change."""
        if self._left:
            self._left -= 1
            time.sleep(1.6)
        if self._attacks and (b"<!DOCTYPE" in ask.body or len(ask.body) > 500_000):
            self._attacks -= 1
            self._left = 4
        return forward(ask)


def _fault(name: str, says: str, id_: str, make: Any, interface: str = "soap") -> Fault:
    return Fault(name, says, (f"xml-security/{id_}",), interface, make)


FAULTS = (
    _fault(
        "attack-doctype-fine",
        "A Document Type Declaration is passed over.",
        "doctype",
        rewritten(_declared, _plain_doctype),
    ),
    _fault(
        "attack-entity-expanded", "Internal entities are expanded.", "internal-entity", rewritten(_declared, _expanded)
    ),
    _fault(
        "attack-file-leaked", "An external entity's file appears in the fault.", "external-entity", lambda: _external
    ),
    _fault(
        "attack-entity-fetched",
        "An external entity is fetched from the network.",
        "no-callback",
        _calling(_entity_urls),
    ),
    _fault(
        "attack-dtd-fetched",
        "An external DTD or parameter entity is fetched.",
        "parameter-entity",
        _calling(_doctype_urls),
    ),
    _fault(
        "attack-expansion-fine",
        "Entities that expand exponentially are answered like any others.",
        "expansion",
        rewritten(_many_entities, _undeclared),
    ),
    _fault(
        "attack-quadratic-fine",
        "One long entity many times is answered like any other.",
        "quadratic",
        rewritten(_one_long_entity, _undeclared),
    ),
    _fault("attack-depth-fine", "XML nested without end is answered 200.", "depth", instead(_nested, _DONE)),
    _fault(
        "attack-attributes-fine", "Thousands of attributes are passed over.", "attributes", instead(_attributed, _DONE)
    ),
    _fault(
        "attack-long-name-fine",
        "A name of a million characters is passed over.",
        "long-name",
        instead(_long_name, _DONE),
    ),
    _fault(
        "attack-size-fine",
        "A message over 10 MiB is answered 200.",
        "size",
        instead(lambda ask: posted(ask) and len(ask.body) > _LARGE, _DONE),
    ),
    _fault(
        "attack-bomb-unpacked",
        "A compressed message is unpacked, however large it becomes.",
        "compressed",
        instead(_bomb, _DONE),
    ),
    _fault(
        "attack-instruction-fine",
        "Processing instructions are passed over.",
        "processing-instruction",
        rewritten(posted, lambda ask: setattr(ask, "body", _INSTRUCTION.sub(b"", ask.body))),
    ),
    _fault("attack-included", "XInclude is processed.", "xinclude", lambda: _xinclude),
    _fault("attack-action-chooses", "SOAPAction chooses what is run.", "soapaction-spoofing", lambda: _spoofed),
    _fault("attack-reply-elsewhere", "ReplyTo is called.", "addressing-spoofing", _calling(_addressing_urls)),
    _fault(
        "attack-rest-fine",
        "A Document Type Declaration in a REST body is passed over.",
        "rest",
        instead(_rest_xml, plain(204)),
        "rest",
    ),
    _fault("attack-exhausted", "After an attack everything takes 1.6 s.", "responsive", _Exhausted, "both"),
)
