"""GetPlan: a path from the robot to the requested pose in the requested frame, or a fault."""

import math
from collections.abc import Iterator

import pytest

from conformance.api.soap.callable_services import SoapServices
from conformance.api.soap.calls import SoapResponse, call, judge_answer
from conformance.api.soap.service import SoapService
from conformance.api.soap.valid_messages import call_valid
from conformance.documents.xml import Node, clark
from conformance.packs.table1.robot import soap_services
from conformance.packs.table1.robot.geometry import Pose
from conformance.packs.table1.robot.message_shapes import GET_PLAN
from conformance.packs.table1.robot.plan import START_OFF, plan_of
from conformance.packs.table1.robot.state_over_soap import value_in
from conformance.packs.table1.statement import said_of
from conformance.verdict.effort import Effort
from conformance.verdict.evidence import Judge

pytestmark = [pytest.mark.phase("resting"), pytest.mark.needs("subscribers")]
_PLAN = "soap-subscribers/plan"
_TOLERANCE = 0.25
# Refusals after which a plan is wrong, and otherwise right, before the refusals count as the reason.
_REFUSALS = 3
# _MARKS: names of frames that are requested one after another. _LONG: a long name.
_MARKS = ("first-frame", "second-frame")
_LONG = "no_such_frame<&>\u00e9_" * 6


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
