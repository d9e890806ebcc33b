"""Pose, velocity and goal over REST and over SOAP, while the robot moves and when it has come to rest.

What SOAP told before a change may be what it tells first afterwards: so after each change the first reading counts. A
good robot's may be out as well, by one odometry message that one interface has and the other has not yet: then
everything is done again, and only what is out after each change is recorded.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from http import HTTPStatus
from typing import Any, Final

from conformance.api.soap.service import SoapService
from conformance.documents.representation import from_element, projected
from conformance.observe.clock import poll, poll_for
from conformance.packs.table1.limits import Limits
from conformance.packs.table1.robot.drive import Drive, there_and_back
from conformance.packs.table1.robot.goal import (
    await_goal,
    await_none,
    choose_goals,
    goal_body,
    in_turn,
    make_room,
    put_goal,
)
from conformance.packs.table1.robot.message_shapes import GOAL_AND_STATUS
from conformance.packs.table1.robot.probe import ARRIVES_S, Probe, ProbeError, RosProbe
from conformance.packs.table1.robot.robot import STILL, Robot, Velocity, is_near
from conformance.packs.table1.robot.soap_services import ask, returns
from conformance.packs.table1.robot.state_read import (
    STATES,
    Slack,
    StateRead,
    best_of,
    compare,
    disagreement,
    for_good,
    read_state,
)
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


# After this many changes of one kind the first reading must be wrong to count.
_CHANGES: Final = 3
# Comparisons of a state that does not change.
_TIMES: Final = 4
# Goals, each displacing the one before, whose first response must be wrong to count.
_GOALS: Final = 3
# Consecutive goals that are first read over one interface: more than _GOALS.
_IN_A_ROW: Final = 4


@scenario(needs={Need.REST, Need.SUBSCRIBERS, Need.MOTION})
def interfaces_in_motion(robot: Robot, subscribers: SoapService) -> tuple[StateRead, ...]:
    """Read pose and velocity on an arc, where each component that the robot has is not zero, and at rest after it."""
    make_room(robot)
    drive = Drive(robot)
    reads: list[StateRead] = []
    # The differences in all first readings so far, by state and kind of change; None if not read yet.
    suspects: dict[tuple[str, bool], StateRead | None] = {
        (name, moves): None for name in STATES for moves in (True, False)
    }
    for change, wanted in there_and_back(drive, _CHANGES):
        # First without a pause, then after both interfaces must know the change.
        pause_s = robot.sample_s if change else 0.0
        lasted = drive.hold(wanted)
        drive.clock.sleep(pause_s)
        for name in [name for name, moves in suspects if moves == (wanted != STILL)]:
            drive.command(wanted)
            read = read_state(robot, subscribers, name, pause_s, lasted)
            del suspects[name, wanted != STILL]
            if read is not None:
                reads += for_good([read])
                suspects |= {(name, wanted != STILL): read} if read.differs else {}
        for _ in range(0 if change else 1 if wanted == STILL else _TIMES):
            for name in STATES:
                # A state that differs costs three tries each time.
                if not any(one.name == name and (one.broken or one.differs) for one in reads):
                    reads += compare(robot, subscribers, name, partial(drive.command, wanted), lasted)
        if wanted == STILL and not suspects:
            break
    return (*reads, *(replace(one, broken="") for one in suspects.values() if one is not None))


@scenario(needs={Need.REST, Need.SUBSCRIBERS, Need.MOTION})
def goals_over_soap(robot: Robot, subscribers: SoapService, effort: Effort) -> tuple[StateRead, ...]:
    """Read the active goal, or its absence, over both interfaces, after each of several goals and without one."""
    reads = _compare_goals(robot, subscribers)
    goals = choose_goals(robot, 1.5, 2)
    # SOAP's first responses after the last goals, if they were wrong.
    late: list[StateRead] = []
    for index in range(effort.cases(20)):
        pose = in_turn(goals, index)
        body = goal_body(pose, robot.statement.motion.frame, f"equal \u00e9 <&> {index}")
        put_goal(robot, body)
        await_goal(robot, body)
        # If SOAP's first response was wrong after the goal before, wait as long as a command may take.
        robot.clock.sleep(robot.settle_s if late else 0.0)
        # Also just after the same goal was sent again, which changes nothing.
        again = partial(put_goal, robot, body)
        first, second = (again, _nothing) if index // _IN_A_ROW % 2 else (_nothing, again)
        read = _read_goal(robot, subscribers, first)
        if read is not None:
            reads += for_good([read])
            late = [*late, replace(read, broken="")] if read.differs and index else []
        reads += _compare_goals(robot, subscribers, second)
        if len(late) >= _GOALS:
            reads.append(late[-1])
            break
    robot.delete_goal()
    await_none(robot)
    return (*reads, *_compare_goals(robot, subscribers))


def _nothing() -> None:
    """Do nothing before a request."""


def _compare_goals(robot: Robot, subscribers: SoapService, first: Callable[[], object] = _nothing) -> list[StateRead]:
    """Read the goal over both interfaces until they agree, as one may learn of a change later."""
    patience = robot.patience(robot.settle_s)
    return best_of(_read_goal(robot, subscribers, first) for _ in poll(robot.clock, 0.05, lambda: patience.over))


def _mixture_fault(before: Any, goal: Any, after: Any) -> str:
    """Return how a goal differs from both of REST's goals with its id, whenever SOAP learned of a change.

    Its status changes by itself.
    """
    if goal["goal_id"]["id"] != before["goal_id"]["id"]:
        return ""
    return disagreement({name: part for name, part in before.items() if name != "status"}, goal, after, Slack())


def _read_goal(robot: Robot, subscribers: SoapService, first: Callable[[], object] = _nothing) -> StateRead | None:
    """Read the goal over REST, SOAP and REST, ``first`` just before SOAP; return None where it changed meanwhile."""
    before, earlier = robot.goal()
    first()
    exchange = ask(subscribers, "GetGoal")
    found, problem = returns(exchange)
    after, last = robot.goal()
    if before is not None and after is not None and before["goal_id"]["id"] == after["goal_id"]["id"]:
        between = from_element(found[0], GOAL_AND_STATUS.schema) if found else None
        broken = "" if between is None else GOAL_AND_STATUS.problem(between)
        shown = [projected(goal, GOAL_AND_STATUS.schema) for goal in (before, after)]
        if between is not None and not broken:
            broken = _mixture_fault(shown[0], between, shown[1])
        problem = problem or ("no goal" if between is None else disagreement(shown[0], between, shown[1], Slack()))
        return StateRead("goal", exchange, broken, problem)
    if earlier.response.status == last.response.status == HTTPStatus.NOT_FOUND:
        # No goal: an empty response, or a fault.
        return StateRead("goal", exchange, "", "a goal, where REST says that there is none" if found else "")
    return None
