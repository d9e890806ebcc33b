"""What came of requests for one message each: any gateway's, and the paper's deliveries."""

import pytest

from conformance.rules.ros_gateway.arrivals import Request, come_though_refused, counts, in_order

TWO = [Request("first", 1, accepted=True, client="a"), Request("second", 2, accepted=True, client="a")]


@pytest.mark.parametrize(
    ("heard", "wrong"),
    [([1, 2], {}), ([1], {"second": 0}), ([1, 2, 2], {"second": 2}), ([1, 3], {"second": 0}), ([2, 1], {})],
)
def test_each_accepted_request_is_one_message(heard, wrong):
    assert {one.sent: came for one, came, least, most in counts(TWO, heard) if not least <= came <= most} == wrong


@pytest.mark.parametrize("heard", [[1], [1, 1]])
def test_the_message_of_a_request_without_a_clear_response_may_come(heard):
    requests = [Request("told", 1, accepted=True), Request("lost", 1, accepted=None)]
    assert [(came, least, most) for _, came, least, most in counts(requests, heard)] == [(len(heard), 1, 2)] * 2


@pytest.mark.parametrize(
    ("heard", "held"),
    [([1, 2], [True]), ([2, 1], [False]), ([2, 1, 2], [False]), ([1, 3, 2], [True]), ([1], []), ([], [])],
)
def test_the_messages_of_one_client_have_an_order(heard, held):
    assert [holds for _, holds in in_order(TWO, heard)] == held


def test_clients_have_no_order_among_each_other_and_neither_have_equal_messages():
    others = [TWO[0], Request("other", 2, accepted=True, client="b")]
    assert list(in_order(others, [2, 1])) == []
    equal = [*TWO, Request("again", 1, accepted=True, client="a")]
    assert list(in_order(equal, [2, 1, 1])) == []


def test_a_refused_request_is_no_message_but_another_one_may_be_equal():
    no = Request("no", 1, accepted=False)
    assert list(come_though_refused([no], [2])) == [(no, 0)]
    assert list(come_though_refused([no], [2, 1])) == [(no, 1)]
    assert list(come_though_refused([no, TWO[0]], [1])) == [(no, 0)]
    assert list(come_though_refused([no, TWO[0]], [1, 1])) == [(no, 1)]
