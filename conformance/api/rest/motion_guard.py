"""Keep random requests harmless: accepted commands stay slow, near and rare."""

from collections import Counter
from dataclasses import replace
from typing import Any

from conformance.api.rest.applicable import allows
from conformance.api.rest.calls import JSON, example_call
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.validity import INVALID, VALID, Validity, validity
from conformance.documents.json_text import read_json
from conformance.documents.openapi import Operation
from conformance.documents.writing import json_text
from conformance.transport.exchange import Outgoing

# How many valid requests are sent to one operation that moves the robot: each may start a mission.
_ACCEPTED = 3
# Greatest number in an invalid body: a robot that accepts it wrongly must not drive fast.
_SLOW = 0.1


class MotionGuard:
    """Examines and adapts random requests before they are sent."""

    def __init__(self, api: RestInterface) -> None:
        self._api = api
        self._valid: Counter[str] = Counter()

    def admit(self, item: Outgoing) -> Outgoing | None:
        """Return a request with safe values, or None if it may not be sent."""
        said = self._validity(item)
        operation = said.operation
        if operation is None:
            return item if self._may_reach(item) else None
        if not allows(self._api, operation):
            return None
        if not operation.motion:
            return item
        if said.verdict == VALID:
            return self._fit(item, operation)
        if not self._api.device.is_known:
            return item
        # A body without any rule is not sent to a robot; a body that the robot must refuse is sent with low numbers.
        return self._slow(item) if said.verdict == INVALID else None

    def count(self, item: Outgoing, *, accepted: bool) -> None:
        """Count an accepted request."""
        operation = self._validity(item).operation
        if accepted and operation is not None and operation.motion:
            self._valid[operation.id] += 1

    def _validity(self, item: Outgoing) -> Validity:
        return validity(self._api.run.contract, item.method, item.target, item.media_type, item.body)

    def _may_reach(self, item: Outgoing) -> bool:
        """Return whether a request with a method that its resource does not support may be sent."""
        return self._api.run.allow_motion or item.method in {"GET", "HEAD", "OPTIONS", "TRACE"} or not item.body

    def _fit(self, item: Outgoing, operation: Operation) -> Outgoing | None:
        """Return a valid request of a moving operation with sensible values; None after _ACCEPTED of them."""
        if self._valid[operation.id] >= _ACCEPTED:
            return None
        if not self._api.device.is_known:
            return item
        call = example_call(self._api, operation, item.media_type or JSON)
        return replace(item, target=call.path, body=call.body if operation.bodies else item.body)

    def _slow(self, item: Outgoing) -> Outgoing:
        text = read_json(item.body)
        if not item.body or text.problem or item.media_type != JSON:
            return item
        return replace(item, body=json_text(_slow_down(text.value)).encode())


def _slow_down(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _slow_down(item) for name, item in value.items()}
    if isinstance(value, list):
        return [_slow_down(item) for item in value]
    if isinstance(value, float) and abs(value) > _SLOW:
        return _SLOW
    return 1 if isinstance(value, int) and not isinstance(value, bool) and abs(value) > 1 else value
