"""Decide whether sending a recorded finding's requests again may move the robot or reach an unknown server.

A result file may come from anybody. So the bytes of the requests are examined, and nothing that the result claims
about them is trusted. A request that is not provably harmless may move the robot.
"""

import re
from collections.abc import Iterable, Mapping
from functools import cache
from typing import Any, Final
from urllib.parse import urlsplit

from conformance.contract.pack import Contract
from conformance.engine.resending import read_request
from conformance.transport.exchange import SAFE_METHODS, Request

# Servers differ in where they see one request end and the next one begin, so a method that writes counts wherever it
# stands; and some take the method from a field (X-HTTP-Method-Override).
_WRITES: Final = re.compile(rb"(?:PUT|POST|DELETE|PATCH)[ \t]|method", re.IGNORECASE)
_PORTS: Final = {"http": 80, "https": 443}


def moves(failure: Mapping[str, Any]) -> bool:
    """Return whether sending a finding's requests again may move the robot.

    Raises:
        ValueError, KeyError, TypeError: the finding is malformed.
    """
    requests = (read_request(item) for item in failure.get("sequence") or ())
    # What was too large to be kept is not sent.
    return any(request is not None and not _only_reads(request) for request in requests)


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


def _only_reads(request: Request) -> bool:
    if request.raw is not None:
        return not _WRITES.search(request.raw)
    if any(_WRITES.search(f"{name}: {value}".encode()) for name, value in request.headers):
        return False
    return request.method in SAFE_METHODS or (request.method == "POST" and _asks(request.body))


def _asks(body: bytes) -> bool:
    """Return whether a body is a SOAP message for one of the contract's read-only operations."""
    # Imported late: lxml and xmlschema cost a third of a second that a REST finding need not pay.
    from conformance.api.soap.envelope import NotSoapError, read  # noqa: PLC0415

    try:
        message = read(body)
    except NotSoapError:
        return False
    return len(message.payload) == 1 and str(message.payload[0].tag) in _questions()


@cache
def _questions() -> frozenset[str]:
    """Return the input elements of the operations of the contract's subscribers service."""
    from conformance.documents.wsdl import read_file  # noqa: PLC0415 - as above

    operations = read_file(path).operations if (path := Contract.load().subscribers_path) else ()
    return frozenset(operation.request for operation in operations if operation.request)
