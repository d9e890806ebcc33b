"""GetPlan: a path from the robot to the requested pose in the requested frame, or a fault."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import pytest
from lxml import etree

from conformance.api.soap import content
from conformance.api.soap.callable_services import SoapServices
from conformance.api.soap.calls import SoapResponse, call, judge_answer
from conformance.api.soap.service import SoapService
from conformance.api.soap.valid_messages import call_valid
from conformance.documents.xml_names import clark, local
from conformance.documents.xml_node import Node
from conformance.documents.xsd_shapes import Element
from conformance.packs.table1.robot import delivery_messages, soap_services
from conformance.packs.table1.robot.geometry import Pose
from conformance.packs.table1.robot.plan import START_OFF
from conformance.packs.table1.statement import said_of
from conformance.verdict.effort import Effort
from conformance.verdict.evidence import Judge

pytestmark = [pytest.mark.phase("resting"), pytest.mark.needs("subscribers")]
_PLAN = "soap-subscribers/plan"
_TOLERANCE = 0.25
# A path that is not told right after so many refusals, and is otherwise, is not told because of them.
_REFUSALS = 3
# Frames of these names are asked for one after another.
_MARKS = ("first-frame", "second-frame")
_LONG = "no_such_frame<&>\u00e9_" * 6


@dataclass(frozen=True)
class _Path:
    """A path: its frames, and the positions of its poses, m."""

    frames: frozenset[str]
    points: tuple[tuple[float, float], ...]


def _path(wrapper: etree._Element, expected: Element) -> tuple[_Path | None, str]:
    """Return the path in a response wrapper, and what is wrong with it."""
    returned = content.content_of(wrapper, expected)
    if returned is None:
        return None, "an empty response"
    problem = next(content.incomplete(returned, expected), "")
    plan = content.find(returned, ["plan"])
    if problem or plan is None:
        return None, problem or "no plan"
    declared = next(child for child in expected.children[0].children if local(child.tag) == "poses")
    poses = content.items(plan, declared)
    poses = [pose for pose in poses if content.children_of(pose, "pose")]
    points = [(content.number_at(pose, "position", "x"), content.number_at(pose, "position", "y")) for pose in poses]
    whole = tuple((x, y) for x, y in points if x is not None and y is not None)
    frames = {content.text_at(item, "header", "frame_id") or "" for item in (plan, *poses)}
    return (_Path(frozenset(frames), whole), "") if whole else (None, "a path without poses")


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


@pytest.mark.requirement(_PLAN, "soap-subscribers/response-valid")
def test_plan(soap: SoapServices, subscribers: SoapService, judge: Judge, effort: Effort) -> None:
    """Check that the path starts at the robot, ends at the target within the tolerance, and is in the frame."""
    expected = soap_services.declared_return(subscribers, "GetPlan")
    frame = said_of(soap.run).motion.frame
    wanted = effort.cases(10)
    planned = 0
    here = _here(soap, subscribers)
    if here is None:
        judge.check(_PLAN, False, None, "a plan", found="GetPose does not say where the robot is")
        return
    answer: SoapResponse | None = None
    for number, target in enumerate(_targets(soap, here)):
        # Frame and tolerance may be left out: then they are map and 0.1 (contract, REST).
        given = {"frame_id": frame, "tolerance": repr(_TOLERANCE)} if number % 2 or frame != "map" else {}
        before = _here(soap, subscribers) or here
        request = delivery_messages.request("GetPlan", x=target.x, y=target.y, yaw="0.0", **given)
        answer = call_valid(subscribers, request)
        after = _here(soap, subscribers) or before
        if answer.fault is not None:
            continue
        planned += 1
        path, problem = _told(answer, expected)
        if path is not None:
            problem = _problem(path, before, after, target, frame)
        judge.check(_PLAN, not problem, answer.exchange, "a path from the robot to the asked pose", found=problem)
        if planned >= wanted:
            _after_refusals(subscribers, judge, expected, request)
            break
    if not planned and answer is not None:
        judge_answer(judge, _PLAN, False, answer, "a plan to where the robot is")


def _told(answer: SoapResponse, expected: Element) -> tuple[_Path | None, str]:
    """Return the path in a response without a fault, and what is wrong with it."""
    wrapper = answer.first if answer.accepted else None
    return (None, answer.describe()) if wrapper is None else _path(wrapper, expected)


def _after_refusals(subscribers: SoapService, judge: Judge, expected: Element, request: Node) -> None:
    """Judge that a valid request right after a rejected one gets a path, where it gets one otherwise."""
    none = 0
    for _ in range(_REFUSALS):
        call(subscribers, Node(clark(delivery_messages.NAMESPACE, "GetNothing")))
        answer = call_valid(subscribers, request)
        if answer.fault is None:
            problem = _told(answer, expected)[1]
            judge.check(_PLAN, not problem, answer.exchange, "a path, after another request was refused", found=problem)
        elif call_valid(subscribers, request).fault is None:
            none += 1
            if none == _REFUSALS:
                judge_answer(judge, _PLAN, False, answer, "a path, after another request was refused")


def _problem(path: _Path, before: Pose, after: Pose, target: Pose, frame: str) -> str:
    """Return what is wrong with a path; empty when nothing is."""
    first, last = path.points[0], path.points[-1]
    start = math.hypot(first[0] - before.x, first[1] - before.y)
    end = math.hypot(last[0] - target.x, last[1] - target.y)
    if start > START_OFF + before.distance(after):
        return f"it starts {start:.3f} m from the robot"
    if end > _TOLERANCE:
        return f"it ends {end:.3f} m from the position in the request"
    if path.frames != {frame}:
        return f"it is in the frame {', '.join(sorted(path.frames - {frame}))!r}, not {frame!r}"
    return ""


@pytest.mark.requirement("soap-subscribers/plan-none")
def test_no_plan(soap: SoapServices, subscribers: SoapService, judge: Judge) -> None:
    """Request plans far outside any map and in an unknown frame: the response must be a fault."""
    expected = soap_services.declared_return(subscribers, "GetPlan")
    # Where the robot is, so that nothing but the frame can be the reason.
    here = _here(soap, subscribers) or Pose(0.0, 0.0, 0.0)
    for message, what in (
        (delivery_messages.request("GetPlan", x=1e7, y=-1e7), "a position 10,000 km away"),
        (
            delivery_messages.request("GetPlan", x=here.x, y=here.y, frame_id="no_such_frame"),
            "a frame that the robot does not know",
        ),
        (
            delivery_messages.request("GetPlan", x=here.x, y=here.y, frame_id=_LONG),
            f"a frame with a name of {len(_LONG)} characters, with markup and beyond ASCII",
        ),
    ):
        # A response of another request, in the place of this one's, is then no fault.
        call_valid(subscribers, delivery_messages.request("GetVelocity"))
        answer = call_valid(subscribers, message)
        wrapper = answer.first if answer.accepted else None
        path = _path(wrapper, expected)[0] if wrapper is not None else None
        # A robot in an open world may know a way to anywhere; then it has to end there.
        arrives = path is not None and math.hypot(path.points[-1][0] - 1e7, path.points[-1][1] + 1e7) < 1
        judge_answer(
            judge, "soap-subscribers/plan-none", answer.fault is not None or arrives, answer, f"a fault for {what}"
        )
    for mark in _MARKS:
        message = delivery_messages.request("GetPlan", x=here.x, y=here.y, frame_id=f"{_LONG}{mark}")
        answer = call_valid(subscribers, message)
        others = [one for one in _MARKS if one != mark and one.encode() in answer.exchange.response.body]
        judge.check(
            "soap-subscribers/plan-none",
            not others,
            answer.exchange,
            "a response that names no frame of another request",
            found=f"one that names {', '.join(others)}",
            cause="another request's",
        )
