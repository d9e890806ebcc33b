"""Effects of SOAP messages and of REST requests, seen over the other interface: listed deliveries, the active goal."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Final

from conformance.api.interfaces import Interfaces
from conformance.api.soap.calls import SoapResponse
from conformance.api.soap.valid_messages import call_valid
from conformance.contract.classes import Interface
from conformance.documents.xml import ENVELOPE, Node, clark
from conformance.observe.clock import Patience, poll
from conformance.packs.table1.robot import soap_services
from conformance.packs.table1.robot.goal import NEW, goal_body, put_goal
from conformance.packs.table1.robot.message_shapes import DELIVERIES, read_as
from conformance.packs.table1.robot.robot import DELIVERIES as DELIVERIES_PATH
from conformance.packs.table1.robot.robot import Robot
from conformance.packs.table1.robot.soap_services import text_at
from conformance.packs.table1.robot.stopping import bring_to_rest
from conformance.scenarios.scenario import scenario
from conformance.scenarios.stage import Leaves, Need, Stage
from conformance.transport.exchange import Exchange
from conformance.verdict.effort import Effort

_DEPOT_X: Final = 4711.125  # coordinate that no other check sends
_STEP_S: Final = 0.02  # pause between two reads, s
# Time after which a robot has read both of two successive requests, s.
_LISTED_S: Final = 1.0
#: The goal's id.
GOAL_ID: Final = "roaas-soap-goal"
# A turn on the spot, on which the robot needs no free space, rad.
_TURN: Final = 2.5


@dataclass(frozen=True)
class Misunderstood:
    """Deliveries that got a MustUnderstand fault.

    Attributes:
        lists: whether the robot has a list of deliveries.
        answers: each exchange, with how often the delivery is listed; None: a valid one after it is not listed either.
    """

    lists: bool
    answers: tuple[tuple[Exchange, int | None], ...] = ()


@dataclass(frozen=True)
class GoalBySoap:
    """A goal that GetGoal was to show.

    Attributes:
        shown: the last GetGoal while the goal was active, and the id that it showed; or None.
        after: a GetGoal after the goal was cancelled; or None.
    """

    shown: tuple[Exchange, str | None] | None = None
    after: Exchange | None = None


@scenario(needs={Need.PUBLISHERS, Need.MOTION}, leaves=Leaves.UNTOUCHED, stage=Stage.ACTING)
def misunderstood(interfaces: Interfaces, effort: Effort) -> Misunderstood:
    """Send deliveries with a header block that no robot understands, and read the list of deliveries."""
    service, api = interfaces.soap.publishers, interfaces.rest
    robot = None if api is None else Robot(api)
    if service is None or robot is None or _count_listed(robot, 0.0) is None:
        return Misunderstood(lists=False)
    block = Node(clark("urn:example:strange", "Transaction"), "5", (), ((clark(ENVELOPE, "mustUnderstand"), "1"),))
    answers: list[tuple[Exchange, int | None]] = []
    for number in range(effort.cases(4)):
        depot_x = _DEPOT_X + number
        answer = call_valid(service, soap_services.delivery(depot_x=repr(depot_x)), headers=(block,))
        if answer.code != "MustUnderstand":
            continue
        # A valid delivery afterwards shows when the robot has handled both.
        marker = depot_x + 0.5
        call_valid(service, soap_services.delivery(depot_x=repr(marker)))
        through = _until(partial(_count_listed, robot, marker), robot.patience(_LISTED_S), robot)
        answers.append((answer.exchange, _count_listed(robot, depot_x) if through else None))
    return Misunderstood(lists=True, answers=tuple(answers))


# Without --allow-motion, GetGoal is judged by whatever goal the robot has.
@scenario(needs={Need.SUBSCRIBERS})
def goal_by_soap(interfaces: Interfaces) -> GoalBySoap:
    """PUT a goal over REST, record the last GetGoal and the id that it shows, and GetGoal after the goal.

    Empty where no goal could be PUT, or the goal has ended before it could be seen.
    """
    service, api = interfaces.soap.subscribers, interfaces.rest
    if service is None or api is None or not api.run.allow_motion or Interface.REST in api.run.unreachable:
        return GoalBySoap()
    bring_to_rest(api)
    robot = Robot(api)
    here = robot.map_pose()
    if here is None:
        return GoalBySoap()
    body = goal_body(here._replace(yaw=here.yaw + _TURN), robot.statement.motion.frame, GOAL_ID)
    if put_goal(robot, body).response.status not in NEW:
        return GoalBySoap()
    reads: list[tuple[Exchange, str | None]] = []

    def ask_goal() -> SoapResponse:
        return call_valid(service, Node(clark(soap_services.NAMESPACE, "GetGoal")))

    def shows() -> bool:
        answer = ask_goal()
        first = answer.first if answer.is_taken else None
        shown = text_at(first, "goal_id", "id") if first is not None else None
        reads.append((answer.exchange, shown))
        return shown == GOAL_ID

    # A short goal may have ended before it could be read; then REST does not show it either.
    known = _until(shows, robot.patience(robot.settle_s), robot) or robot.goal()[0] is not None
    bring_to_rest(api)
    return GoalBySoap(reads[-1], ask_goal().exchange) if known else GoalBySoap()


def _count_listed(robot: Robot, depot_x: float) -> int | None:
    """Return how many listed deliveries have this depot; None where the robot has no list."""
    deliveries, problem = read_as(robot.rest.send("GET", DELIVERIES_PATH).response, DELIVERIES)
    if problem:
        return None
    return sum(1 for delivery in deliveries if delivery["request"]["depot_x"] == depot_x)


def _until(condition: Callable[[], object], patience: Patience, robot: Robot) -> bool:
    """Return whether the condition holds before the deadline."""
    return any(condition() for _ in poll(robot.clock, _STEP_S, lambda: patience.over))
