"""Which SOAP services a check may call in this run."""

from dataclasses import dataclass

import pytest

from conformance.api.device import device_of
from conformance.api.soap.calls import SoapResponse, call
from conformance.api.soap.service import SoapService
from conformance.api.soap.valid_messages import example
from conformance.contract.classes import Interface
from conformance.documents.wsdl import SoapOperation
from conformance.documents.xml import Node
from conformance.verdict.effort import Effort
from conformance.verdict.run import Run

_NO_MOTION = "the publishers service moves the robot, and --allow-motion was not given"


@dataclass
class SoapServices:
    """A robot's SOAP services in one run.

    Attributes:
        run: what is judged, and by what.
        publishers: the service that acts, or None where it has no address.
        subscribers: the service that only reads, or None.
    """

    run: Run
    publishers: SoapService | None = None
    subscribers: SoapService | None = None

    @property
    def there(self) -> dict[Interface, SoapService]:
        """The services that have an address, the acting one first."""
        named = {Interface.PUBLISHERS: self.publishers, Interface.SUBSCRIBERS: self.subscribers}
        return {name: service for name, service in named.items() if service is not None}


def callable_services(soap: SoapServices, *ids: str) -> list[SoapService]:
    """Return the services that may be called, the service that only reads first.

    A service that may not be called, or does not respond, is recorded at the requirements that need it, so that they do
    not pass on half of the evidence.

    Raises:
        pytest.skip.Exception: no service may be called.
    """
    found: list[SoapService] = []
    reasons: list[str] = []
    for service in reversed(soap.there.values()):
        if problem := _problem(soap.run, service):
            reasons.append(problem)
        else:
            found.append(service)
    if not found:
        pytest.skip("; ".join(reasons) or "no SOAP service has an address")
    for id_ in ids:
        requirement = soap.run.contract.requirement(id_)
        for reason in reasons:
            if requirement is not None and (reason != _NO_MOTION or "motion" in requirement.needs):
                soap.run.judge.skip(id_, reason)
    return found


def accepted_messages(soap: SoapServices, service: SoapService, *ids: str) -> list[tuple[SoapOperation, Node]]:
    """Return each operation with an accepted message; note at the requirements which operations have none.

    Raises:
        NoAnswerError: no HTTP response came.
    """
    found = [(operation, example(service, operation)) for operation in service.contract.operations]
    accepted = [(operation, message) for operation, message in found if message is not None]
    for id_ in ids if not accepted else ():
        soap.run.judge.note(id_, f"the {service.name} service accepted none of the messages tried")
    return accepted


def is_gone(
    soap: SoapServices, service: SoapService, accepted: tuple[SoapOperation, Node], answer: SoapResponse
) -> bool:
    """Return whether a refusal only shows that the thing to be read has ended before.

    Args:
        soap: the services of the run.
        service: the one that was called.
        accepted: the operation, and its message that the robot accepted before.
        answer: the response to the request to be judged.

    Raises:
        NoAnswerError: no HTTP response came.
    """
    operation, message = accepted
    may_end = operation.name in device_of(soap.run).comes_and_goes
    return may_end and answer.is_refused and call(service, message).is_refused


def _problem(run: Run, service: SoapService) -> str:
    """Return why a service may not be called; empty where it may."""
    if service.name == Interface.PUBLISHERS and not run.allow_motion:
        return _NO_MOTION
    if service.name in run.unreachable:
        return f"the robot's {service.name} interface does not answer: {run.unreachable[service.name]}"
    return f"the contract describes no {service.name} service" if service.contract_wsdl_path is None else ""


def repetitions(effort: Effort, standard: int) -> int:
    """Return how often to repeat a request, to notice intermittent failures."""
    return max(1, round(standard * effort.factor))
