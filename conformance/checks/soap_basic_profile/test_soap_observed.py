"""What holds of every SOAP answer, whatever was asked: watched from here on, over the whole run."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from conformance.documents.wsdl import DescriptionError
from conformance.documents.xml_names import clark
from conformance.documents.xml_node import Node
from conformance.soap.callable_services import askable
from conformance.soap.calls import call
from conformance.soap.observer import PASSIVE, SoapObserver

if TYPE_CHECKING:
    from conformance.engine.session import Session
    from conformance.soap.service import SoapService
    from conformance.verdict.effort import Effort

pytestmark = pytest.mark.phase("reach")
_STRANGE = Node(clark("urn:example:strange", "no_such_operation"))


@pytest.mark.requirement(*PASSIVE)
def test_every_answer_is_watched(roaas: Session, effort: Effort) -> None:
    """Every SOAP answer of the run is judged by the rules for messages and faults.

    To begin with, a fault is provoked and each operation without arguments is asked.
    """
    services = askable(roaas, *PASSIVE)
    watched = [service for service in (roaas.publishers, roaas.subscribers) if service is not None]
    roaas.connection.listeners.append(
        SoapObserver(roaas.judge, {service.endpoint: _answers(service) for service in watched})
    )
    for service in services:
        for _ in range(effort.cases(10)):
            call(service, _STRANGE)
            for operation in service.contract.operations if service is roaas.subscribers else ():
                if operation.request:
                    call(service, Node(operation.request))


def _answers(service: SoapService) -> frozenset[str]:
    """Tags of the elements with which the operations of a service answer, by the contract and by the robot's word."""
    described = [service.own] if service.own is not None else []
    if service.contract_wsdl_path is not None:
        described.append(service.contract)
    found: set[str] = set()
    for description in described:
        try:
            found |= {operation.response for operation in description.operations if operation.response}
        except DescriptionError:
            continue
    return frozenset(found)
