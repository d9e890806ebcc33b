"""Read Table 1's resources over the subscribers SOAP service. A checker judges each response's content."""

from typing import Final

import pytest

from conformance.api.soap.calls import call, judge_answer, read_exchange, send
from conformance.api.soap.envelope import envelope
from conformance.api.soap.messages import padded
from conformance.api.soap.service import SoapService
from conformance.api.soap.valid_messages import call_valid, require_valid_document
from conformance.contract.classes import TAKEN_OCTETS
from conformance.documents.representation import flattened
from conformance.documents.xml import Node, clark
from conformance.packs.table1.robot.message_shapes import ODOMETRY, TWIST
from conformance.packs.table1.robot.soap_services import NAMESPACE, ask, outgoing, request
from conformance.packs.table1.robot.state_over_soap import value_in
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
