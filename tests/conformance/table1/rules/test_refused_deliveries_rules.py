"""Rules on deliveries that a robot rejects for another reason than their values, by traces made by hand."""

from types import SimpleNamespace

import pytest
from toy_messages import exchange

from conformance.packs.table1.robot.delivery import Delivery
from conformance.packs.table1.rules.rest_delivery.test_delivery import Listed
from conformance.packs.table1.rules.strict_input import test_refused_state as rules
from conformance.packs.table1.scenarios.deliveries import NO_CREDENTIALS, CountedDeliveries, Rejected

_SENT = [Delivery(3, *(float(number),) * 6) for number in range(60)]


def _rejected(status, code="", what=NO_CREDENTIALS):
    answer = SimpleNamespace(status=status, code=code, exchange=exchange(status), is_taken=status == 200)
    return Rejected.of(what, _SENT[0], answer)


@pytest.mark.parametrize(
    ("one", "arrived", "holds"),
    [
        (_rejected(401), False, [True]),
        (_rejected(401), True, [False]),
        (_rejected(500, "VersionMismatch"), True, [False]),
        (_rejected(500, "MustUnderstand"), True, [False]),
        (_rejected(500, "Server"), True, []),
        (_rejected(200), True, []),
    ],
)
def test_what_is_rejected_is_not_published(one, arrived, holds):
    trace = CountedDeliveries((exchange(422),), ())
    trace = CountedDeliveries((exchange(422),), (), (one,), seen=(trace.last, *([one.delivery] if arrived else [])))
    assert [case.holds for case in rules.unauthorized_delivery.outcomes(trace, {}.__getitem__)] == holds
    assert all(case.holds for case in rules.delivery_refused.outcomes(trace, {}.__getitem__)) is (False not in holds)


def test_without_an_observer_nothing_is_said_of_arrivals():
    trace = CountedDeliveries((exchange(422),), (), (_rejected(401),))
    assert list(rules.unauthorized_delivery.outcomes(trace, {}.__getitem__)) == []


def _entries(deliveries):
    return [{"request": one._asdict()} for one in deliveries]


_OTHER = Delivery(4, *(7.5,) * 6)


@pytest.mark.parametrize(
    ("entries", "taken", "in_order"),
    [
        (_entries(_SENT[:9:-1]), _SENT, True),
        (_entries(_SENT[10:]), _SENT, False),
        (_entries(_SENT[:10:-1]), _SENT, False),
        ([*_entries([_OTHER] * 3), *_entries(_SENT[:12:-1])], _SENT, True),
        (_entries(_SENT[4::-1]), _SENT[:5], True),
        ([], [], True),
    ],
)
def test_the_list_has_the_last_deliveries_newest_first(entries, taken, in_order):
    assert (not Listed(entries, taken, []).out_of_order) is in_order


def test_older_deliveries_before_newer_ones_are_out_of_order():
    older = [Delivery(3, *(0.25,) * 6)]
    entries = [*_entries(older * 50), *_entries(_SENT[:5])]
    assert Listed(entries, _SENT[:5], older).out_of_order
