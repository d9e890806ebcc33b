"""The sentence that is quoted: effect, interval, A/A control and p99, and never more than was judged."""

from dataclasses import replace

import pytest

from loadtests.schedule.plan import Load, Plan
from loadtests.statistics.against import Against, Change
from loadtests.statistics.comparisons import SoapOverRest
from loadtests.statistics.counts import Counts
from loadtests.statistics.figures import Series
from loadtests.statistics.headline import Found, GeneratorFigures, headline, invalid_because

PLAN = Plan(("delivery",), ("rest", "soap"), ("wire",), Load(200.0, None, 20.0, 2.0, "constant", 1), 10.0, 1, 32)
FOUND = Found(PLAN, most_rate=500.0)
WHERE = ": delivery, wire client, 200 requests/s."


def entry(judgement, quantile="p50", bound=None):
    known = {"ratio": 1.47, "ci95": [1.4, 1.52], "noise_ci95": [0.97, 1.04], "difference_ms": 0.047}
    named = {"operation": "delivery", "client": "wire", "quantile": quantile}
    said = {"judgement": judgement, "bound": bound, "judgement_reason": "too short"}
    return SoapOverRest(ci95_difference_ms=None, rounds=None, reason=None, **known, **named, **said)


def series(p99=0.4, at_least=(), modes=None):
    known = {"operation": "pose", "interface": "rest", "client": "wire", "modes": modes, "at_least": list(at_least)}
    known["service_ms"] = {"p50": 0.0741, "p99": p99}
    known["ci95_ms"] = {"p50": [0.073, 0.075], "p99": None}
    return Series(**dict.fromkeys(Series.__struct_fields__) | known)


@pytest.mark.parametrize(
    ("median", "tail", "sentence"),
    [
        (
            entry("differs"),
            entry("differs", "p99"),
            "SOAP takes 1.47 times as long as REST at the median (95 % interval 1.40 to 1.52, A/A control 0.97 to "
            "1.04; 0.047 ms more), and 1.47 times at the 99th percentile (1.40 to 1.52)" + WHERE,
        ),
        (
            entry("bounded", bound=1.35),
            entry("none", "p99"),
            "SOAP takes at least 1.35 times as long as REST at the median (95 % interval 1.40 to 1.52, corrected by "
            "this run's A/A control 0.97 to 1.04); 99th percentile: inconclusive" + WHERE,
        ),
        (
            entry("noise", bound=1.52),
            entry("noise", "p99", bound=1.9),
            "No significant difference between SOAP and REST at the median (95 % interval 1.40 to 1.52, A/A control "
            "0.97 to 1.04; a factor beyond 1.52 is excluded); 99th percentile: not significant (a factor beyond 1.90 "
            "is excluded)" + WHERE,
        ),
    ],
)
def test_a_duel_says_what_was_judged(median, tail, sentence):
    found = headline(replace(FOUND, comparisons=[median, tail]))
    assert found["sentence"] == sentence
    assert sentence.startswith(found["words"])


def test_another_robot_is_judged_by_the_figure_that_decides():
    known = {"operation": "pose", "interface": "rest", "client": "wire", "difference_ms": -0.02, "ci95": [0.7, 0.9]}
    known |= {"ci95_difference_ms": None, "rounds": None, "reason": None, "verdict": "not slower"}
    known |= {"judgement": "differs", "noise_ci95": [0.97, 1.04]}
    changes = [Change(quantile=q, ratio=r, **known) for q, r in (("p50", 0.8), ("p99", 0.85))]
    compared = Against(robot={}, tolerance=0.05, verdict="not slower", changes=changes, series=[])
    found = headline(replace(FOUND, against=compared))
    assert found["words"] == "Not slower than the other robot"
    assert found["sentence"] == (
        "This robot takes 0.80 times as long as the other one at the median (95 % interval 0.70 to 0.90, A/A control "
        "0.97 to 1.04; 0.020 ms less), and 0.85 times at the 99th percentile (0.70 to 0.90); 1.05 times is tolerated: "
        "pose over REST, wire client, 200 requests/s."
    )
    for change in changes:
        change.judgement, change.bound = "noise", 1.4
    assert headline(replace(FOUND, against=compared))["sentence"] == (
        "No significant difference between the two robots at the median (95 % interval 0.70 to 0.90, A/A control 0.97 "
        "to 1.04; a factor beyond 1.40 is excluded); 99th percentile: not significant (a factor beyond 1.40 is "
        "excluded); 1.05 times is tolerated: pose over REST, wire client, 200 requests/s."
    )


def test_one_interface_alone_says_how_long_it_takes():
    half = "Half of the pose requests over REST take at most 0.074 ms (95 % interval within this run 0.073 to 0.075 ms)"
    found = headline(replace(FOUND, series=[series()]))
    assert found["sentence"] == f"{half}, and 99 of 100 take at most 0.400 ms: wire client, 200 requests/s."
    failed = headline(replace(FOUND, series=[series(at_least=("p99", "max"))]))
    assert "99 of 100 take at least 0.400 ms" in failed["sentence"]
    assert "too few for a 99th percentile" in headline(replace(FOUND, series=[series(p99=None)]))["sentence"]


