"""Deliveries over REST and SOAP, one after another and from several clients at once."""

from typing import Final

from hypothesis import strategies as st

from conformance.api.rest.interface import RestInterface
from conformance.api.rest.validity import require_valid
from conformance.api.soap.service import SoapService
from conformance.api.soap.xml_style import TEXTS
from conformance.packs.table1.robot.deliveries_seen import NoObserverError, observer_of
from conformance.packs.table1.robot.delivery import Delivery, lexical_deliveries, path_of
from conformance.packs.table1.robot.delivery_sender import DeliverySender, Order
from conformance.packs.table1.robot.delivery_trace import Deliveries
from conformance.packs.table1.robot.probe import ProbeError, RosProbe
from conformance.papers_robot.delivery import COFFEE, COURIER
from conformance.scenarios.scenario import NotPossibleError, partial_trace, scenario
from conformance.scenarios.stage import Leaves, Need, Stage
from conformance.verdict.effort import Effort
from conformance.verdict.explorer import Explorer

# Orders in a batch: they make at most half as many messages as a robot's list must hold (fifty).
_ORDERS: Final = 12
# _ENOUGH: batches with lost or extra deliveries after which no more are sent, because each takes a long wait.
_ENOUGH: Final = 3
_KINDS: Final = ("same", "rest", "soap", "coffee")
# By kind: extreme doubles and integers, in an order that keeps the values of a delivery distinct.
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
