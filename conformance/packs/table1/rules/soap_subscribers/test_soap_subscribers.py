"""Read Table 1's resources and plans over the subscribers SOAP service. A checker judges each response's content."""

import math
from collections.abc import Iterator
from typing import Final

import pytest

from conformance.api.soap.callable_services import SoapServices
from conformance.api.soap.calls import SoapResponse, call, judge_answer, read_exchange, send
from conformance.api.soap.envelope import envelope
from conformance.api.soap.messages import padded
from conformance.api.soap.service import SoapService
from conformance.api.soap.valid_messages import call_valid, require_valid_document
from conformance.contract.classes import TAKEN_OCTETS
from conformance.documents.representation import flattened
from conformance.documents.xml import Node, clark
from conformance.packs.table1.robot import soap_services
from conformance.packs.table1.robot.geometry import Pose
from conformance.packs.table1.robot.message_shapes import GET_PLAN, ODOMETRY, TWIST
from conformance.packs.table1.robot.plan import START_OFF, plan_of
from conformance.packs.table1.robot.soap_services import NAMESPACE, ask, outgoing, request
from conformance.packs.table1.robot.state_read import value_in
from conformance.packs.table1.statement import said_of
from conformance.transport.exchange import Exchange
from conformance.transport.parallel import MOST_CLIENTS, is_busy, send_together
from conformance.verdict.effort import Effort
from conformance.verdict.evidence import Judge

pytestmark = [pytest.mark.phase("resting"), pytest.mark.needs("subscribers")]
_STATES: Final = {"GetPose": ODOMETRY, "GetVelocity": TWIST}
_LISTS: Final = ("GetSensors", "GetNavigationServices")
_READ: Final = (*_STATES, *_LISTS)
_NAMES: Final = ("pose", "velocity", "sensors", "services", "goal")
_IDS: Final = dict(zip((*_READ, "GetGoal"), (f"soap-subscribers/{name}" for name in _NAMES), strict=True))
_UNKNOWN: Final = Node(clark(NAMESPACE, "GetNothing"))
_OWN: Final = "soap-subscribers/concurrent-answers"


def _ask(judge: Judge, subscribers: SoapService, operation: str) -> None:
    """Call an operation, and judge that it responds; without a goal, GetGoal may return a fault."""
    answer = call_valid(subscribers, request(operation))
    right = answer.payload == clark(NAMESPACE, f"{operation}Response")
    if operation == "GetGoal":
        right = answer.fault is not None or (right and answer.is_success)
    else:
        right = answer.is_taken and (right or not answer.is_success)
    judge_answer(judge, _IDS[operation], right, answer, f"{operation}Response")


@pytest.mark.requirement("soap-subscribers/pose", "soap-subscribers/velocity", "soap-subscribers/response-valid")
def test_pose_and_velocity(subscribers: SoapService, judge: Judge, effort: Effort) -> None:
    """Call GetPose and GetVelocity repeatedly."""
    for operation in (*_STATES,) * effort.cases(60):
        _ask(judge, subscribers, operation)


@pytest.mark.requirement("soap-subscribers/sensors", "soap-subscribers/services")
def test_lists(subscribers: SoapService, judge: Judge, effort: Effort) -> None:
    """Call GetSensors and GetNavigationServices repeatedly."""
    for operation in _LISTS * effort.cases(40):
        _ask(judge, subscribers, operation)


@pytest.mark.requirement(*_IDS.values())
def test_after_a_refusal(subscribers: SoapService, judge: Judge, effort: Effort) -> None:
    """Send a valid request right after a rejected one: the response must be as usual."""
    for operation in (*_IDS,) * effort.cases(10):
        call(subscribers, _UNKNOWN)
        _ask(judge, subscribers, operation)


@pytest.mark.requirement("soap-subscribers/goal")
def test_goal(subscribers: SoapService, judge: Judge, effort: Effort) -> None:
    """Call GetGoal repeatedly."""
    for _ in range(effort.cases(30)):
        _ask(judge, subscribers, "GetGoal")


