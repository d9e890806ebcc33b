"""The subscribers service: the readable resources of the paper's Table 1 over SOAP."""

import pytest
from lxml import etree

from conformance.api.soap import content
from conformance.api.soap.calls import SoapResponse, call, judge_answer, read_exchange, send
from conformance.api.soap.envelope import envelope
from conformance.api.soap.messages import padded
from conformance.api.soap.service import SoapService
from conformance.api.soap.valid_messages import call_valid, require_valid_document
from conformance.contract.classes import TAKEN_OCTETS
from conformance.documents.xml import text_of
from conformance.documents.xml_names import clark, local
from conformance.documents.xml_node import Node
from conformance.documents.xsd_shapes import Element
from conformance.packs.table1.robot import delivery_messages
from conformance.packs.table1.robot.soap_services import declared_return, outgoing
from conformance.transport.exchange import Exchange
from conformance.transport.parallel import MOST_CLIENTS, is_busy, send_together
from conformance.verdict.effort import Effort
from conformance.verdict.evidence import Judge

pytestmark = [pytest.mark.phase("resting"), pytest.mark.needs("subscribers")]
_VALID = "soap-subscribers/response-valid"
_OWN = "soap-subscribers/concurrent-answers"
_ONE = ("GetPose", "GetVelocity")
_LISTS = ("GetSensors", "GetNavigationServices")
_READ = (*_ONE, *_LISTS)
_IDS = dict(
    zip(_READ, (f"soap-subscribers/{name}" for name in ("pose", "velocity", "sensors", "services")), strict=True)
)


def _wrapper(judge: Judge, service: SoapService, operation: str, answer: SoapResponse) -> etree._Element | None:
    """Return the response wrapper of a response without a fault, and judge its name and its schema."""
    expected = clark(delivery_messages.NAMESPACE, f"{operation}Response")
    first = answer.first if answer.fault is None else None
    if first is None or first.tag != expected:
        judge_answer(judge, _VALID, False, answer, f"{expected} in the Body")
        return None
    described = service.described
    if described.shape(expected) is None:
        described = service.contract
    reason = described.types.invalid(first)
    judge.check(_VALID, not reason, answer.exchange, f"{operation}Response as the description says it is", found=reason)
    return first


def _complete(judge: Judge, id_: str, service: SoapService, operation: str) -> etree._Element | None:
    """Call an operation without arguments, judge that it returns all that the contract says, and return it."""
    answer = call_valid(service, Node(clark(delivery_messages.NAMESPACE, operation)))
    judge_answer(judge, id_, answer.accepted, answer, f"{operation}Response")
    return _content(judge, id_, service, operation, answer) if answer.succeeded else None


def _content(
    judge: Judge, id_: str, service: SoapService, operation: str, answer: SoapResponse
) -> etree._Element | None:
    """Judge that a response has all that the contract says, and return its content."""
    wrapper = _wrapper(judge, service, operation, answer)
    expected = declared_return(service, operation)
    returned = content.content_of(wrapper, expected) if wrapper is not None else None
    if returned is None:
        judge.check(
            id_, False, answer.exchange, f"{operation}Response with content", found=f"{answer.describe()}, empty"
        )
        return None
    problem = next(content.incomplete(returned, expected), "")
    return returned if judge.check(id_, not problem, answer.exchange, _named(expected), found=problem) else None


def _named(expected: Element) -> str:
    return f"complete content: {', '.join(local(child.tag) for child in expected.children)}"


@pytest.mark.requirement("soap-subscribers/pose", "soap-subscribers/velocity", _VALID)
def test_pose_and_velocity(subscribers: SoapService, judge: Judge, effort: Effort) -> None:
    """Call GetPose and GetVelocity repeatedly: each response must be a complete Odometry or Twist."""
    for _ in range(effort.cases(60)):
        pose = _complete(judge, "soap-subscribers/pose", subscribers, "GetPose")
        if pose is not None:
            length = sum((content.number_at(pose, "orientation", axis) or 0.0) ** 2 for axis in "xyzw") ** 0.5
            judge.check(
                "soap-subscribers/pose",
                abs(length - 1) <= 1e-3,
                None,
                "an orientation of unit length within 1e-3",
                found=f"length {length:g}",
            )
        _complete(judge, "soap-subscribers/velocity", subscribers, "GetVelocity")


@pytest.mark.requirement("soap-subscribers/sensors", "soap-subscribers/services", _VALID)
def test_lists(subscribers: SoapService, judge: Judge, effort: Effort) -> None:
    """Call GetSensors and GetNavigationServices: complete items, full type names, no duplicates."""
    for _ in range(effort.cases(40)):
        for operation in _LISTS:
            _list(judge, subscribers, operation)


def _list(judge: Judge, subscribers: SoapService, operation: str) -> None:
    """Call a list operation and judge its response."""
    id_ = _IDS[operation]
    answer = call_valid(subscribers, Node(clark(delivery_messages.NAMESPACE, operation)))
    judge_answer(judge, id_, answer.accepted, answer, f"{operation}Response")
    if answer.succeeded:
        _items(judge, id_, subscribers, operation, answer)


def _items(judge: Judge, id_: str, service: SoapService, operation: str, answer: SoapResponse) -> None:
    """Judge that a response lists complete items."""
    wrapper = _wrapper(judge, service, operation, answer)
    if wrapper is not None:
        problem = _list_problem(wrapper, declared_return(service, operation))
        judge.check(id_, not problem, answer.exchange, "a list of complete items", found=problem)


