"""The rules of motion on recorded moves of simulated devices: right ones break none, and mutants by rule are killed."""

import random
import tomllib

import msgspec
import mutants
import pytest
import rover
from arm import MAP
from body import Body
from careless import played as played_attempts
from simulated import DEVICES, MUTANTS, RULES, cases_of, played

from conformance.measures.samples import Noise
from conformance.rules.motion import test_motion_attempts, test_velocities
from conformance.rules.motion.judging import tries_of
from conformance.scenarios.motion import moves, velocities
from conformance.scenarios.motion.resting import set_out
from conformance.scenarios.motion.trace import Quiet, Reading, Resting, Tried
from conformance.scenarios.scenario import Recording, Recordings
from conformance.scenarios.stored import TRACES_NAME, read_traces, write_traces
from conformance.statement.motion_map import MotionMap
from conformance.transport.exchange import Exchange, Request, Response
from conformance.verdict.evidence import Case


def _relay(seed):
    """Return how long requests take over a busy radio link: a few milliseconds, and now and then much longer."""
    chance = random.Random(seed)  # noqa: S311 - no secret
    return lambda: chance.expovariate(1 / 0.01) + (chance.uniform(0.1, 0.4) if chance.random() < 0.03 else 0.0)


def _failed(name, mutant=None, **more):
    """Return the names of the rules that a device breaks, and of those that judged it."""
    failed, judged = set(), set()
    for scenario, trace, given in played(name, mutant, **more):
        for rule in RULES:
            if scenario in rule.on:
                cases = cases_of(rule, trace, given)
                judged |= {rule.requirement} if cases else set()
                failed |= {rule.requirement} if not all(one.holds for one in cases) else set()
    return failed, judged


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("name", DEVICES)
def test_a_right_device_breaks_no_rule(name, seed):
    failed, judged = _failed(name, noise=0.004 if seed else 0.0, seed=seed)
    assert failed == set()
    assert len(judged) > 10


@pytest.mark.parametrize("takes_s", [0.15, 1.0])
@pytest.mark.parametrize("name", DEVICES)
def test_a_right_device_that_is_far_away_breaks_no_rule(name, takes_s):
    assert _failed(name, noise=0.004, takes_s=lambda: takes_s)[0] == set()


def test_a_move_that_runs_on_for_a_while_where_it_has_arrived_is_not_blamed(monkeypatch):
    action, arrived = Body.action, {}

    def late(device):
        state, move = action(device), device.moves
        is_early = state == "done" and device.now() < arrived.setdefault(move, device.now()) + 1.0
        return "running" if is_early else state

    monkeypatch.setattr(Body, "action", late)
    failed, judged = _failed("arm", toml=MAP.replace("settle_s = 0.3", "settle_s = 2.0"))
    assert failed == set()
    assert "motion/action-succeeds" in judged


@pytest.mark.parametrize("requests", [80, 320])
def test_a_velocity_that_a_machine_was_too_busy_to_measure_is_driven_again(requests):
    """Without a hold time, nothing but the missing velocity shows that a drive was spoilt."""
    left, outcomes = [0], []

    def takes_s():
        left[0] -= 1
        return 0.15 if left[0] >= 0 else 0.002

    toml = rover.MAP.replace(f"hold_s = {rover.HOLD_S}\n", "")
    for scenario, trace, given in played("rover", toml=toml, takes_s=takes_s, effort="quick"):
        left[0] = requests if scenario is moves.repeated else 0  # recorded just before the velocities
        if scenario is velocities.velocities:
            outcomes = [list(test_velocities.velocity.judge(tuple(one), given["motion"])) for one in tries_of(trace)]
            assert max(len(one) for one in tries_of(trace)) in range(2, moves.TRIES + 1)
    assert outcomes
    assert all(isinstance(one, Case) and one.holds for found in outcomes for one in found), outcomes


