"""What the scenarios that drive a robot record."""

from collections.abc import Iterator
from dataclasses import dataclass

from conformance.packs.table1.robot.drive_rules import outcomes
from conformance.packs.table1.robot.drive_trace import Trace
from conformance.packs.table1.robot.letting_go import LetGo
from conformance.packs.table1.statement import said_of
from conformance.scenarios.rule import Outcome, Rule, rule
from conformance.scenarios.scenario import Scenario
from conformance.transport.exchange import Exchange
from conformance.verdict.run import Run


@dataclass(frozen=True)
class Driven:
    """A drive, and the velocities in it that were not renewed.

    Attributes:
        drive: all commands and readings.
        let_go: for each velocity that was not renewed, every measurement of how long it holds.
        ends_s: time within which a velocity that is not renewed must end, s.
        not_tested: why a requirement could not be tested, by its id.
        over_soap: readings of pose and velocity over SOAP, beside the looks.
    """

    drive: Trace
    let_go: tuple[tuple[LetGo, ...], ...] = ()
    not_tested: tuple[tuple[str, str], ...] = ()
    ends_s: float = 0.0
    over_soap: tuple[Exchange, ...] = ()


def shown(requirement: str, *scenarios: Scenario) -> Rule:
    """Return a rule that judges one requirement by the traces of these scenarios."""

    def judge(trace: Driven, run: Run) -> Iterator[Outcome]:
        return outcomes(requirement, trace.drive, said_of(run).limits)

    return rule(requirement, on=scenarios)(judge)
