"""A scenario is played once, its rules judge the trace, and a planner orders them, whatever the files are called."""

from types import SimpleNamespace

import pytest

from conformance.packs.table1.robot.drive_rules import rule_on
from conformance.scenarios.collecting import is_imported
from conformance.scenarios.plan import Step, order_steps, plan_lines
from conformance.scenarios.rule import Note, NotTested, record, rule
from conformance.scenarios.scenario import NotPossibleError, PartialTraceError, Recordings, scenario
from conformance.scenarios.stage import Leaves, Need, Stage
from conformance.verdict.evidence import Case, Judge

_PLAYED = []


@scenario(needs={Need.REST}, leaves=Leaves.UNTOUCHED)
def counting(start: int) -> int:
    """Count."""
    _PLAYED.append(start)
    return start + 1


@rule("http/a", on=(counting,))
def is_two(trace: int, limit: int):
    """Judge that it is two."""
    yield Case(trace == limit, None, "two", str(trace))


def test_a_scenario_is_played_once_and_judged_by_each_rule():
    _PLAYED.clear()
    recordings, fixtures = Recordings(), {"start": 1, "limit": 2}
    for _ in range(2):
        trace = recordings.of(counting, fixtures.__getitem__).trace
        assert [one.holds for one in is_two.outcomes(trace, fixtures.__getitem__)] == [True]
    assert (_PLAYED, is_two.fixtures) == ([1], ("limit",))


def test_a_rule_is_collected_where_it_stands_and_not_where_it_is_imported():
    made_elsewhere = rule_on("safety/stop", counting)
    assert not is_imported(is_two, __name__)
    assert not is_imported(made_elsewhere, __name__)
    assert is_imported(is_two, "another")


def _fails(error: Exception) -> None:
    raise error


@pytest.mark.parametrize("error", [NotPossibleError("it has no wheels"), ValueError("broken")])
def test_what_a_scenario_raises_is_kept(error):
    made = scenario(needs=set())(lambda: _fails(error))
    recording = Recordings().of(made, {}.__getitem__)
    assert (recording.trace, recording.error) == (None, error)


def test_of_a_scenario_that_broke_off_the_trace_is_judged():
    def play():
        raise PartialTraceError(7) from OSError("gone")

    recording = Recordings().of(scenario(needs=set())(play), {}.__getitem__)
    assert recording.trace == 7
    assert isinstance(recording.error, OSError)


def test_outcomes_become_evidence():
    judge = Judge({"http/a"})
    record(judge, "http/a", [Case(True, None, "x"), Case(False, None, "x", "y"), NotTested("late"), Note("by the way")])
    evidence = judge.evidence["http/a"]
    assert (evidence.cases, evidence.failures, evidence.skips, evidence.notes) == (2, 1, ["late"], ["by the way"])


def _step(name: str, *requirements: str, stage: Stage = Stage.MOTION, played=None) -> Step:
    return Step(name, stage, requirements, played)


def test_the_order_follows_stage_and_ledger_and_keeps_a_scenario_together():
    ledger = ["c/one", "c/two", "c/three"]
    other = SimpleNamespace(name="other", summary="Other.", leaves=Leaves.AT_REST)
    steps = [
        _step("z", "c/three"),
        _step("y", "c/three", played=other),
        _step("x", "c/two"),
        _step("w", "c/one", played=other),
        _step("first", "c/three", stage=Stage.READING),
    ]
    assert [one.name for one in order_steps(steps, ledger)] == ["first", "w", "y", "x", "z"]
    assert order_steps(reversed(steps), ledger) == order_steps(steps, ledger)
    lines = plan_lines(order_steps(steps, ledger))
    assert lines[0] == "reading:"
    assert "  scenario other: Other. Leaves the device at rest." in lines
