"""What ``--drive`` finds of a device: its axes, limits, times, stop and lease, by which it is then judged."""

import copy
import json
import math
from unittest.mock import patch

import pytest
import rover
from arm import LIMITS, Arm
from body import Body
from driven_device import SimulatedClock
from judged_devices import MOVES
from rover import Rover
from simulated import Api, Binding, Unread, cases_of, map_of

from conformance.api.call_rules import CallRules
from conformance.documents.openapi import read_operations
from conformance.engine.commanded import Commanded, commanded_by, lasting, titles_in, with_query
from conformance.engine.driven_numbers import Looks, numbers_of
from conformance.engine.finding import plan_of
from conformance.engine.first_described import proposed_map
from conformance.engine.found_positions import PositionFinder
from conformance.engine.found_velocities import VelocityFinder
from conformance.engine.map_text import template_of
from conformance.rules.motion.test_motion import stop_rests
from conformance.rules.motion.test_motion_attempts import unauthorised_still
from conformance.rules.motion.test_velocities import stopped, velocity, watchdog
from conformance.scenarios.motion import attempts
from conformance.scenarios.motion import velocities as driving_velocities
from conformance.scenarios.motion.mapped import MappedDevice
from conformance.scenarios.motion.moves import stops
from conformance.scenarios.motion.velocities import let_go, velocities
from conformance.transport.exchange import Exchange, Request, Response
from conformance.verdict.effort import Effort
from conformance.verdict.run import Run


class Creeping(Body):
    """A rover that goes on at a fiftieth of its greatest speed when it is stopped."""

    def drive(self, speeds, hold_s, now):
        before = self.velocity(now)
        slow = {name: math.copysign(rover.FASTEST / 50, speed) for name, speed in before.items()}
        super().drive(
            *((slow, math.inf) if any(before.values()) and not any(speeds.values()) else (speeds, hold_s)), now
        )


class Late(Body):
    """A rover that drives on for a while when it is stopped."""

    def drive(self, speeds, hold_s, now):
        if any(speeds.values()) or not any(self.velocity(now).values()):
            super().drive(speeds, hold_s, now)
        else:
            self.held_until = now + 0.6


class Accelerating(Body):
    """A rover that needs half a second to reach its greatest speed, and as long to stop."""

    RATE = 2 * rover.FASTEST

    def __post_init__(self):
        super().__post_init__()
        self.here, self.seen, self.rates = dict(self.start), self.now(), dict.fromkeys(self.limits, 0.0)

    def _at(self, now):
        while self.seen + 0.002 <= now:
            self.seen += 0.002
            wanted = super().velocity(self.seen)
            for name, rate in self.rates.items():
                most = 0.002 * self.RATE
                self.rates[name] = rate + max(-most, min(most, wanted[name] - rate))
                self.here[name] += 0.002 * self.rates[name]
        return dict(self.here)

    def velocity(self, now):
        self.at(now)
        return dict(self.rates)


class Backward(Rover):
    """A rover whose velocities have the names of its axes, and take it the other way."""

    DESCRIPTION = json.loads(json.dumps(rover.DESCRIPTION).replace('"ahead"', '"x"').replace('"left"', '"y"'))

    def answer(self, method, path, octets):
        speeds = json.loads(octets) if path == "/velocity" and octets else {}
        if all(isinstance(speed, int | float) for speed in speeds.values()):
            octets = json.dumps({"ahead": -speeds.get("x", 0), "left": -speeds.get("y", 0)}).encode()
        status, said = super().answer(method, path, octets)
        return status, dict(zip("xy", said["pose"], strict=True)) if path == "/pose" else said


class Holding(Body):
    """A rover that holds a velocity for two seconds."""

    def drive(self, speeds, hold_s, now):
        super().drive(speeds, 5 * hold_s, now)


