"""The list of deliveries, an optional resource."""

import itertools
from collections.abc import Callable, Iterator
from typing import Any, Final, NamedTuple

import pytest

from conformance.api.rest.interface import RestInterface
from conformance.observe.clock import poll_for
from conformance.packs.table1.robot.delivery import Delivery, put_delivery
from conformance.packs.table1.robot.message_shapes import DELIVERIES as LIST
from conformance.packs.table1.robot.message_shapes import read_as
from conformance.packs.table1.robot.robot import ACCEPT_JSON, DELIVERIES, Robot
from conformance.transport.client import HttpClient
from conformance.transport.exchange import Exchange
from conformance.verdict.effort import Effort
from conformance.verdict.evidence import Judge

pytestmark = pytest.mark.needs("rest")
# Deliveries that the list holds at least.
_LEAST: Final = 50
# Reading interval, and time by which a robot that writes its list after responding has done so, s.
_STEP_S, _SOON_S = 0.05, 1.0


def _read(rest: HttpClient) -> tuple[list[dict[str, Any]], str, Exchange]:
    """Return the entries of the list, newest first, what is wrong with the response, and the exchange.

    A robot that refuses the request has no list, which it may leave out: the check is then skipped.
    """
    exchange = rest.send("GET", DELIVERIES, headers=ACCEPT_JSON)
    if 400 <= exchange.response.status < 500:
        pytest.skip("the robot has no list of deliveries, which it may leave out")
    entries, problem = read_as(exchange.response, LIST)
    return entries or [], problem, exchange


@pytest.mark.phase("acting")
@pytest.mark.requirement("rest-delivery/list")
def test_list(rest: HttpClient, judge: Judge, effort: Effort) -> None:
    """Check each reading of the list by its schema."""
    for _ in range(effort.cases(30)):
        _, problem, exchange = _read(rest)
        expected = "status 200 with a list of {request, state, accepted, interface}, or 404"
        judge.check("rest-delivery/list", not problem, exchange, expected, found=problem)


@pytest.mark.phase("acting")
@pytest.mark.motion
@pytest.mark.requirement("rest-delivery/list-newest-first", "rest-delivery/list-values")
def test_list_of_many(api: RestInterface, rest: HttpClient, robot: Robot, judge: Judge, effort: Effort) -> None:
    """Send more deliveries than the list must hold: it has the newest first; a checker looks for each."""
    before, problem, _ = _read(rest)
    if problem:
        pytest.skip("the robot's list of deliveries cannot be read")
    # A slow robot gets fewer deliveries.
    many = 5 if effort.slow else _LEAST + 5
    sent = [Delivery(3 + index % 2, 0.5, index + 0.25, -1.0, 1e300, 1e-300, index / 3) for index in range(many)]
    taken = [delivery for delivery in sent if put_delivery(api, delivery.rest_path, fresh=True).response.ok]
    for _ in poll_for(robot.clock, _STEP_S, _SOON_S):
        entries, problem, exchange = _read(rest)
        listed = Listed(entries, taken, [_request(entry) for entry in before])
        if not problem and not listed.out_of_order:
            break
    expected = f"the last {_LEAST} deliveries, newest first"
    out_of_order = problem or listed.out_of_order
    judge.check("rest-delivery/list-newest-first", not out_of_order, exchange, expected, found=out_of_order)


@pytest.mark.phase("last")
@pytest.mark.motion
@pytest.mark.requirement("rest-delivery/list-values", "equivalence/delivery-rest", "equivalence/delivery-soap")
def test_every_accepted_delivery_is_listed(read_deliveries: Callable[[], None]) -> None:
    """Look for the last deliveries that the robot has accepted in the run, as after each check for those before."""
    read_deliveries()


class Listed(NamedTuple):
    """The list after several accepted deliveries; those of other clients may stand between them.

    Attributes:
        entries: of the list, newest first.
        taken: the deliveries that the robot took, in their order.
        before: the deliveries that the list had before.
    """

    entries: list[dict[str, Any]]
    taken: list[Delivery]
    before: list[Delivery]

    @property
    def _own_entries(self) -> list[dict[str, Any]]:
        return [entry for entry in self.entries if _request(entry) in [*self.taken, *self.before]]

    @property
    def _pairs(self) -> Iterator[tuple[Delivery, dict[str, Any] | None]]:
        """Yield each of the last deliveries that the list has to hold, and the entry in its place."""
        others = len(self.entries) - len(self._own_entries)
        wanted = self.taken[::-1][: max(0, _LEAST - others)]
        return itertools.zip_longest(wanted, self._own_entries[: len(wanted)])

    @property
    def out_of_order(self) -> str:
        """Return the delivery that stands in another one's place; empty if none does."""
        wrong = ((entry, wanted) for wanted, entry in self._pairs if entry is None or _request(entry) != wanted)
        return next((f"{entry and _request(entry)} in the place of {wanted}" for entry, wanted in wrong), "")


def _request(entry: dict[str, Any]) -> Delivery:
    return Delivery.of(entry["request"])
