"""The rules of motion on recorded moves of a simulated arm, by a simulated clock: without HTTP, in no time."""

import tomllib

import msgspec
import pytest
from arm import MAP, Arm

from conformance.observe.clock import SimulatedClock
from conformance.rules.motion import test_motion as rules
from conformance.rules.motion import test_motion_attempts as readings
from conformance.scenarios.motion import moves
from conformance.scenarios.motion.mapped import MappedDevice
from conformance.scenarios.motion.trace import Quiet, Reading, Tried
from conformance.scenarios.rule import Case
from conformance.scenarios.scenario import NotPossibleError
from conformance.statement.motion_map import MotionMap
from conformance.transport.exchange import Exchange, Request, Response
from conformance.verdict.effort import Effort
from conformance.verdict.run import Run

_FAULTS = {
    "late": "reaches",
    "short": "reaches",
    "beyond": "reaches",
    "offset": "reaches",
    "other-sign": "reaches",
    "one-axis": "reaches",
    "swapped": "reaches",
    "trembles": "reaches",
    "loses-tenth": "reaches",
    "drifts": "stays",
    "beyond+": "way",
    "too-fast": "speed",
    "stale": "fresh",
    "stamp-stuck": "stamp",
    "stamp-back": "stamp",
    "no-stop": "stop_rests",
    "stops-late": "stop_rests",
    "creeps-on": "stop_lasts",
    "resumes": "stop_lasts",
    "goes-home": "stop_lasts",
    "ignores-second": "new_target",
    "goes-back": "new_target",
    "queues": "new_target",
    "adds-repeated": "repetition",
    "ignores-second+": "last_of_many",
}
_PLAYED = (moves.targets, moves.stops, moves.new_targets, moves.many_commands, moves.repeated)
_RULES = (
    rules.reaches, rules.stays, rules.way, rules.speed, rules.stop_rests, rules.stop_lasts, rules.new_target,
    rules.last_of_many, rules.repetition, readings.fresh, readings.stamp,
)  # fmt: skip


class _Api:
    """The arm without HTTP: a request takes some simulated time, half of it on the way there."""

    def __init__(self, arm, clock, takes_s):
        self.arm, self.clock, self.client, self.takes_s = arm, clock, self, takes_s
        self.stop_device = None

    def send(self, method, path, *, headers=(), body=b"", **_):
        self.clock.sleep(self.takes_s / 2)
        status, document = self.arm.answer(path, body)
        self.clock.sleep(self.takes_s / 2)
        fields = (("Content-Type", "application/json"),)
        return Exchange(
            Request(method, f"http://arm{path}", headers, body),
            Response(status, fields, msgspec.json.encode(document), 2.0),
        )


def _failed(fault, *, noise=0.0, seed=0, takes_s=0.002):
    """Return the names of the rules that a fault breaks."""
    clock = SimulatedClock()
    motion = msgspec.convert(tomllib.loads(MAP)["motion"], MotionMap)
    arm = Arm(fault.rstrip("+"), noise, seed, clock.now)
    mapped = MappedDevice(_Api(arm, clock, takes_s), motion, clock)
    given = {"mapped": mapped, "effort": Effort("standard"), "run": Run(seed=seed)}
    failed, judged = set(), set()
    for scenario in _PLAYED:
        try:
            trace = scenario.play(**{name: given[name] for name in scenario.fixtures})
        except NotPossibleError:
            continue
        for rule in _RULES:
            if scenario in rule.on:
                cases = [one for one in rule.judge(trace, motion) if isinstance(one, Case)]
                judged |= {rule.judge.__name__} if cases else set()
                failed |= {rule.judge.__name__} if not all(one.holds for one in cases) else set()
    return failed, judged


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("noise", [0.0, 0.004])
def test_a_right_arm_breaks_no_rule(noise, seed):
    failed, judged = _failed("", noise=noise, seed=seed)
    assert failed == set()
    assert judged == {rule.judge.__name__ for rule in _RULES}


@pytest.mark.parametrize("takes_s", [0.05, 0.15, 0.3, 1.0])
def test_a_right_arm_that_is_far_away_breaks_no_rule(takes_s):
    assert _failed("", noise=0.004, takes_s=takes_s)[0] == set()


@pytest.mark.parametrize(("fault", "rule"), _FAULTS.items())
def test_a_fault_breaks_its_rule(fault, rule):
    assert rule in _failed(fault)[0]


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
    found = readings.refused_still.judge(quiet, motion)
    assert [one.holds if isinstance(one, Case) else type(one).__name__ for one in found] == outcomes