class Stopping(Rover):
    """A rover with a stop beside its velocities."""

    DESCRIPTION = rover.DESCRIPTION | {
        "paths": {**rover.DESCRIPTION["paths"], "/stop": {"post": {"summary": "Stop driving.", "responses": {}}}}
    }

    def answer(self, method, path, octets):
        return self.stop() if path == "/stop" else super().answer(method, path, octets)

    def stop(self):
        self.body.halt(self.body.now())
        return 200, {}


class IgnoringStop(Stopping):
    """A rover that answers its stop and drives on."""

    def stop(self):
        return 200, {}


class Resuming(Stopping):
    """A rover that drives on a second after it was stopped."""

    def stop(self):
        speeds = dict(self.body.speeds)
        self.body.later.append((self.body.now() + 1.0, lambda due: self.body.drive(speeds, 0.6, due)))
        return super().stop()


class StoppingGoals(Stopping):
    """A rover whose stop is for its goals alone."""

    def stop(self):
        return 409, {"detail": "no goal is active"}


def _simulated(body_type, noise=0.0, rule=stopped, scenario=velocities, text="", device=Rover):
    """Return the map that is found of a simulated rover, and the failures of a rule, first that on its stops."""
    clock = SimulatedClock()
    body = body_type(rover.LIMITS, clock.now, clock.sleep, noise)
    api = Api(device(body), clock, lambda: 0.002)
    plan = plan_of(
        read_operations(getattr(device, "DESCRIPTION", rover.DESCRIPTION)),
        "PUT /velocity",
        None,
        CallRules(),
        text=text,
    )
    motion = map_of("\n".join(VelocityFinder(api, Binding(api), plan, clock).find().lines))
    mapped = MappedDevice(api, motion, clock, Binding(api))
    given = {"mapped": mapped, "effort": Effort("quick"), "run": Run(), "motion": motion}
    with patch.object(driving_velocities, "PartialRequest", Unread):
        trace = scenario.play(**{name: given[name] for name in scenario.fixtures})
    return motion, [case.observed for case in cases_of(rule, trace, given) if not case.holds]


@pytest.mark.parametrize("noise", [0.0, 0.0005])
def test_what_stops_late_or_creeps_is_found_by_the_time_and_the_rest_of_a_right_rover(noise):
    assert _simulated(Body, noise)[1] == []
    assert any("on and on" in said for said in _simulated(Creeping, noise)[1])
    motion, failures = _simulated(Late, noise)
    assert failures
    assert motion.velocity is not None
    assert motion.velocity.settle_s < 0.5, "how late it stopped is no time that it needs"


def test_how_long_a_rover_holds_a_velocity_is_found_though_it_drives_the_wrong_way():
    motion, failures = _simulated(Body, rule=velocity, device=Backward)
    assert motion.velocity.hold_s == pytest.approx(rover.HOLD_S, abs=0.1)
    assert len(failures) > 2, "it is driven back to where there is room, and drives on"


@pytest.mark.parametrize(("device", "is_blamed"), [(Stopping, False), (IgnoringStop, True), (Resuming, True)])
def test_a_stop_beside_velocities_is_found_and_has_to_stop_the_rover(device, is_blamed):
    motion, failures = _simulated(Holding, rule=stop_rests, device=device)
    assert motion.stop.send == "POST /stop"
    assert bool(failures) == is_blamed, failures


def test_a_stop_that_is_for_something_else_is_none_of_velocities():
    assert _simulated(Body, device=StoppingGoals)[0].stop is None
    paths = copy.deepcopy(Stopping.DESCRIPTION["paths"])
    paths["/stop"]["post"]["summary"] = "Stop the mission."
    operations = read_operations({**Stopping.DESCRIPTION, "paths": paths})
    assert plan_of(operations, "PUT /velocity", None, CallRules()).stop is None


@pytest.mark.parametrize("rule", [stopped, velocity])
def test_a_rover_gets_the_time_that_it_needs_to_accelerate(rule):
    motion, failures = _simulated(Accelerating, rule=rule)
    assert failures == []
    assert 0.4 < motion.velocity.settle_s < 1.0, "as it was seen at its greatest speed"


