"""One request, one identical message, whichever interface it came by."""

import pytest
from hypothesis import strategies as st

from conformance.rest.interface import RestInterface
from conformance.robot.batch import Batch, Order
from conformance.robot.deliveries_seen import NoObserverError, observer_of
from conformance.robot.delivery import lexical_deliveries
from conformance.robot.probe.client import ProbeError, RosProbe
from conformance.soap.service import SoapService
from conformance.verdict.evidence import Judge
from conformance.verdict.explorer import Explorer

pytestmark = [pytest.mark.phase("delivery"), pytest.mark.needs("rest", "publishers"), pytest.mark.motion]
# A robot's list holds at least the last fifty: no batch makes more messages than half of that.
_ORDERS = 12
_ENOUGH = 3
_KINDS = ("same", "rest", "soap", "coffee")


@pytest.mark.requirement(
    "equivalence/delivery-rest",
    "equivalence/delivery-soap",
    "equivalence/coffee-soap",
    "equivalence/delivery-same",
    "equivalence/delivery-order",
)
def test_deliveries_arrive(
    api: RestInterface, publishers: SoapService, probe: RosProbe, judge: Judge, explore: Explorer
) -> None:
    """Batches of deliveries over REST and SOAP, of any values, arrive one by one, unchanged and in order."""
    try:
        batch = Batch(api.client, publishers, observer_of(api, probe), judge)
        failed: list[list[Order]] = []

        def try_batch(orders: list[Order]) -> None:
            # A failure is not made smaller: each message has a case of its own already. A few tell the kinds apart.
            if len(failed) < _ENOUGH and not batch.run(orders):
                failed.append(orders)

        explore(_batches(), try_batch, cases=12)
    except (NoObserverError, ProbeError) as nobody:
        pytest.skip(str(nobody))


def _batches() -> st.SearchStrategy[list[Order]]:
    """Orders of all kinds, in any order, no two of them alike."""

    def spread(kinds: list[str]) -> st.SearchStrategy[list[Order]]:
        return st.lists(
            lexical_deliveries(),
            min_size=len(kinds),
            max_size=len(kinds),
            # The code does not tell them apart: a coffee's is another one than was drawn. Nor does the sign of a zero.
            unique_by=lambda case: tuple(value + 0.0 for value in case[0][1:]),
        ).map(lambda cases: [Order(kind, *case) for kind, case in zip(kinds, cases, strict=True)])

    kinds = st.permutations(_KINDS * (_ORDERS // len(_KINDS)))
    return kinds.flatmap(lambda chosen: spread(list(chosen)))
