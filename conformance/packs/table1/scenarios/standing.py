"""The common watch after all attempts that must leave the robot at rest."""

from conformance.packs.table1.robot.standstill import Standstill
from conformance.packs.table1.robot.standstill_trace import Standing, stays
from conformance.scenarios.rule import Rule, rule
from conformance.scenarios.scenario import scenario
from conformance.scenarios.stage import Need, Stage


@scenario(needs={Need.REST, Need.MOTION}, stage=Stage.STAYS)
def standing(standstill: Standstill) -> tuple[Standing, ...]:
    """Watch whether the robot stays at rest after goals were cancelled, clients vanished and requests were rejected."""
    standstill.watch()
    return standstill.watched


def later(requirement: str) -> Rule:
    """Return a rule that judges that the robot stays at rest after the attempts for a requirement."""
    return rule(requirement, on=(standing,))(lambda trace: stays(trace, requirement))
