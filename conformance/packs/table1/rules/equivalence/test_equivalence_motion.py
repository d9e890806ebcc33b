"""Rules on pose, velocity and goal over REST and SOAP, while the robot moves and when it has come to rest."""

from collections.abc import Iterator

from conformance.packs.table1.robot.state_over_soap import StateRead
from conformance.packs.table1.scenarios.interfaces_in_motion import goals_over_soap, interfaces_in_motion
from conformance.scenarios.rule import Outcome, Rule, rule
from conformance.scenarios.scenario import Scenario


def _same(name: str, scenario: Scenario) -> Rule:
    """Return a rule that judges whether both interfaces show the same state."""

    def judge(trace: tuple[StateRead, ...]) -> Iterator[Outcome]:
        return (case for one in trace if one.name == name for case in one.cases)

    return rule(f"equivalence/{name}", on=(scenario,))(judge)


pose = _same("pose", interfaces_in_motion)
velocity = _same("velocity", interfaces_in_motion)
goal = _same("goal", goals_over_soap)
