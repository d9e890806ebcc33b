"""The mission queue: order, overflow, abandonment, memory."""

import json

from hypothesis import given
from hypothesis import strategies as st

from conformance.papers_robot.delivery import MESSAGE_FIELDS
from reference_robot.deliveries import DeliveryRequest
from reference_robot.simulation.delivery import Mission, Missions, MissionState


def request(number=0):
    return DeliveryRequest(4, float(number), 2.0, 3.0, 4.0, 5.0, 6.0)


def queued(count, **options):
    missions = Missions(**options)
    for number in range(count):
        missions.add(request(number), (number, 0))
    return missions


def states(missions):
    """States of the missions that changed since this was asked last, newest first."""
    return [mission.state.value for mission in missions.changes()]


def test_the_stops_are_source_destination_depot():
    assert Mission(DeliveryRequest(4, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0), (0, 0), 1).stops() == ((5, 6), (3, 4), (1, 2))


def test_missions_begin_in_the_order_they_came():
    missions = Missions()
    added = [missions.add(request(number), (number, 0)) for number in range(3)]
    for mission in added:
        assert missions.begin() is mission
        assert missions.begin() is None  # one at a time
        missions.finish(MissionState.DONE)
    assert missions.begin() is None
    assert states(missions) == ["done"] * 3


def test_a_request_beyond_the_capacity_is_dropped_and_those_that_wait_stay():
    assert states(queued(22, capacity=20)) == ["dropped", "dropped", *["queued"] * 20]


def test_abandoning_fails_the_active_mission_and_drops_the_rest():
    missions = queued(3)
    missions.begin()
    missions.abandon()
    assert states(missions) == ["dropped", "dropped", "failed"]
    assert missions.begin() is None


def test_a_mission_in_plain_values_is_what_the_topic_carries():
    assert json.loads(json.dumps(Mission(request(1), (12, 34), 7).plain())) == {
        "request": dict(zip(MESSAGE_FIELDS, (4, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0), strict=True)),
        "state": "queued",
        "number": 7,
        "reason": "",
        "accepted": {"sec": 12, "nanosec": 34},
    }


@given(st.lists(st.sampled_from(["add", "begin", "done", "failed", "abandon"]), max_size=200))
def test_whatever_happens_the_bounds_hold(events):
    missions, now = Missions(capacity=3), {}
    for number, event in enumerate(events):
        if event == "add":
            missions.add(request(number), (number, 0))
        elif event == "begin":
            missions.begin()
        elif event == "abandon":
            missions.abandon()
        else:
            missions.finish(MissionState(event))
        for mission in missions.changes():
            now[mission.number] = mission.state.value
        assert list(now.values()).count("active") <= 1
        assert list(now.values()).count("queued") <= 3
        assert list(now.values()).count("dropped") == missions.dropped
        assert len(now) == missions.taken


def test_a_flood_hides_no_mission_that_waits_or_drives():
    missions = Missions(capacity=2)
    missions.add(request(), (0, 0))
    missions.begin()
    for number in range(500):
        missions.add(request(number), (number, 0))
    told = states(missions)
    assert (len(told), told[-3:]) == (100, ["queued", "queued", "active"])
    assert (missions.taken, missions.dropped) == (501, 498)
    assert states(missions) == []