@pytest.mark.requirement(*_IDS.values(), "soap-subscribers/goal", _VALID)
def test_after_a_refusal(subscribers: SoapService, judge: Judge, effort: Effort) -> None:
    """Send a valid request right after a rejected one: the response must be as usual."""
    for _ in range(effort.cases(10)):
        for operation in (*_IDS, "GetGoal"):
            call(subscribers, Node(clark(delivery_messages.NAMESPACE, "GetNothing")))
            if operation in _ONE:
                _complete(judge, _IDS[operation], subscribers, operation)
            elif operation in _LISTS:
                _list(judge, subscribers, operation)
            else:
                _goal(judge, subscribers)


def _list_problem(wrapper: etree._Element, expected: Element) -> str:
    """Return what is wrong with a list, or an empty text; an empty list is valid."""
    seen: set[tuple[str | None, ...]] = set()
    names = [local(child.tag) for child in expected.children]
    for item in content.items(wrapper, expected):
        problem = next(content.incomplete(item, expected), "")
        if problem:
            return problem
        values = tuple(content.text_at(item, name) for name in names)
        if values in seen:
            return f"{values} stands twice"
        seen.add(values)
        type_ = content.text_at(item, "type") or ""
        if len(type_.split("/")) != 3 or not all(type_.split("/")):  # package/msg/Name (contract, ROS side)
            return f"type {type_!r} is not named in full"
    return ""


@pytest.mark.requirement("soap-subscribers/goal", _VALID)
def test_goal(subscribers: SoapService, judge: Judge, effort: Effort) -> None:
    """Call GetGoal: a complete goal, or without a goal an empty response or a fault."""
    for _ in range(effort.cases(30)):
        _goal(judge, subscribers)


def _goal(judge: Judge, subscribers: SoapService) -> None:
    """Call GetGoal and judge the response."""
    expected = declared_return(subscribers, "GetGoal")
    answer = call_valid(subscribers, Node(clark(delivery_messages.NAMESPACE, "GetGoal")))
    if answer.fault is not None:
        judge.check("soap-subscribers/goal", True, answer.exchange, "a fault where there is no goal")
        return
    wrapper = _wrapper(judge, subscribers, "GetGoal", answer) if answer.succeeded else None
    if wrapper is None:
        judge_answer(judge, "soap-subscribers/goal", False, answer, "GetGoalResponse")
        return
    returned = content.content_of(wrapper, expected)
    empty = returned is None or (len(returned) == 0 and not text_of(returned).strip())
    problem = "" if empty or returned is None else next(content.incomplete(returned, expected), "")
    judge.check(
        "soap-subscribers/goal", not problem, answer.exchange, "an empty response or a complete goal", found=problem
    )


@pytest.mark.requirement("soap-subscribers/size")
def test_64_kib(subscribers: SoapService, judge: Judge) -> None:
    """Send a valid request of 64 KiB: the robot must respond to it."""
    for operation in _READ:
        question = envelope((Node(clark(delivery_messages.NAMESPACE, operation)),)).written()
        answer = send(subscribers, require_valid_document(subscribers, padded(question, TAKEN_OCTETS)))
        expected = f"2xx for a message of {TAKEN_OCTETS:,} bytes"
        judge_answer(judge, "soap-subscribers/size", answer.accepted, answer, expected, cause=answer.describe())


@pytest.mark.requirement(_OWN, _VALID)
def test_answers_do_not_cross(subscribers: SoapService, judge: Judge, effort: Effort) -> None:
    """Call different operations at the same moment from several clients: each must get its own complete response."""
    asked = [_READ[client % len(_READ)] for client in range(MOST_CLIENTS)]
    questions = [outgoing(subscribers, Node(clark(delivery_messages.NAMESPACE, name))) for name in asked]
    alone = {operation: _strings(judge, subscribers, operation) for operation in _ONE}
    for came in send_together([questions] * effort.cases(30)):
        for operation, attempt in zip(asked, came, strict=True):
            if isinstance(attempt, Exchange) and not is_busy(attempt):
                answer = read_exchange(attempt)
                expected = clark(delivery_messages.NAMESPACE, f"{operation}Response")
                if answer.accepted:  # whose a fault is does not show
                    judge_answer(judge, _OWN, answer.payload == expected, answer, f"the answer to {operation}")
                if answer.succeeded and operation in _LISTS:
                    _items(judge, _OWN, subscribers, operation, answer)
                elif answer.succeeded:
                    _judge_strings(judge, subscribers, operation, answer, alone[operation])


def _strings(judge: Judge, service: SoapService, operation: str) -> list[tuple[str, str]]:
    """Return the strings of a state, such as the names of its frames; empty where the response has none."""
    answer = call_valid(service, Node(clark(delivery_messages.NAMESPACE, operation)))
    returned = _content(judge, _OWN, service, operation, answer) if answer.succeeded else None
    return [] if returned is None else list(content.strings(returned, declared_return(service, operation)))


def _judge_strings(
    judge: Judge, service: SoapService, operation: str, answer: SoapResponse, alone: list[tuple[str, str]]
) -> None:
    """Judge that a response is complete and names the same frames as without other clients."""
    returned = _content(judge, _OWN, service, operation, answer)
    if returned is not None and alone:
        found = list(content.strings(returned, declared_return(service, operation)))
        expected = f"the strings of {operation} as they are when nobody else asks, {dict(alone)}"
        judge.check(_OWN, found == alone, answer.exchange, expected, found=str(dict(found)), cause="other strings")