@pytest.mark.parametrize("name", DEVICES)
def test_a_right_device_behind_a_relay_breaks_no_rule(name):
    assert _failed(name, noise=0.004, takes_s=_relay(0))[0] == set()


@pytest.mark.parametrize("name", DEVICES)
def test_mutants_by_rule_are_killed(name):
    """At least 97 %, on each device: of every second mutant, or fewer where there are most or SOAP takes long."""
    tried = dict(list(MUTANTS[name].items())[:: {"dome": 6, "rover": 4}.get(name, 2)])
    survivors = [mutant for mutant, change in tried.items() if not _failed(name, change)[0]]
    assert len(MUTANTS[name]) >= 40
    assert len(survivors) <= 0.03 * len(tried), survivors


@pytest.mark.parametrize(("name", "change"), list(mutants.finer_velocity_mutants(["x", "y"])))
def test_a_velocity_that_is_taken_wrongly_now_and_then_or_not_quite_ended_is_found_at_quick(name, change):
    failed = _failed("rover", change, effort="quick")[0]
    assert failed & {f"motion/{one}" for one in ("velocity", "velocity-stop", "hold", "watchdog", "stop-lasts")}, name


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("name", ["rover", "arm"])
def test_a_right_device_breaks_no_rule_at_quick(name, seed):
    assert _failed(name, noise=0.004 if seed % 2 else 0.0, seed=seed, effort="quick")[0] == set()


@pytest.mark.parametrize("mutant", ["second-queued", "second-ignored"])
def test_what_becomes_of_a_second_move_is_judged_where_the_map_says_it(mutant):
    change, toml = MUTANTS["arm"][mutant], MAP.replace('while_moving = "displaces"\n', "")
    assert _failed("arm", change, effort="quick")[0] & {"motion/new-target", "motion/last-of-many"}
    assert _failed("arm", change, effort="quick", toml=toml)[0] == set()


@pytest.mark.parametrize("name", ["arm", "rover"])
def test_a_trace_is_judged_alike_after_it_was_stored(name, tmp_path):
    made = list(played(name, MUTANTS[name]["stop-late"], noise=0.004, seed=1))
    write_traces(Recordings({scenario.name: Recording(trace) for scenario, trace, _ in made}), tmp_path)
    refused = []
    stored = read_traces(tmp_path / TRACES_NAME, [scenario for scenario, *_ in made], lambda *why: refused.append(why))
    assert refused == []
    for scenario, trace, given in made:
        again = stored.played[scenario.name].trace
        for rule in (one for one in RULES if scenario in one.on):
            assert [one.holds for one in cases_of(rule, again, given)] == [
                one.holds for one in cases_of(rule, trace, given)
            ]


@pytest.mark.parametrize("tolerance", [0.02, 0.08, 0.14])
def test_a_stop_is_seen_under_way_however_coarse_the_tolerance_is(tolerance):
    toml = MAP.replace("tolerance = 0.02", f"tolerance = {tolerance}")
    assert toml.count(f"tolerance = {tolerance}")
    failed, judged = _failed("arm", toml=toml, effort="quick")
    assert (failed, "motion/stop" in judged) == (set(), True)


@pytest.mark.parametrize("seconds", [2, 9])
def test_a_slow_arm_that_passes_the_targets_of_other_clients_is_not_blamed(seconds):
    # From the middle, the way to a limit leads through the targets between.
    toml = MAP.replace("seconds = 0.5", f"seconds = {seconds}").replace("[-0.4, 0.6]", "[-0.4, 0.4]")
    assert _failed("arm", toml=toml, noise=0.004)[0] == set()


@pytest.mark.parametrize("mutant", ["stop-late", "stop-ignored", "stop-creeps", "stop-one-axis"])
def test_a_stop_that_comes_late_is_one_finding(mutant):
    failed = _failed("arm", MUTANTS["arm"][mutant])[0]
    assert failed & {"motion/stop", "motion/stop-lasts"} == {"motion/stop"}


