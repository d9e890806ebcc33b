"""Velocities that are PUT over REST, and the messages that the robot then publishes on its velocity topic."""

from dataclasses import dataclass
from typing import Final

from conformance.observe.clock import poll_for
from conformance.packs.table1.limits import Limits
from conformance.packs.table1.robot.probe import ARRIVES_S, Probe, ProbeError, RosProbe
from conformance.packs.table1.robot.robot import STILL, Robot, Velocity, is_near
from conformance.scenarios.scenario import NotPossibleError, PartialTraceError, scenario
from conformance.scenarios.stage import Need
from conformance.transport.exchange import Exchange
from conformance.verdict.effort import Effort

# Hold time that is assumed where none is declared, when a velocity is renewed, s.
_RENEWED_S: Final = 2.0


@dataclass(frozen=True)
class OnRos:
    """A velocity that the robot accepted.

    Attributes:
        wanted: the velocity.
        exchange: the PUT's request and response.
        seen: the messages on the velocity topic since then, up to the first with this velocity.
    """

    wanted: Velocity
    exchange: Exchange
    seen: tuple[Velocity, ...]

    def has_arrived(self, limits: Limits) -> bool:
        """Return whether a message has the velocity, within the tolerance."""
        return any(is_near(limits, velocity, self.wanted) for velocity in self.seen)


@scenario(needs={Need.REST, Need.MOTION})
def velocities_on_ros(robot: Robot, probe: RosProbe, effort: Effort) -> tuple[OnRos, ...]:
    """PUT velocities, and watch the velocity topic after each, until two have not arrived."""
    trace: list[OnRos] = []
    try:
        seeing = probe.ready()
        seeing.velocities()
        for index in range(effort.cases(12)):
            share = (-1) ** index / (3 + index)
            wanted = robot.share_of_limits(share, -share)
            exchange = robot.put_velocity(wanted)
            if exchange.response.ok:
                trace.append(OnRos(wanted, exchange, _see_messages(robot, seeing, wanted)))
            if sum(not velocity.has_arrived(robot.limits) for velocity in trace) > 1:
                break
        robot.put_velocity(STILL)
    except ProbeError as error:
        raise PartialTraceError(tuple(trace)) from NotPossibleError(str(error))
    return tuple(trace)


def _see_messages(robot: Robot, seeing: Probe, wanted: Velocity) -> tuple[Velocity, ...]:
    """Return the messages on the velocity topic until one has the wanted velocity; renew it meanwhile."""
    every_s = 0.4 * (robot.limits.hold_s or _RENEWED_S)
    renew_at = robot.clock.now() + every_s
    seen: list[Velocity] = []
    for _ in poll_for(robot.clock, 0.005, max(ARRIVES_S, robot.settle_s)):
        seen += seeing.velocities()
        if any(robot.near(velocity, wanted) for velocity in seen):
            break
        # A robot that accelerates slowly may end a velocity before it has reached it.
        if robot.clock.now() > renew_at:
            robot.put_velocity(wanted)
            renew_at = robot.clock.now() + every_s
    return tuple(seen)
