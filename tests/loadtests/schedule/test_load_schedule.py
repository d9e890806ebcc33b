import time
from collections import Counter
from dataclasses import replace
from itertools import pairwise

import gevent
import pytest
from gevent.event import Event
from hypothesis import example, given, settings
from hypothesis import strategies as st

from loadtests.clients.wire import now_ns
from loadtests.measuring.machine import first_in_line
from loadtests.schedule.arrivals import Schedule
from loadtests.schedule.pacer import Pacer, make_alarm
from loadtests.schedule.plan import BLOCK_S, CLIENTS, SHORT_BLOCK_S, Load, Plan

LOAD = Load(rate=100.0, users=None, duration_s=20.0, warmup_s=1.0, arrivals="constant", seed=1)
PLAN = Plan(("delivery", "pose"), ("rest", "soap"), CLIENTS, LOAD, timeout_s=10.0, workers=1, connections=32)


def varied(clients=CLIENTS, workers=1, **load):
    return replace(PLAN, clients=clients, workers=workers, load=replace(LOAD, **load))


def everything(plan, worker=0, workers=1):
    schedule = Schedule(plan, worker, workers)
    return [(segment, *arrival) for segment in range(schedule.count()) for arrival in schedule.arrivals(segment)]


@settings(max_examples=30, deadline=None)
@given(
    st.integers(1, 7),
    st.sampled_from(["constant", "poisson"]),
    st.integers(0, 2**31),
    st.floats(1.0, 3000.0),
    st.floats(0.3, 4.0),
)
@example(1, "poisson", 12594, 2997.0, 3.4375)  # two of its arrivals are due at the same nanosecond
def test_the_workers_shares_make_up_the_schedule(workers, arrivals, seed, rate, duration):
    plan = varied(arrivals=arrivals, seed=seed, rate=rate, duration_s=duration)
    shares = [everything(plan, worker, workers) for worker in range(workers)]
    whole = everything(plan)
    assert sorted(arrival for share in shares for arrival in share) == sorted(whole)
    assert [due for _, due, *_ in whole] == sorted(due for _, due, *_ in whole)
    for worker, share in enumerate(shares):
        schedule = Schedule(plan, worker, workers)
        assert sum(schedule.share(segment) for segment in range(schedule.count())) == len(share)
    for segment, due, operation, _ in everything(plan):
        assert plan.segments[segment].start_ns <= due <= plan.segments[segment].end_ns
        assert operation in plan.choices(plan.segments[segment].interface, plan.segments[segment].client)


def test_a_plan_survives_its_message_and_a_seed_fixes_it():
    assert Plan.from_message(PLAN.as_message()) == PLAN
    assert everything(PLAN) == everything(Plan.from_message(PLAN.as_message()))
    assert everything(PLAN) != everything(varied(seed=2))


def test_the_rate_is_kept_exactly_by_constant_and_on_average_by_poisson_arrivals():
    due = [arrival for arrival in everything(PLAN) if PLAN.segments[arrival[0]].phase != "warmup"]
    assert len(due) == pytest.approx(100 * sum(s.active_s for s in PLAN.segments if s.phase != "warmup"), abs=2)
    within = Counter(segment for segment, *_ in due)
    for segment, arrivals in within.items():
        assert arrivals / PLAN.segments[segment].active_s == pytest.approx(100, abs=100 / arrivals + 1e-6)
    plan = varied(arrivals="poisson", rate=1000.0)
    wire = [arrival for arrival in everything(plan) if plan.segments[arrival[0]].client == "wire"]
    seconds = sum(s.active_s for s in plan.segments if s.client == "wire")
    assert abs(len(wire) - 1000 * seconds) < 4 * (1000 * seconds) ** 0.5


