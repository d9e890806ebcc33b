"""The delivery's PUT, which must accept all valid values and reject all others, and the optional list of deliveries."""

import itertools
from collections.abc import Callable, Iterator
from typing import Any, Final, NamedTuple

import pytest
from hypothesis import strategies as st

from conformance.api.rest.interface import RestInterface
from conformance.observe.clock import poll_for
from conformance.packs.table1.robot.delivery import Delivery, deliveries, lexical_deliveries, path_of, put_delivery
from conformance.packs.table1.robot.message_shapes import DELIVERIES as LIST
from conformance.packs.table1.robot.message_shapes import read_as
from conformance.packs.table1.robot.robot import ACCEPT_JSON, DELIVERIES, Robot
from conformance.transport.client import HttpClient
from conformance.transport.exchange import Exchange
from conformance.verdict.effort import Effort
from conformance.verdict.evidence import Judge
from conformance.verdict.explorer import Explorer

pytestmark = pytest.mark.needs("rest")
_PAPER: Final = Delivery(4, 68.269, 38.718, 60.633, 37.51, 76.02, 41.35)
_VALID: Final = ("4", "68.269", "38.718", "60.633", "37.51", "76.02", "41.35")
_TEXTS: Final = ("abc", "", "x1", "one")
_NON_FINITE: Final = ("NaN", "Infinity", "-Infinity", "1e400", "-1e400")
_CODES: Final = ("0", "1", "2", "5", "-3", "-4", "34", "2147483647", "-2147483648", "99999999999")
_BODIES: Final = (
    ("application/json", b'{"message_code": 3, "depot_x": 1.0}'),
    ("application/json", b"{"),
    ("application/xml", b"<a/>"),
    ("text/plain", b"3"),
    ("application/octet-stream", bytes(range(256))),
    ("application/x-www-form-urlencoded", b"code=3&depot_x=1"),
)


def _judge_taken(api: RestInterface, judge: Judge, path: str, expected: str) -> None:
    exchange = put_delivery(api, path)
    judge.check("rest-delivery/put-range", exchange.response.ok, exchange, expected)


@pytest.mark.phase("acting")
@pytest.mark.motion
@pytest.mark.requirement("rest-delivery/put", "rest-delivery/put-no-content", "rest-delivery/put-repeated")
def test_deliveries(api: RestInterface, judge: Judge, explore: Explorer) -> None:
    """PUT the paper's example and random deliveries, each once and again."""

    def try_delivery(delivery: Delivery) -> None:
        first = put_delivery(api, delivery.rest_path)
        again = put_delivery(api, delivery.rest_path)
        status = first.response.status
        repeated = again.response.status
        judge.check("rest-delivery/put", 200 <= status < 300, first, "2xx for a delivery")
        if 200 <= status < 300:
            judge.check("rest-delivery/put-no-content", status == 204, first, "204 for a delivery")
            judge.check("rest-delivery/put-repeated", 200 <= repeated < 300, again, "2xx for a delivery sent again")

    for code in (3, 4):
        try_delivery(_PAPER._replace(message_code=code))
    explore(deliveries(), try_delivery, cases=40)


@pytest.mark.phase("acting")
@pytest.mark.motion
@pytest.mark.requirement("rest-delivery/put-range")
def test_numbers_in_any_form(api: RestInterface, judge: Judge, explore: Explorer) -> None:
    """PUT finite doubles written with and without sign, fraction and exponent."""

    def try_forms(case: tuple[Delivery, tuple[str, ...]]) -> None:
        _, written = case
        exchange = put_delivery(api, path_of(*written))
        judge.require(
            "rest-delivery/put-range",
            exchange.response.ok,
            exchange,
            "2xx, whatever the finite double and however it is written",
            cause=exchange.came,
        )

    explore(lexical_deliveries(), try_forms, cases=60)
    for text in ("-0.0", "5e-324", "1.7976931348623157e308", "-1.7976931348623157e+308", ".5", "+1", "0"):
        _judge_taken(api, judge, path_of("3", *[text] * 6), f"2xx for coordinates written {text}")
    for code in ("+3", "04", "+4"):
        _judge_taken(api, judge, path_of(code, *_VALID[1:]), f"2xx for the code written {code}")


@pytest.mark.phase("acting")
@pytest.mark.motion
@pytest.mark.requirement("rest-delivery/put-body")
def test_a_body_is_ignored(api: RestInterface, rest: HttpClient, judge: Judge, effort: Effort) -> None:
    """PUT deliveries with bodies of any media type, which the robot must ignore."""
    put_delivery(api, _PAPER.rest_path)
    for media_type, body in _BODIES * effort.cases(1):
        exchange = rest.send("PUT", _PAPER.rest_path, headers=(("Content-Type", media_type),), body=body)
        judge.check(
            "rest-delivery/put-body",
            exchange.response.ok,
            exchange,
            f"2xx for a delivery with a body of {media_type}, which is ignored",
        )


@pytest.mark.phase("acting")
@pytest.mark.motion
@pytest.mark.requirement("rest-delivery/refuses-text", "rest-delivery/refuses-non-finite", "rest-delivery/refuses-code")
def test_what_is_no_delivery(rest: HttpClient, judge: Judge, explore: Explorer, effort: Effort) -> None:
    """PUT invalid deliveries: text or nothing for a number, numbers beyond a double's range, other codes."""

    def judge_refusal(name: str, place: int, text: str) -> None:
        values = list(_VALID)
        values[place] = text
        exchange = rest.send("PUT", path_of(*values))
        status = exchange.response.status
        # An empty number leaves an empty path segment, which a server may remove by a redirect.
        shortened = not text and status in {301, 302, 307, 308}
        judge.check(
            f"rest-delivery/{name}",
            400 <= status < 500 or shortened,
            exchange,
            f"4xx for {text!r} in the place of {'the code' if place == 0 else 'a coordinate'}",
            cause=f"{text} {exchange.came}",
        )

    for place, text in effort.alternatives([(place, text) for text in _TEXTS for place in range(7)], 8):
        judge_refusal("refuses-text", place, text)
    # The checkers judge the format of the refusal.
    rest.send("PUT", path_of("abc", *_VALID[1:]), headers=(("Accept", "application/xml"),))
    for place, text in effort.alternatives([(place, text) for text in _NON_FINITE for place in range(1, 7)], 8):
        judge_refusal("refuses-non-finite", place, text)
    for code in effort.alternatives(_CODES, 8):
        judge_refusal("refuses-code", 0, code)
    explore(
        st.integers(-(2**31), 2**31 - 1).filter(lambda code: code not in {3, 4}),
        lambda code: judge_refusal("refuses-code", 0, str(code)),
        cases=20,
    )
    explore(
        st.tuples(st.integers(0, 6), st.text("abcdfghjklmopqrstuvwyz", min_size=1, max_size=12)),
        lambda case: judge_refusal("refuses-text", *case),
        cases=20,
    )


# Deliveries that the list holds at least.
_LEAST: Final = 50
_STEP_S = 0.05  # pause between two reads of the list, s
_SOON_S = 1.0  # a robot may add a delivery to its list this long after the response, s


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
        entries: entries of the list, newest first.
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
