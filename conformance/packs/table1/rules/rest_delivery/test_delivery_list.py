"""The list of deliveries, an optional resource."""

import pytest

from conformance.api.rest.interface import RestInterface
from conformance.packs.table1.robot.accepted_deliveries import AcceptedDeliveries
from conformance.packs.table1.robot.delivery import Delivery, put_delivery
from conformance.packs.table1.robot.message_shapes import DELIVERIES as LIST
from conformance.packs.table1.robot.message_shapes import read_as
from conformance.packs.table1.robot.robot import ACCEPT_JSON, DELIVERIES
from conformance.transport.client import HttpClient
from conformance.verdict.effort import Effort
from conformance.verdict.evidence import Judge

pytestmark = pytest.mark.needs("rest")
# What the list holds at least.
_LEAST = 50


def _read(rest: HttpClient, judge: Judge) -> list[Delivery] | None:
    """Return the deliveries in the list, newest first; None where the robot has no list or it is invalid."""
    exchange = rest.send("GET", DELIVERIES, headers=ACCEPT_JSON)
    if exchange.response.status == 404:
        pytest.skip("the robot has no list of deliveries, which it may leave out")
    value, problem = read_as(exchange.response, LIST)
    judge.check(
        "rest-delivery/list",
        not problem,
        exchange,
        "status 200 with a list of {request, state, accepted, interface}, or 404",
        found=problem,
    )
    return None if problem else [Delivery.of(entry["request"]) for entry in value]


@pytest.mark.phase("acting")
@pytest.mark.requirement("rest-delivery/list")
def test_list(rest: HttpClient, judge: Judge, effort: Effort) -> None:
    """Check each reading of the list by its schema."""
    for _ in range(effort.cases(30)):
        _read(rest, judge)


@pytest.mark.phase("acting")
@pytest.mark.motion
@pytest.mark.requirement("rest-delivery/list-newest-first", "rest-delivery/list-values")
def test_list_of_many(api: RestInterface, rest: HttpClient, judge: Judge, effort: Effort) -> None:
    """Send more deliveries than the list must hold, and check that it has the newest first with their values."""
    if _read(rest, judge) is None:
        pytest.skip("the robot's list of deliveries cannot be read")
    # A robot that takes its time is asked for fewer.
    many = 5 if effort.slow else _LEAST + 5
    sent = [Delivery(3 + index % 2, 0.5, index + 0.25, -1.0, 1e300, 1e-300, index / 3) for index in range(many)]
    for delivery in sent:
        put_delivery(api, delivery.rest_path, fresh=True)
    exchange = rest.send("GET", DELIVERIES, headers=ACCEPT_JSON)
    value, problem = read_as(exchange.response, LIST)
    if problem:
        judge.check("rest-delivery/list-values", False, exchange, "a list of deliveries", found=problem)
        return
    listed = [Delivery.of(entry["request"]) for entry in value]
    wanted = sent[: -_LEAST - 1 : -1]
    newest = listed[: len(wanted)]
    judge.check(
        "rest-delivery/list-newest-first",
        newest == wanted,
        exchange,
        f"the last {len(wanted)} deliveries, newest first",
        found=f"{len(listed)} deliveries, first {listed[0] if listed else 'none'} for {wanted[0]}",
    )
    missing = next((one for one in wanted if one not in listed), None)
    other = next((entry["interface"] for entry in value[: len(wanted)] if entry["interface"] != "rest"), "")
    judge.check(
        "rest-delivery/list-values",
        missing is None and not other,
        exchange,
        "each delivery with its values, by rest",
        found=f"a list without {missing}" if missing else f"a delivery by {other}",
    )


@pytest.mark.phase("last")
@pytest.mark.motion
@pytest.mark.requirement("rest-delivery/list-values", "equivalence/delivery-rest", "equivalence/delivery-soap")
def test_every_accepted_delivery_is_listed(accepted: AcceptedDeliveries) -> None:
    """Look for the last deliveries that the robot has accepted in the run, as after each check for those before."""
    accepted.read(to_the_last=True)
