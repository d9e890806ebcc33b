"""The facts about a request that decide which requirements apply: path, operation, and whether it is unusual."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property

from conformance.api.rest.formats import accept_of, quality
from conformance.contract.pack import Contract
from conformance.documents.openapi import Operation, is_normal, matching
from conformance.transport.credentials import is_shown
from conformance.transport.exchange import Request, Response

_USUAL_FIELDS = {
    "host",
    "accept",
    "content-type",
    "content-length",
    "transfer-encoding",
    "authorization",
    "connection",
    "user-agent",
}
_USUAL_OCTETS = 2000
# Headers that ask for a part or set a condition.
_CONDITIONS = frozenset({"range", "if-none-match", "if-modified-since", "if-match", "if-unmodified-since"})
_CONDITIONAL = frozenset({206, 304, 412, 416})  # statuses that only such requests get (RFC 9110 13, 14)


@dataclass(frozen=True)
class RequestContext:
    """One request, seen from the contract.

    Attributes:
        request: as it went out.
        target: path and query below the base URL.
        operation: the one that it is for, or None; also where a server may make another path of it.
    """

    request: Request
    target: str
    operation: Operation | None

    @classmethod
    def of(cls, contract: Contract, base_url: str, request: Request) -> RequestContext | None:
        """Return a request with what the contract says about it; None if it went to another server."""
        if not request.url.startswith(base_url):
            return None
        target = request.url[len(base_url) :]
        if target and target[0] not in "/?":
            return None
        path = target.split("?", 1)[0]
        return cls(request, target, matching(contract, request.method, path) if is_normal(path) else None)

    @property
    def is_head(self) -> bool:
        """Whether the answer has no body because of the method."""
        return self.request.method == "HEAD"

    @cached_property
    def accept(self) -> str | None:
        """The Accept field, or None."""
        return accept_of(self.request.headers)

    @cached_property
    def usual(self) -> bool:
        """Whether nothing in it but parameters and body could be a reason to refuse it."""
        return self._has_only(_USUAL_FIELDS)

    @cached_property
    def is_usual_in_any_coding(self) -> bool:
        """Whether it is usual but for the content codings that it accepts."""
        return self._has_only(_USUAL_FIELDS | {"accept-encoding"})

    @cached_property
    def is_simple(self) -> bool:
        """Whether it is usual but for a condition, which held if the response is a success."""
        return self._has_only(_USUAL_FIELDS | _CONDITIONS)

    def _has_only(self, fields: Collection[str]) -> bool:
        names = [name.lower() for name, value in self.request.headers if not is_shown(value)]
        return (
            self.request.raw is None
            and set(names) <= set(fields)
            and names.count("host") == 1
            and self.request.size - len(self.request.body) < _USUAL_OCTETS
        )

    def is_own_of(self, answer: Response) -> bool:
        """Return whether the server itself sends a response, to a condition or range, so that no description has it."""
        asked = any(name.lower() in _CONDITIONS for name, _ in self.request.headers)
        return asked and answer.status in _CONDITIONAL

    @property
    def plain(self) -> bool:
        """Whether it is usual, and has neither parameters nor a body."""
        return self.usual and "?" not in self.target and not self.request.body

    @cached_property
    def likes_json(self) -> float:
        """How much the client wants errors as JSON."""
        return max(quality("application/json", self.accept), quality("application/problem+json", self.accept))

    @cached_property
    def likes_xml(self) -> float:
        """How much the client wants errors as XML."""
        return max(quality("application/xml", self.accept), quality("application/problem+xml", self.accept))

    @property
    def names_xml(self) -> bool:
        """Return whether the client's Accept names XML."""
        return "xml" in (self.accept or "").lower() and self.likes_xml > 0
