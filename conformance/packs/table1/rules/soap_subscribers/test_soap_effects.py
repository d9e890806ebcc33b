"""Effects of SOAP messages, seen over REST: in the list of deliveries, and in the active goal."""

from collections.abc import Callable
from functools import partial

import pytest

from conformance.api.interfaces import Interfaces
from conformance.api.soap import content
from conformance.api.soap.service import SoapService
from conformance.api.soap.valid_messages import call_valid
from conformance.contract.interfaces import Interface
from conformance.documents.xml_names import ENVELOPE, clark
from conformance.documents.xml_node import Node
from conformance.observe.clock import WALL_CLOCK
from conformance.observe.polling import Patience, poll
from conformance.packs.table1.robot import delivery_messages
from conformance.packs.table1.robot.geometry import Pose
from conformance.packs.table1.robot.goal import goal_body, put_goal
from conformance.packs.table1.robot.message_shapes import DELIVERIES, read_as
from conformance.packs.table1.robot.robot import DELIVERIES as DELIVERIES_PATH
from conformance.packs.table1.robot.robot import Robot
from conformance.packs.table1.robot.stopping import bring_to_rest
from conformance.packs.table1.statement import said_of
from conformance.transport.client import HttpClient
from conformance.verdict.effort import Effort
from conformance.verdict.evidence import Judge

# A delivery with these coordinates is none that any other check sends.
_DEPOT_X = 4711.125
_STEP_S = 0.02
# A robot has read both of two requests, one after the other, by then, s.
_LISTED_S = 1.0


def _listed(rest: HttpClient, depot_x: float) -> int | None:
    """Return how many listed deliveries have this depot; None where the robot has no list."""
    deliveries, problem = read_as(rest.send("GET", DELIVERIES_PATH).response, DELIVERIES)
    if problem:
        return None
    return sum(1 for delivery in deliveries if delivery["request"]["depot_x"] == depot_x)


@pytest.mark.phase("acting")
@pytest.mark.needs("publishers")
@pytest.mark.motion
@pytest.mark.requirement("soap-basic-profile/R1025", "soap-basic-profile/R1028")
def test_misunderstood_has_no_effect(interfaces: Interfaces, judge: Judge, effort: Effort) -> None:
    """Send a delivery that gets a MustUnderstand fault: it must not appear in the list of deliveries."""
    service, api = interfaces.soap.publishers, interfaces.rest
    if service is None or api is None or _listed(api.client, 0.0) is None:
        # That the robot answers nothing but the fault is judged elsewhere.
        judge.note("soap-basic-profile/R1025", "the robot lists no deliveries, so what it does could not be seen")
        return
    block = Node(clark("urn:example:strange", "Transaction"), "5", (), ((clark(ENVELOPE, "mustUnderstand"), "1"),))
    for number in range(effort.cases(4)):
        depot_x = _DEPOT_X + number
        answer = call_valid(service, delivery_messages.delivery(depot_x=repr(depot_x)), headers=(block,))
        if answer.code != "MustUnderstand":
            continue
        # A valid delivery after it shows when the robot is through with both.
        marker = depot_x + 0.5
        call_valid(service, delivery_messages.delivery(depot_x=repr(marker)))
        if not _until(partial(_listed, api.client, marker), Patience(api.client.connection.pace, _LISTED_S)):
            judge.note("soap-basic-profile/R1025", "what the robot does could not be seen: it lists no valid delivery")
            continue
        listed = _listed(api.client, depot_x)
        for id_ in ("soap-basic-profile/R1025", "soap-basic-profile/R1028"):
            judge.check(
                id_,
                not listed,
                answer.exchange,
                "no effect of a request that is answered MustUnderstand",
                found="the delivery in the robot's list",
            )


@pytest.mark.phase("motion")
@pytest.mark.needs("subscribers")
@pytest.mark.requirement("soap-subscribers/goal")
def test_goal_is_shown(interfaces: Interfaces, judge: Judge) -> None:
    """PUT a goal over REST: GetGoal must show it while it is active."""
    service, api = interfaces.soap.subscribers, interfaces.rest
    if service is None or api is None or not api.run.allow_motion or Interface.REST in api.run.unreachable:
        # Then whatever goal the robot has is judged as it comes.
        return
    bring_to_rest(api)
    robot = Robot(api)
    here = robot.map_pose()
    if here is None:
        return
    id_ = "roaas-soap-goal"
    # A turn on the spot, on which the robot needs no free space.
    put = goal_body(Pose(here.x, here.y, here.yaw + 2.5), said_of(api.run).motion.frame, id_)
    exchange = put_goal(robot, put)
    if exchange.response.status not in {201, 202}:
        return
    shown = _until(lambda: _goal_id(service) == id_, robot.patience(robot.settle_s))
    # A short goal may have ended before anybody could see it; then REST does not show it either.
    ended = robot.goal()[0] is None
    if shown or not ended:
        answer = call_valid(service, Node(clark(delivery_messages.NAMESPACE, "GetGoal")))
        judge.check(
            "soap-subscribers/goal",
            shown,
            answer.exchange,
            f"the active goal, with goal_id.id {id_!r}",
            found=f"goal_id.id {_goal_id(service)!r}",
        )
    bring_to_rest(api)


def _goal_id(service: SoapService) -> str | None:
    answer = call_valid(service, Node(clark(delivery_messages.NAMESPACE, "GetGoal")))
    first = answer.first if answer.accepted else None
    return content.text_at(first, "goal_id", "id") if first is not None else None


def _until(condition: Callable[[], object], patience: Patience) -> bool:
    """Return whether the condition holds before the deadline."""
    return any(condition() for _ in poll(WALL_CLOCK, _STEP_S, lambda: patience.over))
