"""Deliveries with an Idempotency-Key: one key may give one message; two keys give two."""

import uuid
from collections import Counter
from collections.abc import Sequence
from http import HTTPStatus

import pytest

from conformance.api.rest.interface import RestInterface
from conformance.packs.table1.delivery import COURIER
from conformance.packs.table1.robot.deliveries_seen import NoObserverError, observer_of
from conformance.packs.table1.robot.delivery import Delivery, put_delivery
from conformance.packs.table1.robot.probe.client import ProbeError, RosProbe
from conformance.transport.exchange import Exchange
from conformance.verdict.evidence import Judge

pytestmark = [pytest.mark.phase("effect"), pytest.mark.needs("rest"), pytest.mark.motion]
_TWICE = Delivery(COURIER, 70.5, 71.5, 72.5, 73.5, 74.5, 75.5)
_APART = Delivery(COURIER, 80.5, 81.5, 82.5, 83.5, 84.5, 85.5)


def _put(api: RestInterface, delivery: Delivery, keys: Sequence[str]) -> list[Exchange]:
    """PUT a delivery once with each key, each on a new connection so that the client does not retry."""
    fields = [(("Idempotency-Key", f'"{key}"'),) for key in keys]
    return [put_delivery(api, delivery.rest_path, headers=field, fresh=True) for field in fields]


@pytest.mark.requirement("equivalence/idempotency-key", "equivalence/idempotency-other-key")
def test_keys(api: RestInterface, probe: RosProbe, judge: Judge) -> None:
    """Send two requests with one key (one message, or two from a robot without keys) and two with two keys (two)."""
    try:
        observer = observer_of(api, probe)
        observer.mark()
        # No robot may know the keys from a run before.
        first, second, third = (str(uuid.uuid4()) for _ in range(3))
        twice, apart = _put(api, _TWICE, (first, first)), _put(api, _APART, (second, third))
        accepted = sum(exchange.response.ok for exchange in apart)
        arrived = Counter(one.delivery for one in observer.collect(1 + accepted))
        # Where keys are not taken, another message has come in the place of the last one.
        lacking = accepted - arrived[_APART]
        arrived += Counter(one.delivery for one in (observer.collect(lacking) if lacking > 0 else ()))
    except (NoObserverError, ProbeError) as nobody:
        pytest.skip(str(nobody))
    if not accepted or not twice[0].response.ok:
        pytest.skip(f"deliveries with an Idempotency-Key are answered {apart[0].came}")
    statuses = [exchange.response.status for exchange in twice]
    judge.check(
        "equivalence/idempotency-key",
        arrived[_TWICE] == 1 and statuses[0] == statuses[1] < HTTPStatus.MULTIPLE_CHOICES,
        twice[1],
        "one message, and the same status twice, for two requests with one Idempotency-Key",
        found=f"{arrived[_TWICE]} messages, statuses {statuses[0]} and {statuses[1]}",
        cause="not taken",
    )
    judge.check(
        "equivalence/idempotency-other-key",
        arrived[_APART] == accepted,
        apart[1],
        "a message for each of two accepted requests with Idempotency-Keys of their own",
        found=f"{arrived[_APART]} messages for {accepted} accepted requests",
        cause="lost",
    )
