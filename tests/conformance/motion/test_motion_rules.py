"""The rules of motion on recorded moves of a simulated arm, by a simulated clock: without HTTP, in no time."""

import tomllib

import msgspec
import pytest
from arm import MAP, Arm

from conformance.observe.clock import SimulatedClock
from conformance.rules.motion import test_motion as rules
from conformance.rules.motion import test_motion_attempts as readings
from conformance.scenarios.motion import plays
from conformance.scenarios.motion.mapped import Mapped
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
_PLAYED = (plays.targets, plays.stops, plays.new_targets, plays.many_commands, plays.repeated)
_RULES = (
    rules.reaches, rules.stays, rules.way, rules.speed, rules.stop_rests, rules.stop_lasts, rules.new_target,
    rules.last_of_many, rules.repetition, readings.fresh, readings.stamp,
)  # fmt: skip


class _Api:
    """The arm without HTTP: a request takes 2 ms of simulated time."""

    def __init__(self, arm, clock):
        self.arm, self.clock, self.client = arm, clock, self
        self.still = None

    def send(self, method, path, *, headers=(), body=b"", **_):
        self.clock.sleep(0.002)
        status, document = self.arm.answer(path, body)
        fields = (("Content-Type", "application/json"),)
        return Exchange(
            Request(method, f"http://arm{path}", headers, body),
            Response(status, fields, msgspec.json.encode(document), 2.0),
        )


def _failed(fault, *, noise=0.0, seed=0):
    """Return the names of the rules that a fault breaks."""
    clock = SimulatedClock()
    motion = msgspec.convert(tomllib.loads(MAP)["motion"], MotionMap)
    arm = Arm(fault.rstrip("+"), noise, seed, clock.now)
    mapped = Mapped(_Api(arm, clock), motion, clock)
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


@pytest.mark.parametrize(("fault", "rule"), _FAULTS.items())
def test_a_fault_breaks_its_rule(fault, rule):
    assert rule in _failed(fault)[0]
