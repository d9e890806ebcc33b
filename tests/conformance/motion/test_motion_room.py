"""Where a device is driven by velocity: never beyond the limits of its positions, whatever link and map."""

import dome
import pytest
import rover
from driven_device import SimulatedClock
from simulated import RULES, Api, Binding, cases_of, map_of, one_after_another, played

from conformance.scenarios.motion import several
from conformance.scenarios.motion.binding import SoapBinding
from conformance.scenarios.motion.driving import with_room
from conformance.scenarios.motion.mapped import MappedDevice
from conformance.scenarios.motion.room import Room
from conformance.scenarios.motion.trace import Drive, Reading


def _without_goto(toml):
    """Return a map of a device that takes velocities and no positions."""
    begin, end = toml.index("[motion.goto]"), toml.index("[motion.velocity]")
    return (
        (toml[:begin] + toml[end:])
        .replace('unit = "m"', "tolerance = 0.03")
        .replace(", speed = 6 }", ", tolerance = 0.03 }")
    )


def _within(toml, limit):
    clamps = 'tolerance = 0.03\nbeyond_limits = "clamped"'  # by the rover's own limits
    return toml.replace("limits = [-0.6, 0.6]", f"limits = [-{limit}, {limit}]").replace(clamps, "tolerance = 0.03")


_AGREES = 'agrees = { "GET /velocity" = { left = "/left" } }\n'
_BY_POSITION = rover.MAP.replace('at = "/velocity/1"', 'of = "y"').replace(_AGREES, "")
_MAPS = {
    "rover": ("rover", rover.MAP),
    "narrow": ("rover", _within(rover.MAP, 0.3)),
    "narrow, both by position": ("rover", _within(_BY_POSITION, 0.25)),
    "velocities only": ("rover", _without_goto(_BY_POSITION)),
    "narrow, velocities only": ("rover", _within(_without_goto(_BY_POSITION), 0.3)),
    "camera": ("dome", dome.MAP),
    "camera, velocities only": ("dome", _without_goto(dome.MAP)),
}


@pytest.fixture
def places(monkeypatch):
    """Where the device was whenever it took a command or was read, by axis."""
    found = []
    right = rover.Body.at

    def at(body, now):
        here = right(body, now)
        found.append(here)
        return here

    monkeypatch.setattr(rover.Body, "at", at)
    return found


@pytest.mark.parametrize("takes_s", [0.002, 0.3])
@pytest.mark.parametrize("name", _MAPS)
def test_a_drive_ends_before_the_limits(name, takes_s, places):
    device, toml = _MAPS[name]
    drives, failed = 0, []
    for scenario, trace, given in played(device, takes_s=lambda: takes_s, toml=toml):
        axes = given["motion"].state.axes
        drives += sum(isinstance(one, Drive) for one in trace) if isinstance(trace, tuple) else 0
        for rule in RULES:
            if scenario in rule.on:
                failed.extend(one for one in cases_of(rule, trace, given) if not one.holds)
    assert not failed
    assert drives >= 4 or takes_s == 0.3  # over so slow a link there may be no room for any
    for axis in axes:
        room = 1e-6 if "clamped" in toml else given["motion"].tolerance(axis)
        assert axes[axis].limits[0] - room <= min(one[axis] for one in places)
        assert max(one[axis] for one in places) <= axes[axis].limits[1] + room


def test_a_device_that_is_beyond_a_limit_of_another_axis_is_brought_to_where_there_is_room():
    clock = SimulatedClock()
    body = dome.Body(dome.LIMITS, clock.now, clock.sleep)
    body.start = body.target = {"pan": 0.95, "tilt": 0.52}
    api = Api(dome.Dome(body), clock, lambda: 0.002)
    mapped = MappedDevice(api, map_of(dome.MAP), clock, SoapBinding(api, dome.messages_of()))
    assert with_room(mapped, [{"pan": 0.5}], 0.7) == [{"pan": 0.5}]
    assert mapped.where()["tilt"] == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("moments", "tilt", "leads_on", "is_over"),
    [
        ([0.0, 0.1], 0.0, False, False),  # two readings do not show where it will be
        ([0.0, 0.1, 0.2], 0.0, True, False),
        ([0.0, 0.1, 0.2], -0.45, False, False),
        ([0.0, 0.1, 0.5], -0.35, False, True),  # a pause as long as the last one takes it beyond its limit
    ],
)
def test_a_drive_leads_on_where_it_is_seen_and_ends_where_a_pause_may_follow(moments, tilt, leads_on, is_over):
    room = Room(map_of(dome.MAP))
    seen = [Reading(moment, moment, {"pan": 0.0, "tilt": tilt}, None, None) for moment in moments]
    down = {"pan": 0.0, "tilt": -1.0}
    assert (room.leads_on(down, seen, 0.4), room.is_over([down], seen, 0.0)) == (leads_on, is_over)


@pytest.mark.parametrize("ends", [True, False])
def test_clients_at_an_end_of_travel_are_told_from_a_mixture_that_stands(ends, monkeypatch):
    clock = SimulatedClock()
    body = rover.Body({"x": (-0.6, 0.6), "y": (-0.6, 0.6)}, clock.now, clock.sleep)
    right, at, last = body.drive, body.at, [(-1.0, 0.0)]

    def drive(speeds, hold_s, now):
        (then, before), last[0] = last[0], (now, speeds["x"])
        mixed = now - then < 0.01 and before + speeds["x"] == 0
        right({**speeds, "x": 0.0} if mixed and not ends else speeds, hold_s, now)

    body.drive = drive
    body.at = lambda now: {name: min(value, 0.01) if ends else value for name, value in at(now).items()}
    toml = _without_goto(_BY_POSITION).replace("limits = [-0.6, 0.6]", "bound = false, limits = [-0.6, 0.6]")
    api = Api(rover.Rover(body), clock, lambda: 0.002)
    mapped = MappedDevice(api, map_of(toml), clock, Binding(api))
    monkeypatch.setattr(several, "send_together", one_after_another)
    found = several.of_drivers(mapped, [{"ahead": -0.5, "left": 0.0}, {"ahead": 0.5, "left": 0.0}])
    assert found.at_end is ends
