"""How late a stop takes effect while several operators read the state of a device that coasts."""

import pytest
from toy_api import MAP

from reports.latency.page import latency_html


@pytest.fixture
def operators(started, load, tmp_path):
    """Load a device that coasts for so long, and promises to rest within a time, with several operators."""

    def run(coast, promised, *options):
        url, statement = f"http://127.0.0.1:{started('toy_api.py', '--coast', str(coast))[1]}", tmp_path / "robot.toml"
        statement.write_text(f'[api]\nopenapi = "{url}/openapi.json"\n{MAP}rests_within_s = {promised}\n')
        return load(str(statement), "--rate 50 --duration 0.5 --warmup 0.1 --operators 4", *options)

    return run


def test_a_stop_takes_effect_when_the_device_has_coasted(operators):
    run = operators(0.4, 60, "--allow-motion")
    found = run.result["operators"]
    assert (found["error"], found["promised_ms"]) == (None, 60_000)
    alone, beside = found["by_number"]
    assert [(each["operators"], each["stops"], each["late"]) for each in (alone, beside)] == [(1, 6, 0), (4, 6, 0)]
    for each in (alone, beside):
        assert each["rest_ms"]["p50"] + each["known_to_ms"] >= 400, "it coasts for 0.4 s"
        assert each["rest_ms"]["p50"] - each["known_to_ms"] - each["answer_ms"]["max"] <= 400
    assert (alone["reads"], beside["reads"] > 20, beside["reads_failed"]) == (0, True, 0)
    assert "4 operators: the device rested" in run.out
    assert "Each of 4 operators reads the state: a stop takes effect after" in latency_html(run.result)
    assert run.series("GET /where", "rest")["count"] > 0, "what operators read is what is measured"


def test_a_device_that_moves_on_for_longer_than_its_map_says_is_told(operators):
    run = operators(1.5, 0.3, "--allow-motion")
    assert run.result["trustworthy"] is False or run.code == 1, run.out
    assert [each["late"] for each in run.result["operators"]["by_number"]] == [6, 6]
    assert "it moved on for too long after 6 of 6" in run.out


def test_operators_need_permission_to_move(operators):
    run = operators(0.1, 1)
    assert run.code == 2
    assert "--operators drives and stops the device: it needs a [motion] map and --allow-motion" in run.err
