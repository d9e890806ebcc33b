"""The active goal, or its absence, over REST and SOAP, including the first response after a change."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from conformance.api.soap.service import SoapService
from conformance.documents.representation import from_element, projected
from conformance.observe.polling import poll
from conformance.packs.table1.robot.agreement import Slack, disagreement
from conformance.packs.table1.robot.goal import await_goal, await_none, goal_body, put_goal
from conformance.packs.table1.robot.goals import choose_goals
from conformance.packs.table1.robot.message_shapes import GOAL_AND_STATUS
from conformance.packs.table1.robot.robot import Robot
from conformance.packs.table1.robot.soap_services import ask, returned
from conformance.scenarios.rule import Case
from conformance.scenarios.scenario import PartialTraceError, scenario
from conformance.scenarios.stage import Need
from conformance.transport.exchange import Exchange
from conformance.verdict.effort import Effort

_SLACK: Final = Slack()
# Goals that displaced another one, of which each has to be out in the first answer after it.
_GOALS: Final = 3


@dataclass(frozen=True)
class GoalRead:
    """The goal over SOAP, and over REST before and after it.

    Attributes:
        exchange: request and response over SOAP.
        broken: what is wrong with SOAP's goal by itself; empty if nothing.
        differs: where SOAP's goal differs from REST's; None where REST's changed in the meantime.
        first: whether this was the last of several first answers after a change, each of which differed.
    """

    exchange: Exchange
    broken: str
    differs: str | None
    first: bool = False

    @property
    def cases(self) -> Iterator[Case]:
        """Yield the readings as judged cases."""
        if self.broken:
            yield Case(not self.broken, self.exchange, "a complete goal, as REST gives it", self.broken)
        if self.differs is not None:
            cause = "first answer" if self.first else self.differs[:20]
            yield Case(not self.differs, self.exchange, "the goal that REST gives", self.differs, cause)


@scenario(needs={Need.REST, Need.SUBSCRIBERS, Need.MOTION})
def goals_over_soap(robot: Robot, subscribers: SoapService, effort: Effort) -> tuple[GoalRead, ...]:
    """PUT goals one after another, and read each over both interfaces."""
    reads: list[GoalRead] = []
    try:
        _play(robot, subscribers, effort, reads)
    except Exception as error:
        raise PartialTraceError(tuple(reads)) from error
    return tuple(reads)


def _play(robot: Robot, subscribers: SoapService, effort: Effort, reads: list[GoalRead]) -> None:
    reads += _compared(robot, subscribers)
    goals = choose_goals(robot, 1.5, 2)
    late: list[GoalRead] = []
    for index in range(effort.cases(10)):
        body = goal_body(goals[index % 2], robot.statement.motion.frame, f"equal \u00e9 <&> {index}")
        put_goal(robot, body)
        await_goal(robot, body)
        if len(late) == index - 1:
            # Where SOAP's first answer was out each time so far, it gets the time that commands may take.
            robot.clock.sleep(robot.settle_s if late else 0.0)
            read = _read(robot, subscribers)
            reads += _broken(read)
            late += [read] if read.differs else []
        for _ in range(3):
            reads += _compared(robot, subscribers)
    if len(late) >= _GOALS:
        reads.append(GoalRead(late[-1].exchange, "", late[-1].differs, first=True))
    robot.delete_goal()
    await_none(robot)
    reads += _compared(robot, subscribers)


def _compared(robot: Robot, subscribers: SoapService) -> list[GoalRead]:
    """Read the goals over both interfaces until they agree, as one may learn of a change after the other."""
    reads: list[GoalRead] = []
    patience = robot.patience(robot.settle_s)
    for _ in poll(robot.clock, 0.05, lambda: patience.over):
        reads = [part for read in reads for part in _broken(read)]
        reads.append(_read(robot, subscribers))
        if not reads[-1].differs:
            break
    return reads


def _broken(read: GoalRead) -> list[GoalRead]:
    """Return what is not right a moment later either."""
    return [GoalRead(read.exchange, read.broken, None)] if read.broken else []


def _read(robot: Robot, subscribers: SoapService) -> GoalRead:
    before, first = robot.goal()
    exchange = ask(subscribers, "GetGoal")
    found, problem = returned(exchange)
    after, last = robot.goal()
    statuses = {one.response.status for one in (first, last) if one.response}
    if before is not None and after is not None and before["goal_id"]["id"] == after["goal_id"]["id"]:
        between = from_element(found[0], GOAL_AND_STATUS.schema) if found else None
        broken = "" if between is None else GOAL_AND_STATUS.problem(between)
        shown = [projected(goal, GOAL_AND_STATUS.schema) for goal in (before, after)]
        problem = problem or ("no goal" if between is None else disagreement(shown[0], between, shown[1], _SLACK))
        return GoalRead(exchange, broken, problem)
    if statuses == {404}:
        # No goal: an empty response, or a fault.
        return GoalRead(exchange, "", "a goal, where REST says that there is none" if found else "")
    return GoalRead(exchange, "", None)