_NUMBER = {"type": "number"}


class Slide:
    """A slide that is sent to a position; ``shows_end``: it tells where it is only once it has arrived."""

    def __init__(self, clock, speed, *, shows_end=False, least=-1.0, sign=1):
        self.clock, self.speed, self.shows_end, self.least, self.sign = clock, speed, shows_end, least, sign
        self.start = self.goal = self.since = 0.0

    def answer(self, method, path, octets):
        way, done = self.goal - self.start, self.speed * (self.clock.now() - self.since)
        here = self.goal if done >= abs(way) else self.start + (0.0 if self.shows_end else math.copysign(done, way))
        if method == "PUT":
            self.start, self.since = here, self.clock.now()
            self.goal = max(self.least, self.sign * json.loads(octets)["x"]) if path == "/goto" else here
        return 200, {"x": here}


def _slide(speed, members=None, **more):
    """Return the map that is found of a slide whose moves have these members, and how its stops are judged."""
    goto = {"type": "object", "properties": {"x": _NUMBER, **(members or {})}, "required": ["x"]}
    told = {"200": {"content": {"application/json": {"schema": goto}}}}
    move = {"requestBody": {"content": {"application/json": {"schema": goto}}}, "responses": told}
    paths = {"/goto": {"put": move}, "/stop": {"put": {"responses": told}}, "/state": {"get": {"responses": told}}}
    operations = read_operations({"openapi": "3.1.0", "info": {}, "paths": paths})
    clock = SimulatedClock()
    api = Api(Slide(clock, speed, **more), clock, lambda: 0.002)
    plan = plan_of(operations, "PUT /goto", None, CallRules())
    motion = map_of("\n".join(PositionFinder(api, Binding(api), plan, clock).find().lines))
    given = {"mapped": MappedDevice(api, motion, clock, Binding(api)), "effort": Effort("quick"), "motion": motion}
    return motion, list(stop_rests.outcomes(stops.play(**{name: given[name] for name in stops.fixtures}), given.get))


@pytest.mark.parametrize(
    ("speed", "how", "limits"),
    [(0.5, {}, (-0.19, 0.19)), (0.5, {"least": 0.0}, (0.0, 0.31)), (0.003, {"shows_end": True}, (0.0, 0.01))],
)
def test_a_slide_is_sent_so_far_that_it_can_be_stopped_from_an_end_of_its_travel_too(speed, how, limits):
    motion, outcomes = _slide(speed, **how)
    assert motion.state.axes["x"].limits == pytest.approx(limits, abs=0.05)
    assert {getattr(one, "holds", None) for one in outcomes} == {True}


def test_a_slide_that_goes_the_wrong_way_gets_a_map_by_which_it_is_judged():
    assert _slide(0.5, sign=-1)[0].state.axes["x"].limits == (-0.05, 0.05)


@pytest.mark.parametrize(("said", "most", "speed"), [("mm/s", 300, 300), ("percent of 500 mm/s", 100, None)])
def test_a_declared_greatest_speed_of_a_move_is_that_of_its_axis(said, most, speed):
    number = {"type": "number", "minimum": 1, "maximum": most, "description": said}
    assert _slide(200.0, {"x": {**_NUMBER, "description": "mm"}, "speed": number})[0].state.axes["x"].speed == speed


def test_an_axis_is_sent_so_far_that_a_greatest_speed_can_be_exceeded():
    speed = {**_NUMBER, "minimum": 1, "maximum": 90, "description": "mm/s"}
    place = {**_NUMBER, "minimum": -200, "maximum": 200, "description": "mm"}
    axis = _slide(20.0, {"x": place, "speed": speed})[0].state.axes["x"]
    assert (axis.speed, axis.limits) == (90, (-45, 45)), "at its greatest speed, the way takes a second"