def test_noise_of_which_a_few_readings_at_rest_showed_little_sets_nothing_out():
    motion, resting = msgspec.convert(tomllib.loads(MAP)["motion"], MotionMap), Resting({"pan": Noise(0.0, 0.0002)})
    creeps = 0
    for seed in range(100):
        chance = random.Random(seed)  # noqa: S311 - no secret
        moments = [(0.03 * number, chance.gauss(0, 0.003)) for number in range(60)]
        assert not set_out([_reading(noise, moment) for moment, noise in moments], motion, resting)
        seen = [_reading(noise + 0.2 * max(0, moment - 0.7), moment) for moment, noise in moments]
        creeps += bool(set_out(seen, motion, resting))
    assert creeps > 95


def _reading(pan, sent=0.0):
    exchange = Exchange(Request("GET", "http://arm/state", (), b""), Response(200, (), b"{}", 1.0))
    return Reading(sent, sent, {} if pan is None else {"pan": pan, "tilt": 0.0}, None, exchange)


def _quiet(pans, kinds=("beyond",), alone=(), idle=None):
    refused = Exchange(Request("POST", "http://arm/move", (), b""), Response(422, (), b"{}", 1.0))
    tried = tuple(Tried(kind, f"an attempt ({kind})", refused) for kind in kinds)
    return Quiet({"pan": 0.0, "tilt": 0.0}, tried, tuple(map(_reading, pans)), alone, idle)


_STILL, _MOVES, _UNREAD = [0.0] * 9, [0.0, 0.1, 0.2, 0.3, 0.3], [None] * 9


@pytest.mark.parametrize(
    ("quiet", "outcomes"),
    [
        (_quiet(_STILL), [True]),
        (_quiet(_UNREAD), ["NotTested"]),
        (
            _quiet(_MOVES, ("beyond", "invalid"), (_quiet(_MOVES), _quiet(_STILL, ("invalid",))), _quiet(_STILL, ())),
            [False, True],
        ),
        # It did not come back for the second attempt: that one is not judged.
        (_quiet(_MOVES, ("beyond", "invalid"), alone=(_quiet(_STILL),)), [True, "NotTested"]),
        # It moves now and then: each alone moves nothing, and yet it moved.
        (_quiet(_MOVES, alone=(_quiet(_STILL),), idle=_quiet(_STILL, ())), [True, False]),
        (_quiet(_MOVES, alone=(_quiet(_MOVES),), idle=_quiet(_STILL, ())), [False]),
        # It also moves while nothing is sent.
        (_quiet(_MOVES, alone=(_quiet(_MOVES),), idle=_quiet(_MOVES, ())), ["NotTested"]),
        (_quiet(_MOVES, alone=(_quiet(_STILL),), idle=_quiet(_MOVES, ())), ["NotTested"]),
    ],
)
def test_what_may_move_nothing(quiet, outcomes):
    motion = msgspec.convert(tomllib.loads(MAP)["motion"], MotionMap)
    found = test_motion_attempts.refused_still.judge(quiet, motion)
    assert [one.holds if isinstance(one, Case) else type(one).__name__ for one in found] == outcomes


_STILL_RULES = {f"motion/{kind}-still" for kind in ("refused", "incomplete", "unauthorised")}


@pytest.mark.parametrize("phase", range(0, 6, 2))
@pytest.mark.parametrize("careless", ["", "incomplete"])
def test_an_arm_that_sways_within_its_tolerance_is_not_blamed_for_attempts_at_rest(careless, phase):
    found, given = played_attempts(careless, 0.018, phase)
    rules = [one for one in RULES if one.requirement in _STILL_RULES]
    cases = {one.requirement: cases_of(one, found["attempts_at_rest"], given) for one in rules}
    blamed = {name for name, of_rule in cases.items() if not all(one.holds for one in of_rule)}
    assert blamed == ({f"motion/{careless}-still"} if careless else set())
