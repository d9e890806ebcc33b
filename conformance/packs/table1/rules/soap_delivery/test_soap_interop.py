"""Interoperability with zeep, a common SOAP client for Python: it must load the WSDL and call every operation."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

from conformance.api.soap.callable_services import SoapServices, repetitions
from conformance.api.soap.service import SoapService
from conformance.api.soap.valid_messages import example
from conformance.observe.clock import WALL_CLOCK, poll_for
from conformance.papers_robot.delivery import COFFEE, COURIER, EXAMPLE
from conformance.transport.exchange import NoAnswerError
from conformance.verdict.effort import Effort
from conformance.verdict.evidence import Judge

if TYPE_CHECKING:
    from conformance.api.soap.zeep_client import ZeepCaller

# Values that a user expects in zeep's result.
_VALUES = {
    "GetPose": ("pose.position.x", "pose.orientation.w", "twist.linear.x"),
    "GetVelocity": ("linear.x", "angular.z"),
}
_MOST_STALE_S = 2.0  # how long odometry may be late before it counts as missing
_AGAIN_S = 0.2  # pause between reads during that time, s


def _has(result: Any, path: str) -> bool:
    """Return whether zeep's result has a number at a path of names, whatever wraps it."""
    from zeep.helpers import serialize_object  # noqa: PLC0415 - see _client

    return _has_path(serialize_object(result), path.split("."))


def _has_path(value: Any, path: list[str]) -> bool:
    if isinstance(value, list):
        return any(_has_path(item, path) for item in value)
    if not isinstance(value, dict):
        return False
    here: Any = value
    for step in path:
        here = here.get(step) if isinstance(here, dict) else None
    return isinstance(here, float) or any(_has_path(inner, path) for inner in value.values())


def _client(judge: Judge, id_: str, service: SoapService | None) -> ZeepCaller | None:
    # Imported late: zeep costs a quarter of a second that other checks need not pay.
    from conformance.api.soap.zeep_client import ZeepCaller  # noqa: PLC0415

    if service is None:
        pytest.skip("the service has no address")
    try:
        return ZeepCaller(service)
    except NoAnswerError:
        raise
    except Exception as error:  # noqa: BLE001 - whatever zeep finds wrong with a description is the finding
        judge.check(
            id_,
            False,
            service.published.attempt,
            "a description from which zeep makes a client",
            found=f"{type(error).__name__}: {error}"[:300],
        )
        return None


def _plan(service: SoapService) -> dict[str, float]:
    """Return arguments of GetPlan for which the robot has a plan, or empty ones."""
    operation = next((item for item in service.contract.operations if item.name == "GetPlan"), None)
    message = example(service, operation) if operation is not None else None
    return (
        {} if message is None else {child.name: float(child.text) for child in message.children if child.name in "xy"}
    )


@pytest.mark.phase("acting")
@pytest.mark.needs("publishers")
@pytest.mark.motion
@pytest.mark.requirement("soap-delivery/interop")
def test_publishers(soap: SoapServices, judge: Judge, effort: Effort) -> None:
    """Call both operations of the publishers service with zeep."""
    client = _client(judge, "soap-delivery/interop", soap.publishers)
    if client is None:
        return
    for code in (COFFEE, COURIER) * repetitions(effort, 4):
        values: dict[str, Any] = {**EXAMPLE, "message_code": code}
        for operation in ("ExecuteDeliveryRequest", "ExecuteCoffeeRequest"):
            if operation == "ExecuteCoffeeRequest":
                values["message_code"] = COFFEE
            _, problem, exchange = client.call(operation, values)
            judge.check(
                "soap-delivery/interop",
                not problem,
                exchange,
                f"success for {operation}, called with the SOAP library zeep",
                found=problem,
            )


@pytest.mark.phase("resting")
@pytest.mark.needs("subscribers")
@pytest.mark.requirement("soap-subscribers/interop")
def test_subscribers(soap: SoapServices, judge: Judge, effort: Effort) -> None:
    """Call all operations of the subscribers service with zeep; those without a value may return a fault."""
    id_ = "soap-subscribers/interop"
    client = _client(judge, id_, soap.subscribers)
    if client is None or soap.subscribers is None:
        return
    plan = _plan(soap.subscribers)
    for _ in range(repetitions(effort, 5)):
        for operation, arguments in (
            ("GetPose", {}),
            ("GetVelocity", {}),
            ("GetSensors", {}),
            ("GetNavigationServices", {}),
            ("GetGoal", {}),
            ("GetPlan", plan or {"x": 0.0, "y": 0.0}),
        ):
            # If odometry is late for a moment, SOAP responds with a fault, as REST does with 503.
            for _ in poll_for(WALL_CLOCK, _AGAIN_S, _MOST_STALE_S if operation in _VALUES else 0.0):
                result, problem, exchange = client.call(operation, **arguments)
                if not problem.startswith("fault"):
                    break
            if problem.startswith("fault") and (operation == "GetGoal" or (operation == "GetPlan" and not plan)):
                problem = ""
            elif not problem:
                problem = next(
                    (f"zeep finds no {path}" for path in _VALUES.get(operation, ()) if not _has(result, path)), ""
                )
            judge.check(
                id_, not problem, exchange, f"success for {operation}, called with the SOAP library zeep", found=problem
            )
