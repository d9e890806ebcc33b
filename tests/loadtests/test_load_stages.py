"""A load whose rate changes in stages, as people give it."""

import pytest

from loadtests.schedule.arrivals import Schedule
from loadtests.schedule.plan import Load, Plan
from reports.latency.page import latency_html, latency_markdown

STAGES = ((40.0, 2.0), (40.0, 2.0), (200.0, 0.0), (200.0, 1.0))


def test_the_schedule_follows_the_stages():
    load = Load(200.0, None, 5.0, 0.0, "constant", 1, STAGES)
    assert [load.rate_at(at) for at in (0.0, 1.0, 2.0, 3.9, 4.0, 4.9)] == [0.0, 20.0, 40.0, 40.0, 200.0, 200.0]
    plan = Plan(("a",), ("rest",), ("wire",), load, timeout_s=1.0, workers=1, connections=1, least_block_s=0.02)
    schedule = Schedule(Plan.from_message(plan.as_message()), 0, 1)
    due = [at / 1e9 for index in range(schedule.count()) for at in schedule.due_ns(index)]
    for (begin, end), number in {(0, 1): 10, (1, 2): 30, (2, 4): 80, (4, 5): 200}.items():
        assert sum(begin <= at < end for at in due) == pytest.approx(number, abs=8)


def test_each_stage_has_its_figures(started, load):
    port = started("bucket.py", "2000")[1]
    run = load(f"http://127.0.0.1:{port}/openapi.json --operation 'GET /state' --stages 40:2s,40:2s,200:0s,200:1s")
    stages = run.result["stages"]
    assert [(each["from_rate"], each["to_rate"]) for each in stages] == [(0, 40), (40, 40), (40, 200), (200, 200)]
    assert [each["answered"] for each in stages] == pytest.approx([40, 80, 0, 200], abs=12)
    assert sum(each["answered"] + each["failed"] for each in stages) == run.result["counts"]["in_series"]
    assert run.result["plan"]["stages"] == [[40, 2], [40, 2], [200, 0], [200, 1]]
    assert "stage 4, 200 to 200/s in 1 s, GET /state over rest (wire): " in run.out
    assert "Stage by stage" in latency_html(run.result)
    assert "Response time by stage" in latency_markdown(run.result)


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ("--stages 10:30", "'10:30' is not a list of stages such as 10:30s,100:1m,10:30s"),
        ("--stages 10:1s --rate 5", "--stages says rates and durations: leave out --rate"),
        ("--stages 0:1s", "--stages needs a rate and a duration above 0"),
    ],
)
def test_stages_that_say_nothing_are_refused(usage_error, options, told):
    assert told in usage_error("--rest http://127.0.0.1:9", options)
