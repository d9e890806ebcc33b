"""Records of deliveries that were sent and of the messages that arrived, as data that rules can judge."""

from collections.abc import Iterator
from dataclasses import dataclass
from http import HTTPStatus
from typing import Final

from conformance.packs.table1.robot.delivery import Delivery
from conformance.transport.exchange import Exchange

# A gateway sends these whether or not the robot received the request (RFC 9110 15.6.3, 15.6.5).
_UNKNOWN: Final = frozenset({HTTPStatus.BAD_GATEWAY, HTTPStatus.GATEWAY_TIMEOUT})


@dataclass(frozen=True)
class Seen:
    """A delivery that arrived.

    Attributes:
        delivery: its values.
        interface: "rest" or "soap", where the observer sees that, else empty.
    """

    delivery: Delivery
    interface: str = ""


@dataclass(frozen=True)
class Sent:
    """A delivery that was sent.

    Attributes:
        how: rest, soap, coffee, same (over REST and then over SOAP), twice (the same request over REST again), or
            together (at the same moment as others).
        interface: rest or soap.
        delivery: its values.
        exchange: request and response; None: no response came.
    """

    how: str
    interface: str
    delivery: Delivery
    exchange: Exchange | None

    @property
    def is_ok(self) -> bool:
        """Return whether the robot accepted the delivery."""
        return self.exchange is not None and self.exchange.response.ok

    @property
    def may_arrive(self) -> bool:
        """Return whether the response does not show if the robot received the request."""
        return self.exchange is None or self.exchange.response.status in _UNKNOWN


@dataclass(frozen=True)
class Batch:
    """Deliveries that were sent one after another or together, and the deliveries that arrived meanwhile, in order."""

    sent: tuple[Sent, ...]
    seen: tuple[Seen, ...]


@dataclass(frozen=True)
class Deliveries:
    """All batches of a run.

    Attributes:
        batches: oldest first; a batch in which nothing was sent shows what arrived later.
        exact: whether the observer sees even the sign of a zero, which JSON may lose.
        first: index of the first batch to judge; the ones before it were judged with an earlier trace.
    """

    batches: tuple[Batch, ...] = ()
    exact: bool = True
    first: int = 0

    def key(self, delivery: Delivery) -> bytes:
        """Return a key that is equal for deliveries that the observer cannot tell apart."""
        return key_of(delivery, exact=self.exact)

    def batches_to_judge(self) -> Iterator[tuple[Batch, tuple[Batch, ...]]]:
        """Yield each batch to judge, with the batches before it."""
        for index in range(self.first, len(self.batches)):
            yield self.batches[index], self.batches[:index]


def key_of(delivery: Delivery, *, exact: bool) -> bytes:
    """Return the bytes of a delivery's values; where they are not ``exact``, -0.0 counts as 0.0."""
    if not exact:
        delivery = Delivery(delivery.message_code, *(value + 0.0 for value in delivery[1:]))
    return delivery.bits
