"""Rules for every SOAP response, whatever the request: an observer judges them over the whole run."""

import pytest

from conformance.api.soap.callable_services import SoapServices, callable_services
from conformance.api.soap.calls import call
from conformance.checkers.soap import PASSIVE
from conformance.documents.xml_names import clark
from conformance.documents.xml_node import Node
from conformance.verdict.effort import Effort

pytestmark = pytest.mark.phase("reach")
_STRANGE = Node(clark("urn:example:strange", "no_such_operation"))


@pytest.mark.requirement(*PASSIVE)
def test_every_answer_is_watched(soap: SoapServices, effort: Effort) -> None:
    """Provoke a fault, and call each operation without arguments; the observer judges every response of the run."""
    for service in callable_services(soap, *PASSIVE):
        for _ in range(effort.cases(10)):
            call(service, _STRANGE)
            for operation in service.contract.operations if service is soap.subscribers else ():
                if operation.request:
                    call(service, Node(operation.request))
