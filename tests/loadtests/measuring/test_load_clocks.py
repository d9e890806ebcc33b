"""Clocks read by exchanges of messages."""

from hypothesis import given
from hypothesis import strategies as st

from loadtests.measuring.clocks import Reading, WorkerClock, best

ways = st.integers(0, 10**9)


@given(st.integers(-(10**18), 10**18), st.lists(st.tuples(ways, ways), min_size=1, max_size=8))
def test_an_offset_is_wrong_by_half_the_shortest_round_trip_at_most(offset, delays):
    readings = [Reading.of(5, 5 + there + offset, 5 + there + back) for there, back in delays]
    found = best(readings)
    assert found.round_trip_ns == min(there + back for there, back in delays)
    assert abs(found.offset_ns - offset) <= found.round_trip_ns / 2 + 1


def test_a_moment_of_the_masters_by_a_workers_clock():
    clock = WorkerClock()
    assert clock.of_master(7) is None
    assert clock.figures() is None
    clock.add(Reading(1_000_000, 400_000))
    clock.add(Reading(1_250_000, 200_000))
    assert clock.of_master(7) == 1_250_007
    figures = {"offset_ms": 1.25, "uncertainty_ms": 0.1, "round_trip_ms": 0.2, "change_ms": 0.25}
    assert clock.figures() == figures | {"shared": False}
    clock.shared = True
    assert clock.of_master(7) == 7, "what is one clock is not moved by the error of reading it"
    assert best([]) is None
