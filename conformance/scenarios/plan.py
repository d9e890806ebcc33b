"""The order of scenarios and checks in a run. It does not depend on file names."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from conformance.scenarios.scenario import Scenario
from conformance.scenarios.stage import STAGES, Stage


@dataclass(frozen=True)
class Step:
    """One check, or one rule with its scenario, in the plan of a run.

    Attributes:
        name: name of the check.
        stage: the stage of the run that it belongs to.
        requirements: ids that it judges.
        scenario: the scenario whose trace it judges; None for a check that sends requests itself.
        moves: whether it may move the device.
    """

    name: str
    stage: Stage
    requirements: tuple[str, ...]
    scenario: Scenario | None = None
    moves: bool = False


def turn_of(step: Step, ranks: Mapping[str, int]) -> tuple[int, int, str, str]:
    """Return the sort key of a step: stage, rank of its first requirement in the ledger, scenario, name.

    The rules of a scenario follow each other, so that a trace is judged where it was recorded.

    Args:
        step: the step.
        ranks: rank of each requirement in the ledger; of a scenario, by its name, that of its first requirement.
    """
    first = min((ranks.get(id_, len(ranks)) for id_ in step.requirements), default=len(ranks))
    if step.scenario is not None:
        first = ranks.get(step.scenario.name, first)
    return STAGES.index(step.stage), first, step.scenario.name if step.scenario else "", step.name


def order_steps(steps: Iterable[Step], ledger: Iterable[str]) -> list[Step]:
    """Return the steps in the order of the run."""
    steps, ranks = list(steps), {id_: number for number, id_ in enumerate(ledger)}
    for step in steps:
        if step.scenario is not None:
            first = min((ranks.get(id_, len(ranks)) for id_ in step.requirements), default=len(ranks))
            ranks[step.scenario.name] = min(first, ranks.get(step.scenario.name, first))
    return sorted(steps, key=lambda step: turn_of(step, ranks))


def plan_lines(steps: Sequence[Step]) -> list[str]:
    """Return a plan as lines of text, stage by stage: scenarios with the state they leave, and checks."""
    lines: list[str] = []
    stage, scenario = None, ""
    for step in steps:
        if step.stage != stage:
            stage, scenario = step.stage, ""
            lines.append(f"{stage}:")
        if step.scenario is not None and step.scenario.name != scenario:
            scenario = step.scenario.name
            lines.append(f"  scenario {scenario}: {step.scenario.summary} Leaves the device {step.scenario.leaves}.")
        indent = "    judges" if step.scenario else "  check"
        moves = " (may move the device)" if step.moves and step.scenario is None else ""
        lines.append(f"{indent} {step.name}{moves}: {', '.join(step.requirements)}")
    return lines