@pytest.mark.requirement("soap-subscribers/size")
def test_64_kib(subscribers: SoapService, judge: Judge) -> None:
    """Send a valid request of 64 KiB: the robot must respond to it."""
    for operation in _READ:
        question = envelope((request(operation),)).serialize()
        answer = send(subscribers, require_valid_document(subscribers, padded(question, TAKEN_OCTETS)))
        expected = f"2xx for a message of {TAKEN_OCTETS:,} bytes"
        judge_answer(judge, "soap-subscribers/size", answer.is_taken, answer, expected, cause=answer.describe())


@pytest.mark.requirement(_OWN)
def test_answers_do_not_cross(subscribers: SoapService, judge: Judge, effort: Effort) -> None:
    """Call different operations at the same moment from several clients: each must get its own response."""
    asked = [_READ[client % len(_READ)] for client in range(MOST_CLIENTS)]
    questions = [outgoing(subscribers, request(name)) for name in asked]
    alone = {operation: _strings(ask(subscribers, operation), operation) for operation in _STATES}
    for came in send_together([questions] * effort.cases(30)):
        for operation, attempt in zip(asked, came, strict=True):
            if isinstance(attempt, Exchange) and not is_busy(attempt):
                answer = read_exchange(attempt)
                if answer.is_taken:  # it does not show which interface is at fault
                    own = answer.payload == clark(NAMESPACE, f"{operation}Response")
                    judge_answer(judge, _OWN, own, answer, f"the answer to {operation}")
                if answer.is_success and alone.get(operation):
                    found = _strings(attempt, operation)
                    expected = f"the strings of {operation} as they are when nobody else asks, {alone[operation]}"
                    judge.check(
                        _OWN, found == alone[operation], attempt, expected, found=str(found), cause="other strings"
                    )


def _strings(exchange: Exchange, operation: str) -> dict[str, str]:
    """Return the strings of a state, such as the names of its frames."""
    value, problem = value_in(exchange, _STATES[operation])
    return {} if problem else {place: one for place, one in flattened(value).items() if isinstance(one, str)}


_PLAN = "soap-subscribers/plan"
_TOLERANCE = 0.25
# Refusals after which a plan is wrong, and otherwise right, before the refusals count as the reason.
_REFUSALS = 3
_MARKS = ("first-frame", "second-frame")  # names of frames that are requested one after another
_LONG = "no_such_frame<&>\u00e9_" * 6  # a long name


def _here(soap: SoapServices, service: SoapService) -> Pose | None:
    """Return the robot's position in the frame of plans."""
    position = soap_services.position(service)
    if position is None:
        return None
    return Pose(*position, 0.0).seen_from(Pose(*said_of(soap.run).motion.odom_to_map))


def _targets(soap: SoapServices, here: Pose) -> Iterator[Pose]:
    """Yield poses near the robot that it may reach; the last is its own position."""
    for goal in said_of(soap.run).motion.goals:
        yield Pose(*goal)
    for reach in (1.0, 0.5):
        for turn in (0, 45, -45, 90, -90, 135, -135, 180):
            yield here.ahead(reach, math.radians(turn))
    yield here


