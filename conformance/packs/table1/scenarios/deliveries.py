"""Deliveries over REST and SOAP, from several clients at once, with Idempotency-Keys, and invalid ones."""

import uuid
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

from hypothesis import strategies as st

from conformance.api.rest.interface import RestInterface
from conformance.api.rest.validity import require_valid
from conformance.api.soap.callable_services import SoapServices
from conformance.api.soap.calls import SoapResponse, call, read_exchange, send
from conformance.api.soap.envelope import envelope
from conformance.api.soap.service import MEDIA_TYPE, SoapService
from conformance.api.soap.xml_style import TEXTS
from conformance.documents.xml import ENVELOPE, Node, clark
from conformance.packs.table1.robot.deliveries_seen import DeliveryObserver, NoObserverError, observer_of
from conformance.packs.table1.robot.delivery import Deliveries, Delivery, lexical_deliveries, path_of, put_delivery
from conformance.packs.table1.robot.delivery_sender import DeliverySender, Order
from conformance.packs.table1.robot.probe import ProbeError, RosProbe
from conformance.packs.table1.robot.soap_services import request, send_delivery
from conformance.papers_robot.delivery import COFFEE, COURIER
from conformance.scenarios.scenario import NotPossibleError, partial_trace, scenario
from conformance.scenarios.stage import Leaves, Need, Stage
from conformance.transport.exchange import SAFE_METHODS, Exchange
from conformance.verdict.effort import Effort
from conformance.verdict.explorer import Explorer

# Orders in a batch: they make at most half as many messages as a robot's list must hold (fifty).
_ORDERS: Final = 12
_ENOUGH: Final = 3  # batches with lost or extra deliveries after which no more are sent, because each takes a long wait
_KINDS: Final = ("same", "rest", "soap", "coffee")
# Extreme doubles and integers, in an order that keeps the values of a delivery distinct.
_CORNERS: Final = (
    ("twice", (3, 0.5, -0.0, 1.0, 5e-324, -5e-324, 2.2250738585072009e-308)),
    ("rest", (3, -0.0, -5e-324, 2.2250738585072014e-308, 1.7976931348623157e308, -1.7976931348623157e308, 0.1)),
    ("soap", (4, 5e-324, -0.0, -2.2250738585072009e-308, 1e23, 9007199254740993.0, -0.1)),
    ("same", (4, 0.30000000000000004, 123456789.123456789, -0.0, 1e-300, 1e300, 5e-324)),
)
_CLIENTS: Final = (("rest", COURIER), ("soap", COURIER), ("rest", COURIER), ("coffee", COFFEE)) * 2
# Rounds of concurrent clients: a robot's list must hold all their messages.
_ROUNDS: Final = 3
# An XML sender's first styles write numbers in another way.
_STYLES: Final = len(TEXTS)
# How long the suite waits for late messages, s: normally, and at quick.
_LATER_S: Final = (2.0, 0.45)
_NEEDS: Final = (Need.REST, Need.PUBLISHERS, Need.MOTION)


@scenario(needs=_NEEDS, leaves=Leaves.UNTOUCHED, stage=Stage.ARRIVAL)
def deliveries(
    api: RestInterface,
    publishers: SoapService,
    probe: RosProbe,
    explore: Explorer,
    effort: Effort,
    senders: list[DeliverySender],
) -> Deliveries:
    """Send deliveries over REST and SOAP, of any values, also from several clients at once."""
    try:
        sender = DeliverySender(api.client, publishers, observer_of(api, probe))
    except (NoObserverError, ProbeError) as error:
        raise NotPossibleError(str(error)) from error
    senders.append(sender)

    def send(orders: list[Order]) -> None:
        for order in orders:
            require_valid(api.run.contract, "PUT", path_of(*order.written))
        if sender.lost < _ENOUGH:
            sender.send(orders)

    with partial_trace(sender.trace):
        # A robot that reads only some of these digits accepts a delivery with another number.
        digits = (Delivery(COURIER, *(1234.5678 + 100 * n + place for place in range(6))) for n in range(_STYLES))
        send([_order("soap", delivery) for delivery in digits])
        send([_order(how, Delivery(*values)) for how, values in _CORNERS])
        explore(_batches(), send, cases=12)
        for turn in range(effort.cases(8)):
            if sender.lost < _ENOUGH:
                sender.send_together(_crowd(turn))
    return sender.trace()