def test_what_spoils_a_run_is_all_that_its_headline_says():
    compared = replace(FOUND, comparisons=[entry("differs"), entry("differs", "p99")])
    assert headline(replace(compared, worthless=["it was late"]))["sentence"] == (
        "These figures say nothing about the robot, because it was late."
    )
    assert headline(replace(compared, undecided=["9 failed"]))["sentence"] == (
        "This run is inconclusive, because 9 failed."
    )


@pytest.mark.parametrize(
    ("outcomes", "words"),
    [
        (["kept"], "The service level is kept"),
        (["kept", "kept"], "All 2 service levels are kept"),
        (["kept", "broken", "not known"], "1 of 3 service levels broken"),
        (["not known"], "1 of 1 service level not known"),
    ],
)
def test_service_levels_decide_the_words(outcomes, words):
    assert headline(replace(FOUND, series=[series()], levels=outcomes))["words"] == words


def test_two_modes_are_said_beside_the_median():
    assert headline(replace(FOUND, series=[series(modes={"split_ms": 0.5})]))["sentence"].endswith(
        " Two modes, so that no single figure describes the series: pose over REST."
    )


def test_a_cap_on_a_closed_model_is_part_of_its_figures():
    plan = replace(PLAN, load=replace(PLAN.load, rate=None, users=4))
    found = headline(replace(FOUND, series=[series()], plan=plan))
    assert "4 users under a cap of 500 requests/s, which is part of the figures" in found["sentence"]


def test_the_knee_leads_a_run_that_searched_for_it():
    knee = {"interface": "rest", "rate": 315, "interval": [308, 322], "searches": 5, "errors_from": None}
    knee |= {"confidence": 0.9375, "step_requests": 900, "needed_requests": 368}
    none = {"interface": "soap", "rate": None, "held_up_to": 2000}
    run = replace(FOUND, series=[series()], knees=[knee | {"limited_by": "robot"}, none])
    said = (
        "REST breaks down at 315 requests/s (308 to 322 in 5 searches). SOAP did not break down up to 2,000 requests/s."
    )
    assert headline(run)["words"] == "REST breaks down at 315 requests/s (308 to 322 in 5 searches)"
    assert headline(run)["sentence"].startswith(f"{said} Half of the ")
    assert headline(replace(run, undecided=["9 failed"]))["sentence"].endswith(f"because 9 failed. {said}")


@pytest.mark.parametrize(
    ("known", "words"),
    [
        ({"searches": 1, "confidence": 0.0}, "in 1 search, whose error only more searches show)"),
        ({"confidence": 0.75}, "in 3 searches, at 75% confidence)"),
        ({"confidence": None, "step_requests": 75}, "not sure: a step had 75 requests, and its criterion needs 368"),
    ],
)
def test_a_knee_claims_no_more_than_its_searches_and_requests_show(known, words):
    knee = {"interface": "rest", "rate": 315, "interval": [308, 322], "searches": 3, "errors_from": None}
    knee |= {"limited_by": "robot", "step_requests": 900, "needed_requests": 368}
    assert words in headline(replace(FOUND, series=[series()], knees=[knee | known]))["words"]


def test_a_run_on_a_busy_machine_gives_no_interval_for_its_p99():
    entry = series()
    entry.ci95_ms["p99"] = [0.3, 0.5]
    assert (
        "0.400 ms (95 % interval within this run 0.300 to 0.500 ms)"
        in headline(replace(FOUND, series=[entry]))["sentence"]
    )
    busy = headline(replace(FOUND, series=[entry], busy="load average 9.0 on 2 CPUs"))["sentence"]
    assert "99 of 100 take at most 0.400 ms: " in busy
    assert "another run will differ by more than the intervals say, most of all at the 99th percentile" in busy


@pytest.mark.parametrize(
    ("rate", "real_time", "hint"),
    [
        (200.0, False, "; with CAP_SYS_NICE and a processor left for the robot, the generator would run before"),
        (1500.0, False, "; at up to 1,000 requests/s for each of its processes, the generator would run before"),
        (200.0, True, "overloaded"),
    ],
)
def test_what_keeps_a_late_generator_in_time_is_named_by_what_it_lacks(rate, real_time, hint):
    lag = {"p50": 0.01, "p99": 2.0}
    limits = {"p50": 0.05, "p99": 0.3}
    late = GeneratorFigures(
        cpu_share=0.2, lag_ms=lag, lag_limits_ms=limits, real_time=real_time, late=9, connects=1, resends=0
    )
    counts = Counts(**dict.fromkeys(Counts.__struct_fields__, 100) | {"failed": {}, "lost": 0, "not_sent": 0})
    plan = replace(PLAN, load=replace(PLAN.load, rate=rate))
    (reason,), _ = invalid_because(late, counts, plan, "timerfd", ())
    assert reason.startswith(
        "requests started 2.000 ms (p99; a valid run allows 0.300 ms) after their time (timerfd): "
    )
    assert reason.endswith("overloaded" if real_time else " other processes")
    assert hint in reason
