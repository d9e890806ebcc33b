"""Keep successful exchanges of a run, to compare them with the robot's own description."""

from dataclasses import replace
from typing import Final

from conformance.api.rest.description import Described
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.request_context import RequestContext
from conformance.api.rest.validity import INVALID, VALID, validity, validity_by
from conformance.documents.json_shape import shape_of
from conformance.documents.json_text import read_json
from conformance.documents.openapi import is_json
from conformance.documents.patterns import PatternError
from conformance.transport.exchange import Exchange, Listener

# Exchanges of different lengths that are kept for each operation.
_MOST: Final = 12


class KeptExchanges(Listener):
    """Keeps some successful exchanges for each operation: the first ones, and the one with the longest request.

    Args:
        api: the robot's REST interface.

    Attributes:
        kept: the exchanges with their operations.
    """

    def __init__(self, api: RestInterface) -> None:
        self.kept: dict[str, list[tuple[RequestContext, Exchange]]] = {}
        self._api = api
        self._lengths: set[tuple[str, int, int]] = set()

    def answered(self, exchange: Exchange) -> None:
        """Keep an exchange if it is of another length than those before."""
        request, answer = exchange.request, exchange.response
        if not answer.ok or request.raw is not None or request.method in {"HEAD", "OPTIONS"}:
            return
        context = RequestContext.of(self._api.run.contract, self._api.client.base_url, request)
        if context is None or context.operation is None:
            return
        label = context.operation.label
        lengths = (label, request.size, len(answer.body))
        kept = self.kept.setdefault(label, [])
        if lengths in self._lengths:
            return
        if len(kept) < _MOST:
            kept.append((context, exchange))
            self._lengths.add(lengths)
        elif request.size > kept[-1][1].request.size:
            kept[-1] = context, exchange


def contradiction(api: RestInterface, theirs: Described, context: RequestContext, exchange: Exchange) -> str:
    """Return how a successful exchange contradicts the robot's description, or an empty text.

    Args:
        api: the robot's REST interface.
        theirs: the operation in the robot's description.
        context: the request, which the robot has accepted; it counts only if the contract allows it.
        exchange: request and response.
    """
    request, answer = exchange.request, exchange.response
    own = replace(theirs.operation, template=theirs.path)
    if validity(api.run.contract, request.method, context.target, request.media_type, request.body).verdict == VALID:
        path, _, query = context.target.partition("?")
        said = validity_by(own, path, query, request.media_type, request.body)
        if said.verdict == INVALID:
            return f"a request that the description forbids: {said.why}"
    schema = (own.declared(answer.status) or {}).get(answer.media_type)
    text = read_json(answer.body) if schema and is_json(answer.media_type) else None
    try:
        problem = shape_of(schema).problem(text.value) if schema and text and not text.problem else ""
    except PatternError:
        problem = ""  # another requirement says that the schema cannot be used
    return f"a response that the description does not have: {problem}" if problem else ""
