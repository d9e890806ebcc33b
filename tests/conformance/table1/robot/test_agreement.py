"""Whether a message is one that REST told before and after it, over REST and over SOAP."""

import math

import pytest
from toy_messages import exchange

from conformance.packs.table1.robot.state_read import (
    Slack,
    StateRead,
    best_of,
    contradiction,
    disagreement,
    stamp_fault,
    usable,
    without_stamps,
)

_SLACK = Slack(0.02, 0.05)


def _pose(x, sec=1):
    return {"header": {"stamp": {"sec": sec, "nanosec": 2}}, "pose": {"x": x, "covariance": [x, 0.0]}}


def test_what_did_not_change_is_the_same_double():
    assert disagreement(_pose(1.1), _pose(1.1), _pose(1.1), _SLACK) == ""
    found = disagreement(_pose(1.1), _pose(math.nextafter(1.1, 2)), _pose(1.1), _SLACK)
    assert found == "pose.x is 1.1000000000000003 for 1.1"


@pytest.mark.parametrize(("between", "agrees"), [(1.0, True), (1.3, True), (0.93, True), (0.9, False), (1.4, False)])
def test_what_changed_lies_between_its_neighbours_or_nearly(between, agrees):
    assert (disagreement(_pose(1.0), _pose(between), _pose(1.3), _SLACK) == "") is agrees


def test_what_is_missing_or_of_another_length_is_named():
    pose = _pose(1.0)
    assert disagreement(pose, {"header": pose["header"]}, pose, _SLACK) == "pose is missing"
    shorter = {**pose, "pose": {"x": 1.0, "covariance": [1.0]}}
    assert disagreement(pose, shorter, pose, _SLACK) == "pose.covariance has 1 items for 2"


def test_a_stamp_counts_only_while_it_stands_still():
    assert disagreement(_pose(1.0), _pose(1.0, sec=2), _pose(1.0), _SLACK) == "header.stamp.sec is 2 for 1.0"
    assert disagreement(_pose(1.0), _pose(1.0, sec=2), _pose(1.0, sec=3), _SLACK) == ""


def test_what_is_made_anew_is_compared_without_its_stamps():
    poses = {"poses": [_pose(1.0), _pose(2.0)]}
    assert without_stamps(poses) == without_stamps({"poses": [_pose(1.0, sec=5), _pose(2.0, sec=6)]})
    assert without_stamps(poses)["poses"][1] == {"header": {}, "pose": {"x": 2.0, "covariance": [2.0, 0.0]}}


def test_a_quaternion_and_its_negative_are_one_orientation():
    one = {"orientation": {"x": 0.0, "y": 0.0, "z": 0.6, "w": 0.8}}
    other = {"orientation": {"x": -0.0, "y": -0.0, "z": -0.6, "w": -0.8}}
    wrong = {"orientation": {"x": 0.0, "y": 0.0, "z": -0.6, "w": 0.8}}
    assert disagreement(one, other, one, Slack()) == disagreement(other, one, one, Slack()) == ""
    assert disagreement(one, wrong, one, Slack())


def stamped(sec, nanosec):
    return {"header": {"stamp": {"sec": sec, "nanosec": nanosec}}}


@pytest.mark.parametrize("apart", [1, -1, 999])
def test_a_stamp_that_is_off_by_some_nanoseconds_belongs_to_no_message(apart):
    before, after = stamped(1_700_000_000, 999_999_500), stamped(1_700_000_000, 999_999_500)
    sec, nanosec = divmod(1_700_000_000 * 10**9 + 999_999_500 + apart, 10**9)
    assert f"{apart:+d} ns" in stamp_fault(stamped(sec, nanosec), before, after)


def test_the_same_stamp_and_that_of_another_sample_are_in_order():
    before, after = stamped(5, 100), stamped(5, 20_000_100)
    for sound in (before, after, stamped(5, 10_000_100), {}):
        assert not stamp_fault(sound, before, after)


def test_a_sample_that_rest_tells_alike_is_no_other_over_soap():
    first, second = ({**stamped(5, 100), "x": x} for x in (1.0, 1.5))
    assert "x is 1.5 for 1.0" in contradiction(second, first, first)
    assert not contradiction(first, first, first)
    # A pose of the moment under a stamp that is coarse, and another sample.
    assert not contradiction(second, first, second)
    assert not contradiction({**second, **stamped(5, 200)}, first, first)


def test_of_several_tries_the_last_counts_and_what_is_wrong_for_good_in_those_before():
    answer = exchange(200)
    lags, wrong, same = (StateRead("pose", answer, *texts) for texts in (("", "x is 1"), ("no x", "x is 1"), ("", "")))
    assert best_of([lags, same, lags]) == [same]
    assert best_of([lags, lags]) == [lags]
    assert best_of([lags, None, lags]) == []
    assert [[case.holds for case in one.cases] for one in best_of([wrong, same])] == [[False, True], [True]]


@pytest.mark.parametrize(
    ("broken", "differs", "lasted", "counts"),
    [
        ("", "", False, ("", "")),
        ("", "x is 1", True, ("", "x is 1")),
        ("", "x is 1", False, None),
        ("no stamp", "x is 1", False, ("no stamp", "")),
    ],
)
def test_a_difference_counts_only_of_a_state_that_lasted(broken, differs, lasted, counts):
    read = usable(StateRead("velocity", exchange(), broken, differs), lasted=lasted)
    assert (read and (read.broken, read.differs)) == counts
