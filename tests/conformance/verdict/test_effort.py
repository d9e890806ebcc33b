"""How much is tried depends on how fast a robot answers, by classes; exploring ends with its time, and that is told."""

import time

import pytest
from hypothesis import strategies as st

from conformance.verdict import effort
from conformance.verdict.effort import SPEEDS, Effort
from conformance.verdict.evidence import RefutedError
from conformance.verdict.explorer import Explorer
from conformance.verdict.run import Run


@pytest.mark.parametrize(
    ("usual_ms", "speed"),
    [
        (0.4, "local"),
        (50, "local"),
        (51, "near"),
        (60, "near"),
        (140, "near"),
        (200, "far"),
        (600, "far"),
        (2e3, "slow"),
    ],
)
def test_robots_are_classed_by_how_fast_they_answer(usual_ms, speed):
    assert Effort().slowed_to(usual_ms).speed.name == speed


def test_a_class_is_left_only_when_its_bound_is_clearly_passed_and_never_for_a_faster_one():
    effort = Effort().slowed_to(60)
    assert [effort.slowed_to(one).speed.name for one in (1, 129, 161, 164)] == ["near", "near", "near", "far"]


def test_robots_of_one_class_get_the_same_cases():
    assert {Effort().slowed_to(usual_ms).cases(200) for usual_ms in (51, 60, 90, 160)} == {40}
    assert Effort("quick").slowed_to(300).cases(100) == 3


def test_what_was_left_out_is_told_with_the_class_and_no_figure_of_this_run():
    assert Effort().slowed_to(3).speed.remark == ""
    assert Effort().slowed_to(60).speed.remark == Effort().slowed_to(70).speed.remark
    assert "one in 5" in Effort().slowed_to(60).speed.remark
    assert "more than about 800 ms" in SPEEDS[-1].remark


def test_cases_for_which_no_time_is_left_stand_on_the_certificate(monkeypatch):
    monkeypatch.setitem(effort._BUDGETS_S, "standard", 0.05 / 3)  # noqa: SLF001 - instead of ten seconds
    run = Run()
    tried = []
    explore = Explorer(0, "test_x.py::test_slow", run.effort, run.tally)
    explore(st.integers(), lambda value: (tried.append(value), time.sleep(0.02)), cases=20)
    assert len(tried) < 20
    assert run.tally.cut_short == {"test_x.py::test_slow": 20 - len(tried)}
    (remark,) = run.remarks
    assert f"test_x.py::test_slow ({20 - len(tried)} cases)" in remark


def test_attempts_to_make_a_failure_smaller_are_no_cases(monkeypatch):
    monkeypatch.setitem(effort._BUDGETS_S, "standard", 0.05 / 3)  # noqa: SLF001 - instead of ten seconds
    run = Run()

    def refuted(_value: int) -> None:
        time.sleep(0.02)
        raise RefutedError

    Explorer(0, "test_x.py::test_wrong", run.effort, run.tally)(st.integers(), refuted, cases=20)
    assert (run.tally.cut_short, run.remarks) == ({}, ())