@pytest.mark.requirement(_PLAN)
def test_plan(soap: SoapServices, subscribers: SoapService, judge: Judge, effort: Effort) -> None:
    """Check that the path starts at the robot."""
    frame = said_of(soap.run).motion.frame
    wanted = effort.cases(10)
    planned = 0
    here = _here(soap, subscribers)
    if here is None:
        judge.check(_PLAN, False, None, "a plan", found="GetPose does not say where the robot is")
        return
    answer: SoapResponse | None = None
    for number, target in enumerate(_targets(soap, here)):
        # Frame and tolerance may be left out; the defaults are map and 0.1 (contract, REST).
        given = {"frame_id": frame, "tolerance": repr(_TOLERANCE)} if number % 2 or frame != "map" else {}
        before = _here(soap, subscribers) or here
        request = soap_services.request("GetPlan", x=target.x, y=target.y, yaw="0.0", **given)
        answer = call_valid(subscribers, request)
        after = _here(soap, subscribers) or before
        if answer.fault is not None:
            continue
        planned += 1
        path, problem = _path_of(answer)
        if path:
            # The end and frame of every plan are judged elsewhere.
            off_m = path[0].distance(before)
            problem = f"it starts {off_m:.3f} m from the robot" if off_m > START_OFF + before.distance(after) else ""
        judge.check(_PLAN, not problem, answer.exchange, "a path from the robot to the asked pose", found=problem)
        if planned >= wanted:
            _after_refusals(subscribers, judge, request)
            break
    if not planned and answer is not None:
        judge_answer(judge, _PLAN, False, answer, "a plan to where the robot is")


def _path_of(answer: SoapResponse) -> tuple[tuple[Pose, ...], str]:
    """Return the path in a response without a fault, and the path's fault."""
    value, problem = value_in(answer.exchange, GET_PLAN)
    problem = problem or GET_PLAN.problem(value)
    return ((), problem) if problem else (plan_of(value).poses, "")


def _after_refusals(subscribers: SoapService, judge: Judge, request: Node) -> None:
    """Judge that a valid request right after a rejected one gets a path, if it does otherwise."""
    none = 0
    for _ in range(_REFUSALS):
        call(subscribers, Node(clark(soap_services.NAMESPACE, "GetNothing")))
        answer = call_valid(subscribers, request)
        if answer.fault is None:
            problem = _path_of(answer)[1]
            judge.check(_PLAN, not problem, answer.exchange, "a path, after another request was refused", found=problem)
        elif call_valid(subscribers, request).fault is None:
            none += 1
            if none == _REFUSALS:
                judge_answer(judge, _PLAN, False, answer, "a path, after another request was refused")


@pytest.mark.requirement("soap-subscribers/plan-none")
def test_no_plan(soap: SoapServices, subscribers: SoapService, judge: Judge) -> None:
    """Request plans far outside any map and in an unknown frame: the response must be a fault."""
    # Plan to the robot's own place, so that only the frame can be the reason for a refusal.
    here = _here(soap, subscribers) or Pose(0.0, 0.0, 0.0)
    for message, what in (
        (soap_services.request("GetPlan", x=1e7, y=-1e7), "a position 10,000 km away"),
        (
            soap_services.request("GetPlan", x=here.x, y=here.y, frame_id="no_such_frame"),
            "a frame that the robot does not know",
        ),
        (
            soap_services.request("GetPlan", x=here.x, y=here.y, frame_id=_LONG),
            f"a frame with a name of {len(_LONG)} characters, with markup and beyond ASCII",
        ),
    ):
        # Another client's fault in place of this response would then be noticed.
        call_valid(subscribers, soap_services.request("GetVelocity"))
        answer = call_valid(subscribers, message)
        path, _ = _path_of(answer)
        # A robot in an open world may have a plan to anywhere; then the plan has to end there.
        arrives = bool(path) and path[-1].distance(Pose(1e7, -1e7, 0.0)) < 1
        judge_answer(
            judge, "soap-subscribers/plan-none", answer.fault is not None or arrives, answer, f"a fault for {what}"
        )
    for mark in _MARKS:
        message = soap_services.request("GetPlan", x=here.x, y=here.y, frame_id=f"{_LONG}{mark}")
        answer = call_valid(subscribers, message)
        others = [text for text in _MARKS if text != mark and text.encode() in answer.exchange.response.body]
        judge.check(
            "soap-subscribers/plan-none",
            not others,
            answer.exchange,
            "a response that names no frame of another request",
            found=f"one that names {', '.join(others)}",
            cause="another request's",
        )
