"""Every accepted delivery must become exactly one identical message, over REST and over SOAP."""

from typing import Final

import pytest
from hypothesis import strategies as st

from conformance.api.rest.interface import RestInterface
from conformance.api.rest.validity import require_valid
from conformance.api.soap.service import SoapService
from conformance.api.soap.xml_style import TEXTS
from conformance.packs.table1.delivery import COFFEE, COURIER
from conformance.packs.table1.robot.batch import Batch, Order
from conformance.packs.table1.robot.deliveries_seen import NoObserverError, observer_of
from conformance.packs.table1.robot.delivery import Delivery, lexical_deliveries, path_of
from conformance.packs.table1.robot.probe.client import ProbeError, RosProbe
from conformance.verdict.evidence import Judge
from conformance.verdict.explorer import Explorer

pytestmark = [pytest.mark.needs("rest", "publishers"), pytest.mark.motion]
_IDS: Final = (
    "equivalence/delivery-rest",
    "equivalence/delivery-soap",
    "equivalence/coffee-soap",
    "equivalence/delivery-same",
    "equivalence/delivery-order",
    "equivalence/delivery-repeated",
    "equivalence/delivery-concurrent",
    "equivalence/delivery-only",
)
# A robot's list holds at least the last fifty: no batch makes more messages than half of that.
_ORDERS = 12
_ENOUGH = 3
_KINDS = ("same", "rest", "soap", "coffee")
# Where a double or an integer ends; by their places the values stay different from each other.
_CORNERS = (
    ("twice", (3, 0.5, -0.0, 1.0, 5e-324, -5e-324, 2.2250738585072009e-308)),
    ("rest", (3, -0.0, -5e-324, 2.2250738585072014e-308, 1.7976931348623157e308, -1.7976931348623157e308, 0.1)),
    ("soap", (4, 5e-324, -0.0, -2.2250738585072009e-308, 1e23, 9007199254740993.0, -0.1)),
    ("same", (4, 0.30000000000000004, 123456789.123456789, -0.0, 1e-300, 1e300, 5e-324)),
)
_CLIENTS = 8
# So many rounds of clients at once make no more messages than a robot's list holds for certain.
_ROUNDS = 3
# The ways of writing a number in XML come first among the styles of a batch.
_STYLES = len(TEXTS)
# How long what comes too late is waited for, s: at any effort, and at quick.
_LATER_S = (2.0, 0.45)


@pytest.fixture(scope="session")
def watched() -> list[Batch]:
    """Return the deliveries that were sent, of which more may come."""
    return []


@pytest.mark.phase("arrival")
@pytest.mark.requirement(*_IDS)
def test_deliveries_arrive(
    api: RestInterface, publishers: SoapService, probe: RosProbe, judge: Judge, explore: Explorer, watched: list[Batch]
) -> None:
    """Deliveries over REST and SOAP, of any values, arrive once, unchanged and in order; also those of many clients."""
    try:
        batch = Batch(api.client, publishers, observer_of(api, probe), judge)
        watched.append(batch)
        failed: list[list[Order]] = []

        def try_batch(orders: list[Order]) -> None:
            # A failure is not made smaller: each message has a case of its own already. A few tell the kinds apart.
            for order in orders:
                require_valid(api.run.contract, "PUT", path_of(*order.written))
            if len(failed) < _ENOUGH and not batch.run(orders):
                failed.append(orders)

        # Whatever is read of these digits is a number, so that who reads a part of them takes another delivery.
        digits = [
            Delivery(COURIER, *(1234.5678 + 100 * style + place for place in range(6))) for style in range(_STYLES)
        ]
        try_batch([_order("soap", delivery) for delivery in digits])
        try_batch([_order(how, Delivery(*values)) for how, values in _CORNERS])
        explore(_batches(), try_batch, cases=12)
        for turn in range(api.run.effort.cases(8)):
            if len(failed) < _ENOUGH and not batch.run_together(_crowd(turn)):
                failed.append([])
    except (NoObserverError, ProbeError) as nobody:
        pytest.skip(str(nobody))


@pytest.mark.phase("late")
@pytest.mark.requirement(*_IDS)
def test_nothing_follows(api: RestInterface, watched: list[Batch]) -> None:
    """No delivery is one more message later: meanwhile descriptions were read, and nobody sent another one."""
    try:
        for batch in watched:
            batch.finish(_LATER_S[api.run.effort.name == "quick"])
    except (NoObserverError, ProbeError) as nobody:
        pytest.skip(str(nobody))


@pytest.mark.phase("last")
@pytest.mark.requirement(*_IDS)
def test_nothing_follows_much_later(watched: list[Batch]) -> None:
    """Nor is it one more message when all else has been tried."""
    try:
        for batch in watched:
            batch.look_again()
    except (NoObserverError, ProbeError) as nobody:
        pytest.skip(str(nobody))


def _order(how: str, delivery: Delivery) -> Order:
    return Order(how, delivery, (str(delivery.message_code), *map(repr, delivery[1:])))


def _crowd(turn: int) -> list[list[tuple[str, Delivery]]]:
    """Rounds of deliveries that clients send at one moment; each number in each of them is that client's alone."""
    return [
        [
            (
                ("rest", "soap", "rest", "coffee")[client % 4],
                Delivery(
                    COFFEE if client % 4 == 3 else COURIER,
                    *(_number(turn, round_, client, place) for place in range(6)),
                ),
            )
            for client in range(_CLIENTS)
        ]
        for round_ in range(_ROUNDS)
    ]


def _number(turn: int, round_: int, client: int, place: int) -> float:
    return 1e6 * turn + 1e4 * round_ + 100 * client + place + 0.5


def _batches() -> st.SearchStrategy[list[Order]]:
    """Orders of all kinds, in any order, no two of them alike."""
    cases = st.lists(
        lexical_deliveries(),
        min_size=_ORDERS,
        max_size=_ORDERS,
        # The code does not tell them apart: a coffee's is another one than was drawn. Nor does the sign of a zero.
        unique_by=lambda case: tuple(value + 0.0 for value in case[0][1:]),
    )
    kinds = st.permutations(_KINDS * (_ORDERS // len(_KINDS)))
    return st.builds(
        lambda kinds, cases: [Order(kind, *case) for kind, case in zip(kinds, cases, strict=True)], kinds, cases
    )
