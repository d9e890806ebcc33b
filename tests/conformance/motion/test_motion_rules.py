"""The rules of motion on recorded moves of simulated devices, by a simulated clock: without HTTP, in no time."""

import random
import tomllib
from functools import partial

import dome
import msgspec
import mutants
import pytest
import rover
from arm import LIMITS, MAP, Arm
from body import Body
from dome import Dome
from rover import Rover

from conformance.observe.clock import SimulatedClock
from conformance.rules.motion import test_motion, test_motion_attempts, test_states, test_velocities
from conformance.scenarios.motion import moves, states, velocities
from conformance.scenarios.motion.binding import SoapBinding
from conformance.scenarios.motion.mapped import MappedDevice
from conformance.scenarios.motion.trace import Quiet, Reading, Tried
from conformance.scenarios.rule import Case, Rule
from conformance.scenarios.scenario import NotPossibleError, PartialTraceError
from conformance.statement.motion_map import MotionMap
from conformance.transport.exchange import Exchange, Request, Response
from conformance.verdict.effort import Effort
from conformance.verdict.run import Run

_PLAYED = (
    moves.targets, moves.clamped_targets, moves.stops, moves.new_targets, moves.many_commands, moves.repeated,
    velocities.velocities, velocities.let_go, states.agreement, states.switched,
)  # fmt: skip
_RULES = [
    one
    for module in (test_motion, test_motion_attempts, test_velocities, test_states)
    for one in vars(module).values()
    if isinstance(one, Rule)
]
_RELATIVE = MAP.replace('beyond_limits = "refused"', "relative = true")
_DEVICES = {
    "arm": (Arm, LIMITS, MAP),
    "rover": (Rover, rover.LIMITS, rover.MAP),
    "relative": (partial(Arm, relative=True), LIMITS, _RELATIVE),
    "dome": (Dome, dome.LIMITS, dome.MAP),
}
# A move that is relative begins where the last one ended, and none is sent under way.
_MUTANTS = {
    "arm": mutants.of_arm(),
    "rover": mutants.of_rover(),
    "dome": mutants.of_dome(),
    "relative": {name: change for name, change in mutants.of_arm().items() if not name.startswith("second")},
}


class _Api:
    """A device without HTTP: a request takes some simulated time each way."""

    def __init__(self, device, clock, takes_s):
        self.device, self.clock, self.client, self.takes_s = device, clock, self, takes_s
        self.stop_device = None

    def send(self, method, path, *, headers=(), body=b"", **_):
        self.clock.sleep(self.takes_s() / 2)
        if isinstance(self.device, Dome):
            status, octets = self.device.respond(body)
        else:
            status, document = self.device.answer(method, path, body)
            octets = msgspec.json.encode(document)
        self.clock.sleep(self.takes_s() / 2)
        fields = (("Content-Type", "text/xml" if isinstance(self.device, Dome) else "application/json"),)
        return Exchange(Request(method, f"http://device{path}", headers, body), Response(status, fields, octets, 2.0))


def _relay(seed):
    """Return how long requests take over a busy radio link: a few milliseconds, and now and then much longer."""
    chance = random.Random(seed)  # noqa: S311 - no secret
    return lambda: chance.expovariate(1 / 0.01) + (chance.uniform(0.1, 0.4) if chance.random() < 0.03 else 0.0)