@scenario(needs=_NEEDS, leaves=Leaves.UNTOUCHED, stage=Stage.LATE)
def deliveries_later(effort: Effort, senders: list[DeliverySender]) -> Deliveries:
    """Record the deliveries that arrive after all batches, while no client sends another."""
    return _watch(senders, _LATER_S[effort.name == "quick"])


@scenario(needs=_NEEDS, leaves=Leaves.UNTOUCHED, stage=Stage.LAST)
def deliveries_last(senders: list[DeliverySender]) -> Deliveries:
    """Record the deliveries that have arrived at the end of the run."""
    return _watch(senders, 0.0)


def _watch(senders: list[DeliverySender], seconds: float) -> Deliveries:
    """Return the deliveries that arrive after the batches of the run's sender, if the run has one."""
    for sender in senders:
        try:
            sender.watch(seconds)
        except (NoObserverError, ProbeError) as error:
            raise NotPossibleError(str(error)) from error
        return sender.trace()
    return Deliveries()


def _order(how: str, delivery: Delivery) -> Order:
    return Order(how, delivery, (str(delivery.message_code), *map(repr, delivery[1:])))


def _crowd(turn: int) -> list[list[tuple[str, Delivery]]]:
    """Return rounds of deliveries to send at the same moment; no two of them share a number."""
    return [
        [
            (how, Delivery(code, *(1e6 * turn + 1e4 * round_ + 100 * client + place + 1 / 3 for place in range(6))))
            for client, (how, code) in enumerate(_CLIENTS)
        ]
        for round_ in range(_ROUNDS)
    ]