def test_rest_and_soap_take_turns_in_random_abba_quartets():
    duel = [segment for segment in PLAN.segments if segment.phase != "warmup"]
    orders = Counter()
    for index in range(0, len(duel), 4):
        quartet = duel[index : index + 4]
        assert len({(segment.phase, segment.client) for segment in quartet}) == 1
        sides = [(segment.interface, segment.label) for segment in quartet]
        assert (sides[0], sides[1]) == (sides[3], sides[2])
        assert sides[0] != sides[1]
        orders[sides[0]] += 1
        assert [segment.pair for segment in quartet] == [index // 2] * 2 + [index // 2 + 1] * 2
    assert min(orders["rest", ""], orders["soap", ""]) >= 5
    phases = Counter((segment.phase, segment.client) for segment in duel)
    assert phases["duel", "wire"] == phases["aa", "wire"] == 80, "noise is known as well as the effect is"
    assert phases["duel", "zeep"] == 40


def test_three_interfaces_take_turns_in_sextets_and_two_robots_in_quartets():
    rosbridge = replace(PLAN, interfaces=("rest", "soap", "rosbridge"), offers={"rosbridge/zeep": []})
    pairs = {}
    for segment in rosbridge.segments:
        if (segment.phase, segment.client) == ("duel", "wire"):
            pairs.setdefault(segment.pair, []).append(segment.interface)
    assert all(sorted(sides) == ["rest", "rosbridge", "soap"] for sides in pairs.values())
    first, second = pairs[0], pairs[1]
    assert first == second[::-1]
    assert not [s for s in rosbridge.segments if (s.interface, s.client) == ("rosbridge", "zeep")]
    robots = replace(PLAN, robots=2, clients=("wire",))
    met = Counter()
    for pair in {segment.pair for segment in robots.segments if segment.phase == "against"}:
        here, there = sorted((segment for segment in robots.segments if segment.pair == pair), key=lambda s: s.robot)
        assert (here.robot, here.phase, there.robot, there.phase) == (0, "duel", 1, "against")
        assert here.interface == there.interface
        met[here.interface] += 1
    assert abs(met["rest"] - met["soap"]) <= 2


def test_no_second_passes_without_the_wire_client():
    starts = [segment.start_ns for segment in PLAN.segments if (segment.phase, segment.client) == ("duel", "wire")]
    assert max(after - before for before, after in pairwise(starts)) < 1e9


@settings(deadline=None)
@given(st.floats(0.1, 3600.0), st.floats(0.01, 5000.0) | st.none())
def test_the_number_of_blocks_is_bounded_whatever_the_run(duration, rate):
    plan = varied(duration_s=duration, rate=rate, users=None if rate else 3)
    assert 2 <= plan.blocks <= 1200
    assert plan.length_s == pytest.approx(plan.load.warmup_s + duration, abs=1e-6)


def test_workers_and_operations_get_their_even_share_of_short_blocks():
    plan = replace(varied(workers=2, rate=75.0), least_block_s=SHORT_BLOCK_S)
    made = [everything(plan, worker, 2) for worker in range(2)]
    whose = [(segment.phase, segment.interface, segment.client) for segment in plan.segments]
    for interface, client in (("rest", "wire"), ("soap", "wire"), ("soap", "zeep")):
        met = [
            Counter(operation for segment, _, operation, _ in share if whose[segment] == ("duel", interface, client))
            for share in made
        ]
        assert abs(met[0].total() - met[1].total()) <= 1
        both = met[0] + met[1]
        assert abs(both[0] - both[1]) <= 1


def test_a_quick_robots_interfaces_take_turns_sooner_and_each_block_still_has_its_arrivals():
    slow, quick = varied(rate=400.0), replace(varied(rate=400.0), least_block_s=SHORT_BLOCK_S)
    assert slow.block_s == pytest.approx(BLOCK_S, rel=0.02)
    assert quick.block_s == pytest.approx(SHORT_BLOCK_S, rel=0.02)
    assert min(Counter(segment for segment, *_ in everything(quick)).values()) >= 5
    assert replace(varied(rate=100.0), least_block_s=SHORT_BLOCK_S).block_s == pytest.approx(0.08, rel=0.02)


def test_all_clients_run_at_one_rate():
    assert {segment.rate for segment in PLAN.segments} == {100.0}


def test_a_repeat_has_segments_of_its_own_and_lots_of_its_own():
    again = PLAN.again()
    assert again.first_segment == len(PLAN.segments)
    assert again.offset_s == PLAN.length_s
    assert [segment.interface for segment in again.segments] != [segment.interface for segment in PLAN.segments]
    assert everything(again) != everything(PLAN)


class Users:
    """Greenlets that take arrivals and note when."""

    def __init__(self, pacer, count, work=0.0):
        self.taken = []
        self.greenlets = [gevent.spawn(self.run, pacer, work) for _ in range(count)]
        while pacer.waiting < count:
            gevent.sleep(0.001)

    def run(self, pacer, work):
        while True:
            arrival = pacer.take()
            self.taken.append((arrival, now_ns()))
            gevent.sleep(work)


def paced(plan, users, work=0.0, timeout_ns=10**10):
    segments, dropped = [], []
    pacer = Pacer(timeout_ns, segments.append, dropped.append)
    crowd = Users(pacer, users, work)
    origin = now_ns() + 20_000_000
    pacer.start(Schedule(plan, 0, 1), origin, open_model=plan.open_model)
    with gevent.Timeout(30):
        pacer.done.wait()
        gevent.sleep(work * 3)
    gevent.killall(crowd.greenlets)
    pacer.close()
    assert segments == list(range(len(plan.segments)))
    return crowd.taken, dropped, origin


def test_arrivals_are_started_at_their_times_and_never_before():
    plan = varied(rate=500.0, duration_s=1.0, warmup_s=0.0, clients=("wire",))
    with first_in_line(wanted=True):
        taken, dropped, origin = paced(plan, 20)
    wanted = everything(plan)
    assert not dropped
    assert sorted((a.segment, a.due_ns - origin, a.operation, a.payload) for a, _ in taken) == sorted(wanted)
    lags = sorted(at - arrival.due_ns for arrival, at in taken)
    assert lags[0] >= 0
    assert lags[len(lags) // 2] < 1_000_000, "half of them within a millisecond, even on a busy machine"


def test_an_alarm_never_rings_early_and_stays_awake_for_a_small_part_of_the_time():
    left, early, waited = 60, [], Event()

    def ring():
        nonlocal left, due
        early.append(now_ns() < due)
        left -= 1
        due += 5_000_000
        alarm.set(due) if left else waited.set()

    alarm, began, due = make_alarm(ring), time.process_time(), now_ns() + 5_000_000
    alarm.set(due)
    with gevent.Timeout(10):
        waited.wait()
    alarm.set(now_ns() + 20_000)
    alarm.close()
    gevent.sleep(0.01)
    assert early == [False] * 60
    assert time.process_time() - began < 0.3 / 4


def test_arrivals_wait_for_a_user_when_all_are_busy_and_are_dropped_after_their_deadline():
    plan = varied(rate=100.0, duration_s=0.6, warmup_s=0.0, clients=("wire",))
    taken, dropped, _ = paced(plan, 1, work=0.05, timeout_ns=100_000_000)
    assert len(taken) < len(everything(plan))
    assert dropped
    assert any(arrival.noticed_ns for arrival, _ in taken)
    assert not taken[0][0].noticed_ns


def test_users_of_the_closed_model_go_on_as_soon_as_they_are_done():
    plan = varied(rate=None, users=3, duration_s=0.5, warmup_s=0.0, clients=("wire",))
    taken, _, origin = paced(plan, 3, work=0.005)
    assert 30 < len(taken) < 330
    for arrival, _ in taken:
        segment = plan.segments[arrival.segment]
        assert segment.start_ns <= arrival.due_ns - origin <= segment.end_ns + 1_000_000


def test_a_generator_that_was_held_up_starts_nothing_in_segments_that_are_over():
    plan = varied(rate=None, users=3, duration_s=0.5, warmup_s=0.0, clients=("wire",))
    pacer = Pacer(10**10, lambda _: None, lambda _: None)
    crowd = Users(pacer, 3)
    pacer.start(Schedule(plan, 0, 1), now_ns() - 10**9, open_model=False)
    with gevent.Timeout(30):
        pacer.done.wait()
    assert (crowd.taken, pacer.waiting) == ([], 3)
    gevent.killall(crowd.greenlets)
    pacer.close()
