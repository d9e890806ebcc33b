"""Deliveries with an Idempotency-Key."""

import uuid
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from conformance.api.rest.interface import RestInterface
from conformance.packs.table1.delivery import COURIER
from conformance.packs.table1.robot.deliveries_seen import NoObserverError, observer_of
from conformance.packs.table1.robot.delivery import Delivery, put_delivery
from conformance.packs.table1.robot.probe.client import ProbeError, RosProbe
from conformance.scenarios.scenario import NotPossibleError, scenario
from conformance.scenarios.stage import Leaves, Need, Stage
from conformance.transport.exchange import Exchange

_TWICE: Final = Delivery(COURIER, 70.5, 71.5, 72.5, 73.5, 74.5, 75.5)
_APART: Final = Delivery(COURIER, 80.5, 81.5, 82.5, 83.5, 84.5, 85.5)


@dataclass(frozen=True)
class KeyedDeliveries:
    """Two pairs of identical deliveries.

    Attributes:
        twice: the exchanges of two requests with one key.
        apart: the exchanges of two requests with a key each.
        twice_arrived: number of messages for the first pair.
        apart_arrived: number of messages for the second pair.
    """

    twice: tuple[Exchange, ...]
    apart: tuple[Exchange, ...]
    twice_arrived: int
    apart_arrived: int

    @property
    def accepted_apart(self) -> int:
        """Return how many requests of the second pair the robot accepted."""
        return sum(exchange.response.ok for exchange in self.apart)


@scenario(needs={Need.REST, Need.MOTION}, leaves=Leaves.UNTOUCHED, stage=Stage.EFFECT)
def keyed_deliveries(api: RestInterface, probe: RosProbe) -> KeyedDeliveries:
    """Send a delivery twice with one Idempotency-Key, and another twice with two keys."""
    try:
        observer = observer_of(api, probe)
        observer.mark()
        # No robot may know the keys from an earlier run.
        first, second, third = (str(uuid.uuid4()) for _ in range(3))
        twice, apart = _put(api, _TWICE, (first, first)), _put(api, _APART, (second, third))
        accepted = sum(exchange.response.ok for exchange in apart)
        arrived = [one.delivery for one in observer.collect(1 + accepted)]
        # A robot that ignores keys makes a second message of the first pair, in the place of the last one here.
        lacking = accepted - arrived.count(_APART)
        arrived += (one.delivery for one in (observer.collect(lacking) if lacking > 0 else ()))
    except (NoObserverError, ProbeError) as error:
        raise NotPossibleError(str(error)) from error
    return KeyedDeliveries(twice, apart, arrived.count(_TWICE), arrived.count(_APART))


def _put(api: RestInterface, delivery: Delivery, keys: Sequence[str]) -> tuple[Exchange, ...]:
    """PUT a delivery once with each key, each on a new connection so that the client does not retry."""
    fields = [(("Idempotency-Key", f'"{key}"'),) for key in keys]
    return tuple(put_delivery(api, delivery.rest_path, headers=field, fresh=True) for field in fields)