def test_what_is_there_at_once_cannot_be_stopped_and_the_user_is_told_what_to_change():
    motion, outcomes = _slide(1000.0)
    assert max(motion.state.axes["x"].limits) == 0.5, "ten times a small move, and no farther"
    assert [getattr(one, "reason", "").partition(". ")[2] for one in outcomes] == [
        "Give x wider limits in the map, or a lower speed, so that a move takes about a second"
    ]


_BODY = {"type": "object", "properties": {"pan": _NUMBER, "timeout_ms": _NUMBER}}


def test_what_an_operation_is_called_says_whether_it_takes_ways():
    body = {"requestBody": {"content": {"application/json": {"schema": _BODY}}}, "responses": {}}
    document = {"openapi": "3.1.0", "info": {}, "paths": {f"/{name}": {"post": body} for name in ("relative", "goto")}}
    by, to = read_operations(document)
    assert [number.is_relative for one in (by, to) for number in commanded_by(one)] == [True, False]
    assert lasting(_BODY) == {"/timeout_ms": 1000.0}


_WHEELS = {"type": "array", "items": _NUMBER, "minItems": 2, "maxItems": 2, "description": "[left, right] in m/s"}
_TOKEN = {"type": "object", "properties": {"token": {"type": "string"}}}
_POSE = {
    "type": "object",
    "properties": {"pose": {**_WHEELS, "maxItems": 3, "minItems": 3, "description": "x, y, theta"}},
}


def _described(body, query, path="/lease", state=_POSE):
    wanted = {"name": query, "in": "query", "required": True, "schema": {"type": "string"}}
    drive = {
        "parameters": [wanted],
        "requestBody": {"content": {"application/json": {"schema": body}}},
        "responses": {},
    }
    release = {"requestBody": {"content": {"application/json": {"schema": _TOKEN}}}, "responses": {}}
    given = {"responses": {"200": {"content": {"application/json": {"schema": state}}}}}
    paths = {
        "/drive": {"post": drive},
        path: {"post": given},
        f"{path}/release": {"post": release},
        "/state": {"get": given},
    }
    return read_operations({"openapi": "3.1.0", "info": {}, "paths": paths})


def test_a_list_is_driven_by_the_names_of_its_items_and_carries_the_lease_in_the_query():
    plan = plan_of(_described(_WHEELS, "token"), "POST /drive", None, CallRules())
    assert [(number.name, number.place) for number in plan.numbers] == [("left", "/0"), ("right", "/1")]
    assert plan.drive.label == "POST /drive?token={lease}"
    lease = plan.preparing.lease
    assert (lease.acquire, lease.release, lease.release_body) == (
        "POST /lease",
        "POST /lease/release",
        {"token": "{lease}"},
    )
    assert template_of(_WHEELS, {"/0": "{left}", "/1": "{right}"}) == ["{left}", "{right}"]
    assert Looks(titles_in(_POSE)).is_heading("/pose/2")


def test_the_stop_is_the_nearest_one_and_else_the_end_of_a_move():
    move = {"requestBody": {"content": {"application/json": {"schema": _BODY}}}, "responses": {}}
    stop, read = {"post": {"responses": {}}}, {"get": {"responses": {"200": {"content": {"application/json": {}}}}}}
    paths = {"/arm/moves": {"post": move}, "/arm/moves/{id}": {"delete": {"responses": {}}}, "/state": read}
    near = {"/stop": stop, "/app/stop": stop}
    below = {**near, "/arm/moves/stop": stop, "/arm/moves/left/stop": stop}
    for more, found in ({}, "DELETE /arm/moves/{id}"), (near, "POST /stop"), (below, "POST /arm/moves/stop"):
        operations = read_operations({"openapi": "3.1.0", "info": {}, "paths": {**paths, **more}})
        assert plan_of(operations, "POST /arm/moves", None, CallRules()).stop.label == found
    stop["post"]["summary"] = "Emergency stop, latched until it is reset"
    operations = read_operations({"openapi": "3.1.0", "info": {}, "paths": {**paths, "/stop": stop}})
    assert plan_of(operations, "POST /arm/moves", None, CallRules()).stop.method == "DELETE"


