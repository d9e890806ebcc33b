"""Deliveries sent one after another over both interfaces, and what arrived of each.

Whether each has arrived is seen as soon as all have; that none comes twice is seen until the last batch has been
watched for a while, so that the batches need no pause between them.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from http import HTTPStatus
from itertools import chain, cycle
from typing import Final

from conformance.api.soap.service import SoapService
from conformance.api.soap.xml_style import value_styles
from conformance.observe.clock import WALL_CLOCK
from conformance.packs.table1.delivery import COFFEE
from conformance.packs.table1.robot.deliveries_seen import DeliveryObserver, Seen
from conformance.packs.table1.robot.delivery import Delivery, path_of
from conformance.packs.table1.robot.soap_services import delivery_outgoing, send_delivery
from conformance.transport.client import HttpClient
from conformance.transport.exchange import Exchange
from conformance.transport.parallel import Outgoing, send_together
from conformance.verdict.evidence import Judge

REQUIREMENT: Final = {
    "rest": "equivalence/delivery-rest",
    "soap": "equivalence/delivery-soap",
    "coffee": "equivalence/coffee-soap",
    "same": "equivalence/delivery-same",
    "twice": "equivalence/delivery-repeated",
    "together": "equivalence/delivery-concurrent",
}
_TOGETHER: Final = "together"
# A gateway before the robot says so of what the robot may have taken (RFC 9110 15.6.3, 15.6.5).
_UNKNOWN: Final = frozenset({HTTPStatus.BAD_GATEWAY, HTTPStatus.GATEWAY_TIMEOUT})
_ONLY: Final = "equivalence/delivery-only"
# Orders of which each makes two messages.
_TWO: Final = {"same": ["rest", "soap"], "twice": ["rest", "rest"]}
# Of what nobody asked for in so many batches, nobody but the robot can be the author.
_OFTEN: Final = 2


@dataclass(frozen=True)
class Order:
    """One delivery to be sent.

    Attributes:
        how: rest, soap, coffee, same (over REST and then over SOAP), or twice (the same request over REST again).
        delivery: its values.
        written: the same for a path.
    """

    how: str
    delivery: Delivery
    written: tuple[str, ...]


@dataclass(frozen=True)
class _Sent:
    """A delivery that was accepted; ``how`` as in an order, or together with those of other clients."""

    how: str
    interface: str
    delivery: Delivery
    exchange: Exchange


class Batch:
    """Sends orders and judges what became of them, batch by batch.

    Args:
        rest, publishers: the interfaces.
        observer: sees what arrives.
        judge: takes the evidence.
    """

    def __init__(self, rest: HttpClient, publishers: SoapService, observer: DeliveryObserver, judge: Judge) -> None:
        self._rest, self._publishers = rest, publishers
        self._observer, self._judge = observer, judge
        # What was sent in earlier batches, by its key, and how many batches had messages that nobody asked for.
        self._earlier: dict[bytes, _Sent] = {}
        self._unsent = 0
        # What was not accepted, by its key.
        self._refused: dict[bytes, Exchange] = {}
        # Of what was sent without an answer, by its key: it may arrive, whenever.
        self._maybe: set[bytes] = set()
        # However its XML is written, a message has the same values; one that is refused for it is for others to judge.
        self._styles = cycle(value_styles())
        # When the last batch had been collected, s of the monotonic clock.
        self._collected = WALL_CLOCK.now()
        observer.mark()

    def run(self, orders: Sequence[Order]) -> bool:
        """Send the orders, then judge each; whether all was well.

        Orders must differ in their values, also from those of earlier batches: by them they are known again.
        """
        sent = [one for order in orders for one in self._send(order)]
        accepted = self._accepted(sent)
        seen = self._collect(accepted)
        well = self._judge_each(accepted, seen) & self._judge_order(accepted, seen)
        return self._judge_only(accepted, seen) and well

    def run_together(self, rounds: Sequence[Sequence[tuple[str, Delivery]]]) -> bool:
        """Send deliveries by (how, values), those of a round at one moment, then judge each; whether all was well."""
        outgoing = [[self._outgoing(how, delivery) for how, delivery in turn] for turn in rounds]
        attempts = send_together(outgoing)
        sent = []
        for (how, delivery), attempt in zip(chain(*rounds), chain(*attempts), strict=True):
            if not isinstance(attempt, Exchange):
                # Nobody knows what became of it: a robot that closes a connection may have read the request.
                self._maybe.add(self._key(delivery))
            else:
                sent.append(_Sent(_TOGETHER, "rest" if how == "rest" else "soap", delivery, attempt))
        accepted = self._accepted(sent)
        seen = self._collect(accepted)
        well = self._judge_each(accepted, seen)
        return self._judge_only(accepted, seen) and well

    def finish(self, watched_s: float) -> None:
        """Judge what arrived later than it should, in so many seconds since the last batch, which may have passed."""
        left_s = self._collected + watched_s - WALL_CLOCK.now()
        self._judge_only([], self._observer.collect(0, max(0.0, left_s)))

    def look_again(self) -> None:
        """Judge whether an earlier delivery has come again since, whatever else was sent meanwhile."""
        seen = self._observer.collect(0, 0.0)
        self._judge_again([one.delivery for one in seen if self._key(one.delivery) in self._earlier])

    def _accepted(self, sent: Sequence[_Sent]) -> list[_Sent]:
        """Return the deliveries that were accepted, and remember the others."""
        for one in sent:
            if one.exchange.response.status in _UNKNOWN:
                self._maybe.add(self._key(one.delivery))
            elif not one.exchange.response.ok:
                self._refused[self._key(one.delivery)] = one.exchange
        return [one for one in sent if one.exchange.response.ok]

    def _collect(self, sent: Sequence[_Sent]) -> list[Seen]:
        """Return what arrived since the last call; wait a little longer if that is not what was sent."""
        seen = self._observer.collect(len(sent), 0.0)
        if sorted(self._key(one.delivery) for one in seen) != sorted(self._key(one.delivery) for one in sent):
            seen += self._observer.collect(0)
        self._collected = WALL_CLOCK.now()
        return seen

    def _send(self, order: Order) -> list[_Sent]:
        delivery, sent = order.delivery, []
        for _ in range({"rest": 1, "same": 1, "twice": 2}.get(order.how, 0)):
            # On a connection of its own, so that nothing is sent again.
            exchange = self._rest.send("PUT", path_of(*order.written), fresh=True)
            sent.append(_Sent(order.how, "rest", delivery, exchange))
        if order.how in {"soap", "same"}:
            sent.append(_Sent(order.how, "soap", delivery, self._send_soap(delivery)))
        if order.how == "coffee":
            delivery = delivery._replace(message_code=COFFEE)
            sent.append(_Sent("coffee", "soap", delivery, self._send_soap(delivery, coffee=True)))
        return sent

    def _send_soap(self, delivery: Delivery, *, coffee: bool = False) -> Exchange:
        return send_delivery(self._publishers, delivery, coffee=coffee, style=next(self._styles))

    def _outgoing(self, how: str, delivery: Delivery) -> Outgoing:
        if how == "rest":
            return Outgoing(self._rest, "PUT", delivery.rest_path)
        return delivery_outgoing(self._publishers, delivery, coffee=how == "coffee")

    def _key(self, delivery: Delivery) -> bytes:
        """Return a key of a delivery: its bits, or its values where the observer does not see the sign of zero."""
        if not self._observer.exact:
            delivery = type(delivery)(delivery.message_code, *(value + 0.0 for value in delivery[1:]))
        return delivery.bits

    def _judge_each(self, sent: list[_Sent], seen: list[Seen]) -> bool:
        arrived = Counter(self._key(one.delivery) for one in seen)
        wanted = Counter(self._key(one.delivery) for one in sent)
        others = [one.delivery for one in seen if self._key(one.delivery) not in wanted]
        well = True
        for one in sent:
            key = self._key(one.delivery)
            count, due = arrived[key], wanted[key]
            interfaces = sorted(item.interface for item in seen if self._key(item.delivery) == key)
            problem = ""
            if count != due:
                problem = (
                    f"{count} messages instead of {due}" if count or not others else f"another message, {others[0]}"
                )
            elif any(interfaces) and interfaces != _TWO.get(one.how, [one.interface])[: len(interfaces)]:
                problem = f"{count} by {' and '.join(interfaces)}"
            well &= self._judge.check(
                REQUIREMENT[one.how],
                not problem,
                one.exchange,
                f"exactly one message for each accepted request, {one.delivery}",
                found=problem,
                cause=f"{one.interface} {problem.split(',')[0]}",
            )
        return well

    def _judge_only(self, sent: list[_Sent], seen: list[Seen]) -> bool:
        """Judge what arrived beside that which was just sent: an earlier delivery again, a refused one, or nobody's.

        A robot may have other clients: what nobody here asked for is held against it only when it comes repeatedly.
        """
        known = {self._key(one.delivery): one for one in sent}
        others = [one.delivery for one in seen if self._key(one.delivery) not in known.keys() | self._maybe]
        again = [delivery for delivery in others if self._key(delivery) in self._earlier]
        refused = [delivery for delivery in others if self._key(delivery) in self._refused]
        self._unsent += len(again) + len(refused) < len(others)
        self._earlier |= known
        self._judge_again(again)
        exchange, found, cause = next((one.exchange for one in known.values()), None), "", ""
        if again:
            exchange = self._earlier[self._key(again[0])].exchange
            found, cause = f"an earlier message once more: {again[0]}", "later"
        elif refused:
            exchange = self._refused[self._key(refused[0])]
            found, cause = f"the message of a request that was not accepted: {refused[0]}", "not accepted"
        elif others and self._unsent >= _OFTEN:
            exchange, found, cause = None, f"a message that no client of the suite sent: {others[0]}", "not sent"
        return self._judge.check(
            _ONLY, not found, exchange, "no message beside the one for each accepted request", found=found, cause=cause
        )

    def _judge_again(self, again: list[Delivery]) -> None:
        """Judge that an earlier delivery does not arrive once more."""
        for delivery in again:
            one = self._earlier[self._key(delivery)]
            self._judge.check(
                REQUIREMENT[one.how],
                holds=False,
                exchange=one.exchange,
                expected=f"exactly one message for each accepted request, {delivery}",
                found="one more message, later",
                cause=f"{one.interface} later",
            )

    def _judge_order(self, sent: list[_Sent], seen: list[Seen]) -> bool:
        """Judge that deliveries over one interface arrive in order; two interfaces may have a publisher each."""
        well = True
        for interface in ("rest", "soap"):
            wanted = [self._key(one.delivery) for one in sent if one.interface == interface and one.how not in _TWO]
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
