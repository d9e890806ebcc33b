"""The delivery's PUT: the robot must accept all valid values and reject all others."""

from typing import Final

import pytest
from hypothesis import strategies as st

from conformance.api.rest.interface import RestInterface
from conformance.packs.table1.robot.delivery import Delivery, deliveries, lexical_deliveries, path_of, put_delivery
from conformance.transport.client import HttpClient
from conformance.verdict.effort import Effort
from conformance.verdict.evidence import Judge
from conformance.verdict.explorer import Explorer

pytestmark = [pytest.mark.phase("acting"), pytest.mark.needs("rest"), pytest.mark.motion]
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
