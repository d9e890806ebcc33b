"""Exploring ends with its time, and what was left out is told."""

import time

from hypothesis import strategies as st

from conformance.verdict import effort
from conformance.verdict.evidence import RefutedError
from conformance.verdict.explorer import Explorer
from conformance.verdict.run import Run


def test_cases_for_which_no_time_is_left_stand_on_the_certificate(monkeypatch):
    monkeypatch.setitem(effort._BUDGETS_S, "standard", 0.05)  # noqa: SLF001 - instead of ten seconds
    run = Run()
    tried = []
    explore = Explorer(0, "test_x.py::test_slow", run.effort, run.cut_short)
    explore(st.integers(), lambda value: (tried.append(value), time.sleep(0.02)), cases=20)
    assert len(tried) < 20
    assert run.cut_short == {"test_x.py::test_slow": 20 - len(tried)}
    (remark,) = run.remarks
    assert f"test_x.py::test_slow ({20 - len(tried)} cases)" in remark


def test_attempts_to_make_a_failure_smaller_are_no_cases(monkeypatch):
    monkeypatch.setitem(effort._BUDGETS_S, "standard", 0.05)  # noqa: SLF001 - instead of ten seconds
    run = Run()

    def refuted(_value: int) -> None:
        time.sleep(0.02)
        raise RefutedError

    Explorer(0, "test_x.py::test_wrong", run.effort, run.cut_short)(st.integers(), refuted, cases=20)
    assert run.cut_short == {}
    assert run.remarks == ()