@pytest.mark.parametrize(
    ("text", "holds_s", "replaces"),
    [
        ("If no drive command arrives for 0.5 s, it stops. Brakes rest it 0.2 s later.", 0.5, False),
        ("It stops by itself 300 ms after the last twist, so send one every 100 ms.", 0.3, False),
        ("Rates are held for one second after the last command; a new goal replaces the old one.", 1.0, True),
        ("Stops within 2 s. No command is lost. The new target is shown.", None, False),
    ],
)
def test_words_of_a_description_say_how_long_a_velocity_holds_and_what_a_second_target_does(text, holds_s, replaces):
    operations = read_operations(rover.DESCRIPTION)
    plan = plan_of(operations, "PUT /velocity", None, CallRules(), text=text)
    assert (plan.holds_s, plan.replaces) == (holds_s, replaces)


@pytest.mark.parametrize(
    ("place", "schema", "bounds", "words"),
    [
        ("/linear", {"description": "m/s, at most 0.5 m/s"}, (-0.5, 0.5), "at most 0.5 m/s"),
        ("/speed", {"minimum": 0, "description": "up to 0.8"}, (0.0, 0.8), "up to 0.8"),
        ("/x", {"description": "between -1 and 1.5 m"}, (-1.0, 1.5), "between -1 and 1.5 m"),
        ("/yaw", {"description": "heading in [-3.1, 3.1] rad"}, (-3.1, 3.1), "[-3.1, 3.1] rad"),
        ("/yaw", {"description": "-90 to 90 degrees"}, (-90.0, 90.0), "-90 to 90 degrees"),
        ("/v", {"minimum": -1, "maximum": 1, "description": "at most 0.5 m/s"}, (-1.0, 1.0), ""),
        ("/speed", {"description": "0.3 m/s by default, at most 0.5 m/s"}, None, ""),
        ("/speed", {"description": "at most 0.5 m/s, at most 0.2 m/s indoors"}, None, ""),
        ("/speed", {"description": "held for at most 2 s"}, None, ""),
        ("/speed_mm", {"description": "at most 0.5 m/s"}, None, ""),
        ("/speed", {"description": "at most 0.5 m/s when docked"}, None, ""),
        ("/speed", {"description": "see chapter 2.1"}, None, ""),
    ],
)
def test_limits_in_words_are_those_of_an_unequivocal_sentence(place, schema, bounds, words):
    number = Commanded("it", place, {"type": "number", **schema}, turns=False, operation="/drive")
    assert (number.bounds, words in number.source) == (bounds, True)
    assert bool(number.source) == bool(bounds)


def test_limits_in_words_of_a_list_are_those_of_its_items_and_stand_in_the_map():
    said = "rad: base -2.6 to 2.6, shoulder -1.0 to 1.8"
    joints = {"type": "array", "minItems": 2, "maxItems": 2, "items": _NUMBER, "description": said}
    body = {"type": "object", "properties": {"joints": joints}}
    move = {"put": {"requestBody": {"content": {"application/json": {"schema": body}}}, "responses": {}}}
    seen = {"type": "object", "properties": {"joints": {**joints, "description": ""}}}
    read = {"get": {"responses": {"200": {"content": {"application/json": {"schema": seen}}}}}}
    operations = read_operations({"openapi": "3.1.0", "info": {}, "paths": {"/target": move, "/joints": read}})
    assert [one.bounds for one in commanded_by(operations[0])] == [(-2.6, 2.6), (-1.0, 1.8)]
    lines = "\n".join(proposed_map(operations))
    assert 'limits = [-1, 1.8] }  # limits: as its description says: "-1.0 to 1.8 rad"' in lines


class LateWatchdog(Body):
    """A rover whose hold time is three times as long."""

    def drive(self, speeds, hold_s, now):
        super().drive(speeds, 3 * hold_s, now)


