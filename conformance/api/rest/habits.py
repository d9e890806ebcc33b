"""Properties of a device that a run learns from its responses, such as slow operations."""

from collections.abc import Iterator

from conformance.api.rest.interface import RestInterface
from conformance.api.rest.request_context import RequestContext
from conformance.transport.exchange import Attempt, Exchange
from conformance.verdict.evidence import Case

# An operation whose response once took longer than this is called less often, ms.
_SLOW_MS = 1000.0


class Habits:
    """A checker that learns the device's server field, its slow operations, and the values that it refuses."""

    def __init__(self, api: RestInterface) -> None:
        self._api = api

    def __call__(self, exchange: Attempt) -> Iterator[Case]:
        """Learn from one exchange with this interface; it judges nothing."""
        if not isinstance(exchange, Exchange):
            return iter(())
        api, answer = self._api, exchange.response
        context = RequestContext.of(api.run.contract, api.client.base_url, exchange.request)
        if context is None:
            return iter(())
        api.server = api.server or answer.header("server") or ""
        operation = context.operation
        if operation is None or context.is_own_of(answer):
            return iter(())
        if exchange.request.method == "GET":
            api.reads[operation.label] += 1
        if answer.elapsed_ms > _SLOW_MS:
            api.slow.add(operation.label)
        if api.values is not None and not operation.safe:
            api.values.learn(operation, exchange)
        return iter(())