def _failed(name, mutant=None, *, noise=0.0, seed=0, takes_s=lambda: 0.002):
    """Return the names of the rules that a device breaks, and of those that judged it."""
    device, limits, text = _DEVICES[name]
    clock = SimulatedClock()
    body = Body(limits, clock.now, noise, seed)
    if mutant is not None:
        mutant(body)
    motion = msgspec.convert(tomllib.loads(text)["motion"], MotionMap)
    api = _Api(device(body), clock, takes_s)
    binding = SoapBinding(api, dome.messages_of()) if name == "dome" else None
    mapped = MappedDevice(api, motion, clock, binding)
    given = {
        "mapped": mapped,
        "effort": Effort("quick" if name == "dome" else "standard"),
        "run": Run(seed=seed),
        "motion": motion,
    }
    failed, judged = set(), set()
    for scenario in _PLAYED:
        try:
            trace = scenario.play(**{name: given[name] for name in scenario.fixtures})
        except PartialTraceError as error:
            trace = error.trace
        except NotPossibleError:
            continue
        for rule in _RULES:
            if scenario in rule.on:
                cases = [one for one in rule.outcomes(trace, given.get) if isinstance(one, Case)]
                judged |= {rule.requirement} if cases else set()
                failed |= {rule.requirement} if not all(one.holds for one in cases) else set()
    return failed, judged


@pytest.mark.parametrize(("noise", "seed"), [(0.0, 0), *((0.004, seed) for seed in range(20))])
@pytest.mark.parametrize("name", _DEVICES)
def test_a_right_device_breaks_no_rule(name, noise, seed):
    failed, judged = _failed(name, noise=noise, seed=seed)
    assert failed == set()
    assert len(judged) > 10


@pytest.mark.parametrize("takes_s", [0.05, 0.15, 0.3, 1.0])
@pytest.mark.parametrize("name", _DEVICES)
def test_a_right_device_that_is_far_away_breaks_no_rule(name, takes_s):
    assert _failed(name, noise=0.004, takes_s=lambda: takes_s)[0] == set()


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("name", _DEVICES)
def test_a_right_device_behind_a_relay_breaks_no_rule(name, seed):
    assert _failed(name, noise=0.004, seed=seed, takes_s=_relay(seed))[0] == set()


@pytest.mark.parametrize("name", _DEVICES)
def test_mutants_by_rule_are_killed(name):
    """At least 95 %, on each device."""
    survivors = [mutant for mutant, change in _MUTANTS[name].items() if not _failed(name, change)[0]]
    assert len(_MUTANTS[name]) >= 40
    assert len(survivors) <= 0.05 * len(_MUTANTS[name]), survivors


def _reading(pan, sent=0.0):
    exchange = Exchange(Request("GET", "http://arm/state", (), b""), Response(200, (), b"{}", 1.0))
    return Reading(sent, sent, {} if pan is None else {"pan": pan, "tilt": 0.0}, None, exchange)


def _quiet(pans, kinds=("beyond",), alone=()):
    refused = Exchange(Request("POST", "http://arm/move", (), b""), Response(422, (), b"{}", 1.0))
    tried = tuple(Tried(kind, f"an attempt ({kind})", refused) for kind in kinds)
    return Quiet({"pan": 0.0, "tilt": 0.0}, tried, tuple(map(_reading, pans)), alone)


_STILL, _MOVES, _UNREAD = [0.0] * 9, [0.0, 0.1, 0.2, 0.3, 0.3], [None] * 9


@pytest.mark.parametrize(
    ("quiet", "outcomes"),
    [
        (_quiet(_STILL), [True]),
        (_quiet(_UNREAD), ["NotTested"]),
        (_quiet(_MOVES, ("beyond", "invalid"), alone=(_quiet(_MOVES), _quiet(_STILL, ("invalid",)))), [False, True]),
        # It did not come back for the second attempt: that one is not judged.
        (_quiet(_MOVES, ("beyond", "invalid"), alone=(_quiet(_STILL),)), [True, "NotTested"]),
        # It moves now and then: each alone moves nothing, and yet it moved.
        (_quiet(_MOVES, alone=(_quiet(_STILL),)), [True, False]),
    ],
)
def test_what_may_move_nothing(quiet, outcomes):
    motion = msgspec.convert(tomllib.loads(MAP)["motion"], MotionMap)
    found = test_motion_attempts.refused_still.judge(quiet, motion)
    assert [one.holds if isinstance(one, Case) else type(one).__name__ for one in found] == outcomes
