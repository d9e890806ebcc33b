"""Records of scenarios that drive a robot."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from conformance.packs.table1.limits import Limits
from conformance.packs.table1.robot.drive_rules import outcomes
from conformance.packs.table1.robot.drive_trace import LONGEST_SAMPLE_S, Trace, Turn
from conformance.packs.table1.statement import said_of
from conformance.scenarios.motion.trace import Drive
from conformance.scenarios.rule import Outcome, Rule, rule
from conformance.scenarios.scenario import Scenario
from conformance.transport.exchange import Exchange
from conformance.verdict.run import Run

# Share of the hold time by which a velocity may hold longer.
_LONGER: Final = 0.4


@dataclass(frozen=True)
class Driven:
    """A drive, and the velocities in it that were not renewed.

    Attributes:
        drive: all commands and readings.
        let_go: the velocities that were not renewed.
        paused: two looks at the robot at rest after each of them, the first ones of the velocity after a pause.
        over_soap: readings of pose and velocity over SOAP, beside the looks.
    """

    drive: Trace
    let_go: tuple[Drive, ...] = ()
    paused: tuple[tuple[Turn, Turn], ...] = ()
    over_soap: tuple[Exchange, ...] = ()


def longer_s(limits: Limits) -> float:
    """Return for how long after its hold time a velocity may be seen at most, s.

    Commands and odometry are delayed by part of the settle time; half as long again is no such delay.
    """
    return max(_LONGER * (limits.hold_s or 0.0), 0.5 * limits.settle_s, LONGEST_SAMPLE_S)


def rule_on(requirement: str, *scenarios: Scenario) -> Rule:
    """Return a rule that judges one requirement by the traces of these scenarios."""

    def judge(trace: Driven, run: Run) -> Iterator[Outcome]:
        return outcomes(requirement, trace.drive, said_of(run).limits)

    return rule(requirement, on=scenarios)(judge)
