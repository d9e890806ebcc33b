"""The search for the knee, on a robot whose knee is known."""

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from loadtests.statistics.knee import RESOLUTION, Criterion, Step, knee_search, search_again

P99 = Criterion({"p99": 50.0})


def robot(knee, tried=None, seconds=10):
    """What an attempt finds on a robot that gives way at a rate."""

    def attempt(rate, search):
        assert search >= 1
        if tried is not None:
            tried.append(rate)
        meets = rate < knee
        known = dict.fromkeys(Step.__struct_fields__) | {"offered_rate": rate, "meets": meets, "dropped": 0}
        known |= {"errors": 0 if rate < 2 * knee else 3, "reason": None if meets else "too slow"}
        known["count"] = int(rate * seconds)
        return Step(**known | {"cpu_share": 0.2})

    return attempt


@given(st.floats(60, 40_000))
def test_every_search_encloses_the_knee_in_few_steps(knee):
    tried = []
    found = knee_search("rest", P99, search_again(5, (50, 50_000), robot(knee, tried)))
    assert found["interval"][0] <= knee <= found["interval"][1]
    for kept, missed in found["brackets"]:
        assert kept < knee <= missed
        assert missed / kept <= RESOLUTION + 1e-6
    assert found["confidence"] == pytest.approx(0.9375)
    assert len(tried) <= 28 + 4 * 16, "what missed is tried twice"
    assert found["limited_by"] == "robot"


def test_steps_of_few_requests_know_no_p99():
    found = knee_search("rest", P99, search_again(5, (50, 50_000), robot(100, seconds=1)))
    assert (found["confidence"], found["needed_requests"]) == (None, 368)
    assert 90 <= found["step_requests"] <= 100
    median = knee_search("rest", Criterion({"p50": 50.0}), search_again(5, (50, 50_000), robot(100, seconds=1)))
    assert median["confidence"] == pytest.approx(0.9375)


def test_a_rate_that_missed_by_chance_ends_no_branch():
    tried = []
    good = robot(900, tried)

    def attempt(rate, search):
        trial = good(rate, search)
        unlucky = rate == 200 or (rate > 600 and tried.count(rate) == 1)
        return msgspec.structs.replace(trial, meets=trial.meets and not unlucky)

    found = knee_search("rest", P99, search_again(3, (50, 50_000), attempt))
    assert all(kept < 900 <= missed for kept, missed in found["brackets"])
    assert {point.offered_rate for point in found["curve"]} == set(tried)


def test_a_miss_while_the_generator_was_late_is_tried_again():
    left = iter(range(4))

    def attempt(rate, search):
        late = 300 < rate < 500 and next(left, None) is not None
        trial = robot(900)(rate, search)
        return msgspec.structs.replace(trial, meets=trial.meets and not late, cpu_share=0.99 if late else 0.2)

    (search,) = search_again(1, (50, 50_000), attempt)
    assert search.floor < 900 <= search.ceiling


def test_what_lies_beyond_the_limits_is_not_guessed():
    above = knee_search("rest", P99, search_again(2, (50, 400), robot(1e6)))
    assert (above["rate"], above["interval"], above["held_up_to"]) == (None, None, 400)
    below = knee_search("rest", P99, search_again(2, (50, 400), robot(1)))
    assert (below["rate"], below["held_up_to"], below["brackets"]) == (None, None, [[None, 50]] * 2)


def test_the_end_of_the_time_ends_the_searches():
    left = iter(range(4))
    searches = search_again(3, (50, 400), lambda *each: robot(170)(*each) if next(left, None) is not None else None)
    assert searches == []
