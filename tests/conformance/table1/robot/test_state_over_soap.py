"""Whether a message over SOAP is one that REST gives too."""

import pytest

from conformance.packs.table1.robot.state_over_soap import StateRead, agreed, contradiction, restamped
from conformance.transport.exchange import Exchange, Request, Response


def stamped(sec, nanosec):
    return {"header": {"stamp": {"sec": sec, "nanosec": nanosec}}}


@pytest.mark.parametrize("apart", [1, -1, 999])
def test_a_stamp_that_is_off_by_some_nanoseconds_belongs_to_no_message(apart):
    before, after = stamped(1_700_000_000, 999_999_500), stamped(1_700_000_000, 999_999_500)
    sec, nanosec = divmod(1_700_000_000 * 10**9 + 999_999_500 + apart, 10**9)
    assert f"{apart:+d} ns" in restamped(stamped(sec, nanosec), before, after)


def test_the_same_stamp_and_that_of_another_sample_are_in_order():
    before, after = stamped(5, 100), stamped(5, 20_000_100)
    for sound in (before, after, stamped(5, 10_000_100), {}):
        assert not restamped(sound, before, after)


def test_a_sample_that_rest_tells_alike_is_no_other_over_soap():
    first, second = ({**stamped(5, 100), "x": x} for x in (1.0, 1.5))
    assert "x is 1.5 for 1.0" in contradiction(second, first, first)
    assert not contradiction(first, first, first)
    # A pose of the moment under a stamp that is coarse, and another sample.
    assert not contradiction(second, first, second)
    assert not contradiction({**second, **stamped(5, 200)}, first, first)


def test_of_several_tries_the_last_counts_and_what_is_wrong_for_good_in_those_before():
    exchange = Exchange(Request("POST", "http://robot/"), Response(200, (), b"", 1.0))
    lags, wrong, same = (
        StateRead("pose", exchange, *texts) for texts in (("", "x is 1"), ("no x", "x is 1"), ("", ""))
    )
    assert agreed([lags, same, lags]) == [same]
    assert agreed([lags, lags]) == [lags]
    assert agreed([lags, None, lags]) == []
    assert [[case.holds for case in one.cases] for one in agreed([wrong, same])] == [[False, True], [True]]