def _batches() -> st.SearchStrategy[list[Order]]:
    """Return a strategy for orders of all kinds, in any order, no two of them alike."""
    cases = st.lists(
        lexical_deliveries(),
        min_size=_ORDERS,
        max_size=_ORDERS,
        # Code and the sign of a zero do not make deliveries different: a coffee has a code of its own.
        unique_by=lambda case: tuple(value + 0.0 for value in case[0][1:]),
    )
    kinds = st.permutations(_KINDS * (_ORDERS // len(_KINDS)))
    return st.builds(
        lambda kinds, cases: [Order(kind, *case) for kind, case in zip(kinds, cases, strict=True)], kinds, cases
    )


CORRECT: Final = ("3", "1.5", "2.5", "3.5", "4.5", "5.5", "6.5")
NO_CREDENTIALS: Final = "no credentials"
_FAULTS: Final = frozenset({"Client", "MustUnderstand", "VersionMismatch"})
_OTHER_METHODS: Final = ("GET", "HEAD", "OPTIONS", "POST", "DELETE", "PATCH")
_BAD_PARTS: Final = (
    *((0, text) for text in ("0", "5", "abc", "", "3.5", "2147483648")),
    *((place, text) for place in (1, 4, 6) for text in ("abc", "", "NaN", "Infinity", "-Infinity", "1e400")),
)


def _of(code: int, first: int) -> Delivery:
    """Return a delivery whose numbers need all digits of a double."""
    return Delivery(code, *(first + place + 1 / 7 for place in range(6)))


_NO_FORMAT: Final = _of(3, 21)
_LAST: Final = _of(3, 11)
_TWICE: Final = _of(COURIER, 70)
_APART: Final = _of(COURIER, 80)
_OLD_VERSION: Final = _of(COURIER, 120)
_MANDATORY: Final = _of(COURIER, 130)
_STRANGER: Final = _of(COURIER, 140)
_OTHER_MEDIA: Final = _of(COURIER, 150)
_SLASH: Final = _of(COURIER, 160)
_STRANGE: Final = "http://example.com/unknown"
# Deliveries after refused requests, over REST and over SOAP.
_AFTER_REST: Final = _of(3, 90)
_AFTER_SOAP: Final = _of(COURIER, 100)
_AFTER_SOAP_COFFEE: Final = _of(COFFEE, 110)


@dataclass(frozen=True)
class ByMethod:
    """A valid delivery's path, requested with another method than PUT, or with a slash at its end."""

    method: str
    delivery: Delivery
    exchange: Exchange


@dataclass(frozen=True)
class Rejected:
    """A delivery with valid values that a robot rejects for another reason.

    Attributes:
        what: that reason, as a noun phrase.
        delivery: its values.
        exchange: request and response.
        accepted: whether the robot accepted it all the same.
        is_rejected: whether the response says so: by 4xx, or by a fault that the contract names.
    """

    what: str
    delivery: Delivery
    exchange: Exchange
    accepted: bool
    is_rejected: bool

    @classmethod
    def of(cls, what: str, delivery: Delivery, answer: SoapResponse) -> "Rejected":
        """Return the record of a service's response."""
        rejected = 400 <= answer.status < 500 or answer.code in _FAULTS  # noqa: PLR2004 - RFC 9110 15.5
        return cls(what, delivery, answer.exchange, answer.is_taken, rejected)


@dataclass(frozen=True)
class Keyed:
    """Two pairs of identical deliveries with an Idempotency-Key.

    Attributes:
        twice: the exchanges of two requests with one key.
        apart: the exchanges of two requests with a key each.
    """

    twice: tuple[Exchange, ...]
    apart: tuple[Exchange, ...]

    @property
    def accepted_apart(self) -> int:
        """Return how many requests of the second pair the robot accepted."""
        return sum(exchange.response.ok for exchange in self.apart)


@dataclass(frozen=True)
class CountedDeliveries:
    """All requests, and the deliveries that arrived.

    Attributes:
        invalid: exchanges of invalid deliveries, over REST and SOAP.
        by_method: valid paths with other methods.
        rejected: SOAP messages with valid values that the robot should reject.
        no_format: the valid delivery whose Accept header excludes all formats.
        answer: its exchange, or None if no observer shows arrivals.
        last: a valid delivery after them, which must arrive.
        after: valid deliveries just after invalid ones, with their exchanges.
        keyed: those with a key, or None if no observer shows arrivals.
        seen: the deliveries that arrived; None if no observer shows them.
        unseen: why no observer shows them, or empty.
    """

    invalid: tuple[Exchange, ...]
    by_method: tuple[ByMethod, ...]
    rejected: tuple[Rejected, ...] = ()
    no_format: Delivery = _NO_FORMAT
    answer: Exchange | None = None
    last: Delivery = _LAST
    after: tuple[tuple[Delivery, Exchange], ...] = ()
    keyed: Keyed | None = None
    seen: tuple[Delivery, ...] | None = None
    unseen: str = ""

    @property
    def valid_deliveries(self) -> set[Delivery]:
        """Return the valid deliveries among them."""
        own = {self.last, self.no_format, _TWICE, _APART}
        own |= {rejection.delivery for rejection in self.rejected}
        return own | {count.delivery for count in self.by_method} | {delivery for delivery, _ in self.after}

    @property
    def twice_arrived(self) -> int:
        """Return the number of messages for the pair with one key."""
        return (self.seen or ()).count(_TWICE)

    @property
    def apart_arrived(self) -> int:
        """Return the number of messages for the pair with two keys."""
        return (self.seen or ()).count(_APART)


@scenario(needs={Need.REST, Need.MOTION}, leaves=Leaves.UNTOUCHED, stage=Stage.EFFECT)
def counted_deliveries(api: RestInterface, soap: SoapServices, probe: RosProbe) -> CountedDeliveries:
    """Send invalid deliveries, valid paths with other methods, and at last valid deliveries, some with a key."""
    observer: DeliveryObserver | None = None
    unseen = ""
    try:
        observer = observer_of(api, probe)
        observer.mark()
    except (NoObserverError, ProbeError) as error:
        observer, unseen = None, str(error)
    trace = replace(_invalid(api, soap), unseen=unseen)
    if observer is None:
        return trace
    answer = api.client.send("PUT", _NO_FORMAT.rest_path, headers=(("Accept", "image/png"),), fresh=True)
    put_delivery(api, _LAST.rest_path, fresh=True)
    # Random keys, which no robot knows from an earlier run.
    first, second, third = (str(uuid.uuid4()) for _ in range(3))
    keyed = Keyed(_put(api, _TWICE, (first, first)), _put(api, _APART, (second, third)))
    wanted = (
        1
        + sum(exchange.response.ok for _, exchange in trace.after)
        + answer.response.ok
        + sum(rejection.accepted for rejection in trace.rejected)
        + keyed.twice[0].response.ok
        + keyed.accepted_apart
    )
    try:
        seen = [sighting.delivery for sighting in observer.collect(wanted)]
        # A robot that published one message too many has pushed the last one out.
        lacking = keyed.accepted_apart - seen.count(_APART)
        seen += (sighting.delivery for sighting in (observer.collect(lacking) if lacking > 0 else ()))
    except (NoObserverError, ProbeError) as error:
        return replace(trace, unseen=str(error))
    return replace(trace, answer=answer, keyed=keyed, seen=tuple(seen))


def _invalid(api: RestInterface, soap: SoapServices) -> CountedDeliveries:
    rest = api.client
    invalid = []
    for place, text in api.run.effort.alternatives(_BAD_PARTS, 8):
        values = [*CORRECT[:place], text, *CORRECT[place + 1 :]]
        invalid.append(rest.send("PUT", path_of(*values), fresh=True))
    after = [(_AFTER_REST, put_delivery(api, _AFTER_REST.rest_path, fresh=True))]
    by_method = []
    # A further method that the resource allows belongs to the vendor and may do anything (contract.md#http).
    own = rest.send("OPTIONS", _LAST.rest_path, fresh=True).response.header("Allow") or ""
    methods = [name for name in _OTHER_METHODS if name in SAFE_METHODS or name not in own]
    for number, method in enumerate(api.run.effort.alternatives(methods, 3)):
        delivery = _of(3, 200 + 10 * number)
        by_method.append(ByMethod(method, delivery, rest.send(method, delivery.rest_path, fresh=True)))
    by_method.append(ByMethod("PUT", _SLASH, rest.send("PUT", f"{_SLASH.rest_path}/", fresh=True)))
    rejected: list[Rejected] = []
    if soap.publishers is not None:
        rejected = _rejected_soap(soap.publishers)
        invalid += _invalid_soap(soap.publishers)
        after.append((_AFTER_SOAP_COFFEE, send_delivery(soap.publishers, _AFTER_SOAP_COFFEE, coffee=True)))
        invalid.append(send_delivery(soap.publishers, Delivery(0, 1.5, 2.5, 3.5, 4.5, 5.5, 6.5)))
        after.append((_AFTER_SOAP, send_delivery(soap.publishers, _AFTER_SOAP)))
    return CountedDeliveries(tuple(invalid), tuple(by_method), tuple(rejected), after=tuple(after))


def _put(api: RestInterface, delivery: Delivery, keys: Sequence[str]) -> tuple[Exchange, ...]:
    """PUT a delivery once with each key, each on a new connection, which prevents retries."""
    fields = [(("Idempotency-Key", f'"{key}"'),) for key in keys]
    return tuple(put_delivery(api, delivery.rest_path, headers=field, fresh=True) for field in fields)


def _rejected_soap(publishers: SoapService) -> list[Rejected]:
    """Send valid deliveries in messages of another version, media type or header, and without credentials if any."""
    mandatory = Node(clark(_STRANGE, "Transaction"), "5", (), ((clark(ENVELOPE, "mustUnderstand"), "1"),))
    old = envelope([_message(_OLD_VERSION)], space=_STRANGE)
    sent = [
        Rejected.of("an Envelope of another SOAP version", _OLD_VERSION, send(publishers, old, fresh=True)),
        Rejected.of(
            "an unknown mandatory header block",
            _MANDATORY,
            call(publishers, _message(_MANDATORY), headers=(mandatory,), fresh=True),
        ),
        Rejected.of(
            "the media type text/plain",
            _OTHER_MEDIA,
            call(publishers, _message(_OTHER_MEDIA), content_type="text/plain", fresh=True),
        ),
    ]
    if publishers.client.connection.credentials:
        message = envelope([_message(_STRANGER)]).serialize()
        fields = (("Content-Type", MEDIA_TYPE), ("SOAPAction", '""'))
        exchange = publishers.client.send(
            "POST", publishers.path, headers=fields, body=message, authorized=False, fresh=True
        )
        sent.append(Rejected.of(NO_CREDENTIALS, _STRANGER, read_exchange(exchange)))
    return sent


def _message(delivery: Delivery) -> Node:
    return request("ExecuteDeliveryRequest", **delivery._asdict())


def _invalid_soap(publishers: SoapService) -> list[Exchange]:
    """Send messages with a bad code, a non-finite value, a missing and a doubled element; return the exchanges."""
    values = dict(zip(Delivery._fields, CORRECT, strict=True))
    changes: list[dict[str, str | None]] = [
        {"message_code": "5"},
        {"message_code": "abc"},
        {"depot_x": "INF"},
        {"source_y": "NaN"},
        {"destination_x": None},
        {"source_y": "x"},
    ]
    exchanges = [send_delivery(publishers, Delivery(0, 1.5, 2.5, 3.5, 4.5, 5.5, 6.5))]
    for change in changes:
        given = {**values, **change}
        parts = {name: text for name, text in given.items() if text is not None}
        names = ["ExecuteDeliveryRequest", *["ExecuteCoffeeRequest"] * ("source_y" in change)]
        exchanges += (call(publishers, request(name, **parts), fresh=True).exchange for name in names)
    return exchanges
