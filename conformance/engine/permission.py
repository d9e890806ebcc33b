"""Decide whether sending a recorded finding's requests again may move the robot or reach an unknown server.

A result file may come from anybody. So the bytes of the requests are examined, and nothing that the result claims
about them is trusted. A request that is not provably harmless may move the robot.
"""

import re
from collections.abc import Iterable, Mapping
from functools import cache
from typing import Any, Final
from urllib.parse import unquote, urlsplit

import msgspec

from conformance.api.call_rules import harmful_words, words_of
from conformance.api.permission import Permission
from conformance.contract.pack import Contract
from conformance.documents.openapi import Operation
from conformance.engine.resending import read_sequence
from conformance.statement.endpoints import Endpoints
from conformance.statement.statement import empty_statement
from conformance.transport.exchange import SAFE_METHODS, Request
from conformance.verdict.run import Run

# Names in a query or header by which a server may see another method than the request line's: _method=PUT,
# X-HTTP-Method-Override.
_OVERRIDES: Final = re.compile(r"method|verb|override|(?:PUT|POST|DELETE|PATCH)[ \t]", re.IGNORECASE)
# Headers by which a server may see another target or another end of the request: X-Original-URL, Transfer-Encoding.
_ALTERS: Final = re.compile(
    r"transfer|trailer|upgrade|expect|settings|destination"
    r"|(?:original|rewrite|forwarded)[-_]?(?:url|uri|path|prefix)",
    re.IGNORECASE,
)
# Words in a target that a device may act on, whatever the method: GET /robot/move, GET /relay/0?turn=on.
_ACTS: Final = frozenset(
    {
        "move", "moveto", "drive", "walk", "run", "go", "goto", "turn", "rotate", "spin", "jog", "start", "launch",
        "activate", "engage", "enable", "disarm", "takeoff", "undock", "open", "close", "grip", "grasp", "lift",
        "unlock", "toggle", "trigger", "fire", "jump", "set",
    }
)  # fmt: skip
# Query parameters whose value is data although their name is such a word: ?format=json, ?start=20.
_DATA: Final = re.compile(r"(?i)(?:^|(?<=[&;]))(?:format|start|open|auth|token|script|network|firmware)(?==)")
# Levels of percent-encoding that are undone: a proxy may undo one and the server another.
_MOST_DECODINGS: Final = 8
_PORTS: Final = {"http": 80, "https": 443}


def moves(failure: Mapping[str, Any], contract: Contract | None = None, base_url: str = "") -> bool:
    """Return whether sending a finding's requests again may move the robot.

    Args:
        failure: the finding, as in result.json.
        contract: the contract that judged, whose operations may say that a GET moves the robot; None if unknown.
        base_url: the base URL of the robot's REST interface.

    Raises:
        ValueError, KeyError, TypeError: the finding is malformed.
    """
    # A request that was too large to be stored is not sent.
    requests = read_sequence(failure.get("sequence") or ())
    permission = None
    if contract is not None and base_url:
        statement = msgspec.structs.replace(empty_statement(contract), endpoints=Endpoints(rest=base_url))
        permission = Permission(Run(statement, contract))
    return not all(_only_reads(request, permission) for request in requests)


def strangers(failure: Mapping[str, Any], trusted: Iterable[str]) -> list[str]:
    """Return the origins of a finding's requests that are not trusted, as scheme://host:port.

    Raises:
        ValueError, KeyError, TypeError: the finding is malformed.
    """
    known = {origin(url) for url in trusted}
    asked = {origin(str(item["url"])) for item in failure.get("sequence") or ()}
    return sorted(asked - known)


def origin(url: str) -> str:
    """Return scheme, host and port of a URL as one text (RFC 6454 4).

    Raises:
        ValueError: it is not an http or https URL.
    """
    parts = urlsplit(url)
    if parts.scheme not in _PORTS or not parts.hostname:
        raise ValueError(f"{url[:200]!r} is no http or https URL")
    host = f"[{parts.hostname}]" if ":" in parts.hostname else parts.hostname
    return f"{parts.scheme}://{host}:{parts.port or _PORTS[parts.scheme]}"


def _only_reads(request: Request, permission: Permission | None) -> bool:
    """Return whether a request provably reads: by its method, its target, its fields, and no body to hide another in.

    Raw bytes never do: each server reads them in its own way.
    """
    target = urlsplit(request.url)
    path, query = _decode(target.path), _decode(target.query)
    parts = (query, *(part for pair in request.headers for part in pair))
    alters = any(map(_OVERRIDES.search, parts)) or any(_ALTERS.search(name) for name, _ in request.headers)
    if request.raw is not None or alters:
        return False
    if request.method == "POST":
        return _asks(request)
    said = f"{path} {_DATA.sub('', query)}"
    warns = harmful_words(Operation(said, request.method, said)) or not _ACTS.isdisjoint(words_of(said))
    allowed = permission is None or not permission.refusal(request.method, request.url)
    return request.method in SAFE_METHODS and not request.body and not warns and allowed


def _decode(text: str) -> str:
    """Return a part of a target without percent-encoding, however often it was encoded."""
    for _ in range(_MOST_DECODINGS):
        before, text = text, unquote(text)
        if text == before:
            break
    return text


def _asks(request: Request) -> bool:
    """Return whether a request is a SOAP message for a read-only operation of the contract, to the service's path."""
    # Imported late: lxml and xmlschema cost a third of a second that a REST finding need not pay.
    from conformance.api.soap.envelope import NotSoapError, read  # noqa: PLC0415

    try:
        message = read(request.body)
    except NotSoapError:
        return False
    places, questions = _questions()
    asked = {str(element.tag) for element in message.payload}
    return urlsplit(request.url).path in places and len(message.payload) == 1 and asked <= questions


@cache
def _questions() -> tuple[frozenset[str], frozenset[str]]:
    """Return the paths of the contract's subscribers service, and the input elements of its operations."""
    from conformance.documents.wsdl import read_file  # noqa: PLC0415 - as above

    path = Contract.load().subscribers_path
    found = read_file(path) if path else None
    if found is None:
        return frozenset(), frozenset()
    places = (str(element.get("location")) for element in found.all("w:service/w:port/s:address"))
    inputs = (operation.request for operation in found.operations)
    return frozenset(urlsplit(place).path for place in places), frozenset(filter(None, inputs))
