"""What an exchange can be judged for: computed once, from its bytes and the description, for all REST checkers."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from http import HTTPStatus
from typing import Any, Final

from conformance.api.rest.request_context import RequestContext
from conformance.api.rest.things import object_in
from conformance.api.rest.validity import VALID, Validity, validity
from conformance.contract.pack import Contract
from conformance.documents.json_text import read_json
from conformance.documents.openapi import Operation, is_json
from conformance.documents.parameters import plain_name
from conformance.transport.exchange import Exchange, Request, Response
from conformance.verdict.evidence import Case

#: A device may carry out what a request asks for this long after its response, s.
SETTLES_S: Final = 3.0
#: Bodies of more bytes are not remembered.
MOST_OCTETS: Final = 65_536
#: Statuses of what is not there.
ABSENT: Final = frozenset({HTTPStatus.NOT_FOUND, HTTPStatus.GONE})
#: Methods that every server knows. A request with another method may never reach a resource.
METHODS: Final = frozenset({"GET", "HEAD", "PUT", "POST", "DELETE", "PATCH", "OPTIONS"})


@dataclass(frozen=True)
class Occasion:
    """One exchange with the REST interface of a device.

    Attributes:
        contract: by which it is judged.
        exchange: request and response.
        context: what the contract says about the request.
        is_allowed: whether the request is known to be valid, by the schema of its own message.
    """

    contract: Contract
    exchange: Exchange
    context: RequestContext
    is_allowed: bool = False

    @property
    def request(self) -> Request:
        """The request."""
        return self.exchange.request

    @property
    def response(self) -> Response:
        """The response."""
        return self.exchange.response

    @property
    def operation(self) -> Operation | None:
        """The operation of the request, or None."""
        return self.context.operation

    @property
    def sent_s(self) -> float:
        """When the request was sent, s of the monotonic clock."""
        return self.response.received_s - self.response.elapsed_ms / 1000

    def members(self, names: Iterable[str]) -> dict[str, Any]:
        """Return the object in the JSON response that has the most members of these names; empty without one."""
        is_whole = is_json(self.response.media_type) and not self.response.cut
        return object_in(read_json(self.response.body).value if is_whole else None, {*map(plain_name, names)})

    @cached_property
    def validity(self) -> Validity:
        """Whether the contract allows the parameters and the body."""
        request = self.request
        return validity(self.contract, request.method, self.context.target, request.media_type, request.body)

    @property
    def is_valid(self) -> bool:
        """Return whether the contract allows the request, so that its content is no reason to refuse it."""
        return self.is_allowed or self.validity.verdict == VALID

    def case(
        self,
        requirement: str,
        holds: bool,  # noqa: FBT001 - reads as a sentence: occasion.case(id, status < 500, ...)
        expected: str,
        found: str = "",
        *,
        cause: str = "",
        doubt: str = "",
    ) -> Case:
        """Return a case of a requirement; the arguments are as in Case."""
        return Case(holds, self.exchange, expected, found, cause, requirement=requirement, doubt=doubt)
