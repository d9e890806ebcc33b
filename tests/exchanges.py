"""Exchanges with JSON bodies, and the cases that fail where the checkers judge exchanges of one device."""

import json
from collections.abc import Collection, Iterable
from typing import Any
from urllib.parse import urlsplit

from conformance.checkers.rest import RestCheckers
from conformance.contract.pack import Contract
from conformance.transport.exchange import Exchange, Request, Response, Unanswered

JSON = ("Content-Type", "application/json")


def exchange(
    method: str,
    url: str,
    status: int = 200,
    shown: Any = None,
    *,
    sent: Any = None,
    kind: str = "application/json",
    asked: Iterable[tuple[str, str]] = (),
    told: Collection[tuple[str, str]] = (),
    at_s: float = 0.0,
) -> Exchange:
    """Return an exchange with the bodies `sent` and `shown`; None is no body.

    Args:
        method, url, status: as the request and the response have them.
        shown: the value in the response.
        sent: the value in the request; kind: its media type.
        asked: further fields of the request.
        told: further fields of the response.
        at_s: when the response was received.
    """
    content, body = (b"" if value is None else json.dumps(value).encode() for value in (sent, shown))
    fields = (("Host", urlsplit(url).netloc), *asked, *([("Content-Type", kind)] if content else []))
    is_typed = any(name == "Content-Type" for name, _ in told)
    answer = Response(status, (*told, *([JSON] if body and not is_typed else [])), body, 1.0, received_s=at_s)
    return Exchange(Request(method, url, fields, content), answer)


def failed(contract: Contract, base: str, attempts: Iterable[Exchange | Unanswered]) -> list[Any]:
    """Return the cases that do not hold, of all checkers that see these exchanges one after the other."""
    checkers = RestCheckers(contract, base)
    return [case for attempt in attempts for case in checkers(attempt) if not case.holds]


def broken(contract: Contract, base: str, attempts: Iterable[Exchange | Unanswered]) -> set[str]:
    """Return the requirements of these cases."""
    return {case.requirement for case in failed(contract, base, attempts)}
