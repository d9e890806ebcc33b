"""Send deliveries over both interfaces in batches, and record the deliveries that arrive.

The arrivals of a batch are read as soon as all are expected to be there. Duplicates that arrive later are read with the
next batch, so that no pause is needed between batches.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import chain, cycle

from conformance.api.soap.service import SoapService
from conformance.api.soap.xml_style import XmlStyle, value_styles
from conformance.observe.clock import WALL_CLOCK
from conformance.packs.table1.robot.deliveries_seen import DeliveryObserver
from conformance.packs.table1.robot.delivery import Batch, Deliveries, Delivery, Seen, Sent, key_of, path_of
from conformance.packs.table1.robot.soap_services import delivery_outgoing, send_delivery
from conformance.papers_robot.delivery import COFFEE
from conformance.transport.client import HttpClient
from conformance.transport.exchange import Exchange, Outgoing
from conformance.transport.parallel import Addressed, send_together, until_taken


@dataclass(frozen=True)
class Order:
    """A delivery to send.

    Attributes:
        how: rest, soap, coffee, same (over REST and then over SOAP), or twice (the same request over REST again).
        delivery: its values.
        written: the values as text, for the path.
    """

    how: str
    delivery: Delivery
    written: tuple[str, ...]


@dataclass
class DeliverySender:
    """Sends deliveries and records the arrivals.

    No two deliveries of a run may have the same values: arrivals are matched with requests by them.

    Attributes:
        rest, publishers: the interfaces.
        observer: shows the deliveries that arrive.
        batches: the record so far.
        lost: number of batches in which other deliveries arrived than were accepted.
    """

    rest: HttpClient
    publishers: SoapService
    observer: DeliveryObserver
    batches: list[Batch] = field(default_factory=list)
    lost: int = 0
    # XML styles in rotation; the values of a message do not depend on its style.
    _styles: Iterator[XmlStyle] = field(default_factory=lambda: cycle(value_styles()))
    _collected: float = 0.0
    _judged: int = 0

    def __post_init__(self) -> None:
        """Discard messages that arrived before."""
        self.observer.mark()

    def trace(self) -> Deliveries:
        """Return the record so far; the batches since the last call are to be judged."""
        first, self._judged = self._judged, len(self.batches)
        return Deliveries(tuple(self.batches), self.observer.exact, first)

    def send(self, orders: Sequence[Order]) -> None:
        """Send deliveries one after another, and record the arrivals.

        Raises:
            NoAnswerError: no HTTP response came.
        """
        self._record(tuple(chain.from_iterable(map(self._send, orders))))

    def send_together(self, rounds: Sequence[Sequence[tuple[str, Delivery]]]) -> None:
        """Send deliveries as pairs (how, values), those of a round at the same moment, and record the arrivals."""
        outgoing = [[self._outgoing(how, delivery) for how, delivery in turn] for turn in rounds]
        attempts = chain.from_iterable(send_together(outgoing))
        self._record(
            tuple(
                Sent(
                    "together",
                    "rest" if how == "rest" else "soap",
                    delivery,
                    attempt if isinstance(attempt, Exchange) else None,
                )
                for (how, delivery), attempt in zip(chain(*rounds), attempts, strict=True)
            )
        )

    def watch(self, seconds: float) -> None:
        """Record arriving deliveries until this many seconds after the last batch; 0 means those that have arrived."""
        left_s = self._collected + seconds - WALL_CLOCK.now()
        self.batches.append(Batch((), tuple(self.observer.collect(0, max(0.0, left_s)))))

    def _record(self, sent: tuple[Sent, ...]) -> None:
        """Record a batch; wait a little longer if other deliveries arrived than were accepted."""
        accepted = [message for message in sent if message.is_ok]
        seen = self.observer.collect(len(accepted), 0.0)
        if self._keys(seen) != self._keys(accepted):
            seen += self.observer.collect(0)
            self.lost += self._keys(seen) != self._keys(accepted)
        self._collected = WALL_CLOCK.now()
        self.batches.append(Batch(sent, tuple(seen)))

    def _keys(self, deliveries: Sequence[Seen] | Sequence[Sent]) -> list[bytes]:
        return sorted(key_of(delivery.delivery, exact=self.observer.exact) for delivery in deliveries)

    def _send(self, order: Order) -> Iterator[Sent]:
        delivery, how = order.delivery, order.how
        for _ in range({"rest": 1, "same": 1, "twice": 2}.get(how, 0)):
            # On a connection of its own, so that the client does not send the request again.
            for exchange in until_taken(
                self.rest.connection, lambda: self.rest.send("PUT", path_of(*order.written), fresh=True)
            ):
                yield Sent(how, "rest", delivery, exchange)
        if how == "coffee":
            delivery = delivery._replace(message_code=COFFEE)
        if how in {"soap", "same", "coffee"}:
            style = next(self._styles)
            exchange = send_delivery(self.publishers, delivery, coffee=how == "coffee", style=style)
            yield Sent(how, "soap", delivery, exchange)

    def _outgoing(self, how: str, delivery: Delivery) -> Addressed:
        if how == "rest":
            return self.rest, Outgoing("PUT", delivery.rest_path)
        return delivery_outgoing(self.publishers, delivery, coffee=how == "coffee")
