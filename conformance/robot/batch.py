"""Deliveries sent one after another over both interfaces, and what arrived of each."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from conformance.contract.delivery import COFFEE
from conformance.robot.deliveries_seen import DeliveryObserver, Seen
from conformance.robot.delivery import Delivery, path_of
from conformance.robot.soap_services import send_delivery
from conformance.soap.service import SoapService
from conformance.transport.client import HttpClient
from conformance.transport.exchange import Exchange
from conformance.verdict.evidence import Judge

REQUIREMENT: Final = {
    "rest": "equivalence/delivery-rest",
    "soap": "equivalence/delivery-soap",
    "coffee": "equivalence/coffee-soap",
    "same": "equivalence/delivery-same",
}


@dataclass(frozen=True)
class Order:
    """One delivery to be sent.

    Attributes:
        how: rest, soap, coffee, or same: over REST and then over SOAP.
        delivery: its values.
        written: the same for a path.
    """

    how: str
    delivery: Delivery
    written: tuple[str, ...]


@dataclass(frozen=True)
class _Sent:
    how: str
    interface: str
    delivery: Delivery
    exchange: Exchange


class Batch:
    """Sends orders and judges what became of them.

    Args:
        rest, publishers: the interfaces.
        observer: sees what arrives.
        judge: is told.
    """

    def __init__(self, rest: HttpClient, publishers: SoapService, observer: DeliveryObserver, judge: Judge) -> None:
        self._rest, self._publishers = rest, publishers
        self._observer, self._judge = observer, judge

    def run(self, orders: Sequence[Order]) -> bool:
        """Send the orders, then judge each; whether all was well.

        Orders must differ in their values: by them they are known again.
        """
        self._observer.mark()
        sent = [one for order in orders for one in self._send(order)]
        accepted = [one for one in sent if one.exchange.response.ok]
        seen = self._observer.collect(len(accepted))
        return self._judge_each(accepted, seen) & self._judge_order(accepted, seen)

    def _send(self, order: Order) -> list[_Sent]:
        delivery, sent = order.delivery, []
        if order.how in {"rest", "same"}:
            # On a connection of its own, so that nothing is sent again.
            exchange = self._rest.send("PUT", path_of(*order.written), fresh=True)
            sent.append(_Sent(order.how, "rest", delivery, exchange))
        if order.how in {"soap", "same"}:
            sent.append(_Sent(order.how, "soap", delivery, send_delivery(self._publishers, delivery)))
        if order.how == "coffee":
            delivery = delivery._replace(message_code=COFFEE)
            sent.append(_Sent("coffee", "soap", delivery, send_delivery(self._publishers, delivery, coffee=True)))
        return sent

    def _key(self, delivery: Delivery) -> bytes:
        """What a delivery is known by: all its bits, or its values where the observer does not see the sign of zero."""
        if not self._observer.exact:
            delivery = type(delivery)(delivery.message_code, *(value + 0.0 for value in delivery[1:]))
        return delivery.bits

    def _judge_each(self, sent: list[_Sent], seen: list[Seen]) -> bool:
        arrived = Counter(self._key(one.delivery) for one in seen)
        asked = Counter(self._key(one.delivery) for one in sent)
        strangers = [one.delivery for one in seen if self._key(one.delivery) not in asked]
        well = True
        for one in sent:
            key = self._key(one.delivery)
            count, wanted = arrived[key], asked[key]
            interfaces = sorted(item.interface for item in seen if self._key(item.delivery) == key)
            problem = ""
            if count != wanted:
                problem = f"{count} instead of {wanted}" if count or not strangers else f"not it, but {strangers[0]}"
            elif any(interfaces) and one.how != "same" and interfaces != [one.interface]:
                problem = f"one by {', '.join(interfaces)}"
            elif any(interfaces) and one.how == "same" and interfaces != ["rest", "soap"]:
                problem = f"two by {' and '.join(interfaces)}"
            well &= self._judge.check(
                REQUIREMENT[one.how],
                not problem,
                one.exchange,
                f"exactly one message for each accepted request, {one.delivery}",
                found=problem,
                cause=f"{one.interface} {problem.split(',')[0]}",
            )
        return well

    def _judge_order(self, sent: list[_Sent], seen: list[Seen]) -> bool:
        """What was sent over one interface arrives in that order; two interfaces may have a publisher each."""
        well = True
        for interface in ("rest", "soap"):
            wanted = [self._key(one.delivery) for one in sent if one.interface == interface and one.how != "same"]
            found = [key for key in (self._key(one.delivery) for one in seen) if key in wanted]
            there = [key for key in wanted if key in found]
            last = next((one for one in sent if one.interface == interface), None)
            if len(there) > 1 and last is not None:
                once = list(dict.fromkeys(found))
                well &= self._judge.check(
                    "equivalence/delivery-order",
                    once == there,
                    last.exchange,
                    f"deliveries over {interface} in the order in which they were sent",
                    found="another order",
                )
        return well