@pytest.mark.parametrize(("body_type", "is_blamed"), [(Body, False), (LateWatchdog, True)])
def test_a_hold_time_that_the_description_names_in_words_is_judged(body_type, is_blamed):
    said = f"It stops {rover.HOLD_S:g} s after the last command."
    motion, failures = _simulated(body_type, rule=watchdog, scenario=let_go, text=said)
    assert bool(failures) == is_blamed
    assert motion.velocity.hold_s <= 1.5 * rover.HOLD_S


def test_what_commands_in_the_query_is_found():
    query = [{"name": name, "in": "query", "schema": _NUMBER} for name in ("x", "timeout_ms")]
    operations = read_operations(
        {"openapi": "3.1.0", "info": {}, "paths": {"/drive": {"put": {"parameters": query, "responses": {}}}}}
    )
    found = with_query(operations[0])
    assert [number.place for number in commanded_by(found)] == ["{x}"]
    assert found.label == "PUT /drive?x={x}&timeout_ms=1000"


def test_numbers_in_texts_are_read_and_a_heading_in_degrees_begins_anew():
    looks = Looks()
    for moment, heading in enumerate(("358.5", "359.75", "1.00")):
        looks.add("GET /state", moment, numbers_of({"heading": heading, "serial": "1234", "version": "1.2.3"}))
    assert looks.places("GET /state") == ["/heading"]
    assert looks.samples("GET /state", "/heading", 0) == [(0, 358.5), (1, 359.75), (2, 361.0)]


def test_items_of_a_list_are_read_at_their_place_within_objects():
    joints = {"type": "array", "items": _NUMBER, "minItems": 2, "maxItems": 2}
    body = {"content": {"application/json": {"schema": {"type": "object", "properties": {"joints": joints}}}}}
    paths = {"/arm": {"put": {"requestBody": body, "responses": {}}}}
    looks = Looks()
    state = {"joints": [{"name": "base", "position": 0.1, "velocity": 0}, {"name": "elbow", "position": 2}]}
    looks.add("GET /state", 0, numbers_of(state))
    numbers = commanded_by(read_operations({"openapi": "3.1.0", "info": {}, "paths": paths})[0])
    places = [place for _, place in looks.places_of(numbers, "/arm", ["GET /state"]).values()]
    assert places == ["/joints/0/position", "/joints/1/position"]


class Leasing(Api):
    """An arm with a lease; ``wants``: whether it moves only for a client that has it, or any token."""

    wants = ("mine",)

    def send(self, method, path, *, headers=(), body=b"", **how):
        if path == "/lease":
            said = Response(200, (), b'{"token": "mine"}', 2.0)
        elif path == "/move" and dict(headers).get("X-Lease") not in self.wants:
            said = Response(423, (), b"{}", 2.0)
        else:
            return super().send(method, path, headers=headers, body=body, **how)
        return Exchange(Request(method, f"http://device{path}", headers, body), said)


@pytest.mark.parametrize("wants", [("mine",), ("mine", "enim"), ("mine", "enim", None)])
def test_an_arm_that_moves_for_a_client_without_its_lease_is_blamed(wants):
    clock = SimulatedClock()
    api = Leasing(Arm(Body(LIMITS, clock.now, clock.sleep)), clock, lambda: 0.002)
    api.wants = wants
    motion = map_of(f'{MOVES}[motion.lease]\nacquire = "POST /lease"\ntoken = "/token"\nheader = "X-Lease"\n')
    with patch.object(attempts, "send_in_parts", lambda *_: iter(())):
        trace = attempts.attempts_at_rest.play(mapped=MappedDevice(api, motion, clock, Binding(api)))
    cases = cases_of(unauthorised_still, trace, {"motion": motion})
    assert cases
    assert sum(not case.holds for case in cases) >= len(wants) - 1
    assert all(case.holds for case in cases) == (wants == ("mine",))
