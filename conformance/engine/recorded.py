"""``roaas replay --recorded``: judge the recorded traces of a run again, without sending anything."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from conformance.engine.planning import collected
from conformance.engine.robot_under_test import RobotUnderTest
from conformance.scenarios.rule import Rule, record
from conformance.scenarios.scenario import Scenario
from conformance.scenarios.stored import TRACES_NAME, read_traces


@dataclass(frozen=True)
class Rejudged:
    """The judgement of one requirement by recorded traces.

    Attributes:
        requirement: id of the requirement.
        cases: number of judged cases.
        failures: the text of each failure.
    """

    requirement: str
    cases: int
    failures: tuple[str, ...]


def judge_recorded(robot: RobotUnderTest, folder: Path) -> list[Rejudged]:
    """Judge the traces in a result's folder by the contract's rules; the robot is not needed.

    Raises:
        TracesError: there are no traces, or they are malformed.
    """
    rules: list[tuple[Rule, Scenario]] = []
    for item in collected(robot):
        mark = item.get_closest_marker("rule")
        if mark is not None:
            rules.append(mark.args)
    recordings = read_traces(folder / TRACES_NAME, [scenario for _, scenario in rules])
    run = robot.run
    moves = run.statement.motion_map
    known: dict[str, Any] = {"run": run, "statement": run.statement, "effort": run.effort, "motion": moves}
    for rule, scenario in rules:
        recording = recordings.played.get(scenario.name)
        if recording is not None and (moves or "motion" not in rule.fixtures):
            record(run.judge, rule.requirement, rule.outcomes(recording.trace, known.__getitem__))
    judged = ((id_, run.judge.evidence[id_]) for id_ in run.contract.ledger)
    return [
        Rejudged(id_, evidence.cases, tuple(one.text for one in evidence.findings.values()))
        for id_, evidence in judged
        if evidence.cases
    ]
