"""Send messages without valid credentials, which must be refused, and messages for the SOAP checkers."""

from contextlib import closing
from dataclasses import replace

import pytest

from conformance.api.expectation import expect
from conformance.api.soap.callable_services import SoapServices, callable_services
from conformance.api.soap.calls import call
from conformance.api.soap.envelope import envelope
from conformance.api.soap.service import MEDIA_TYPE
from conformance.api.soap.valid_messages import quiet_example
from conformance.checkers.soap import PASSIVE
from conformance.documents.xml import Node, clark
from conformance.transport.client import HttpClient
from conformance.verdict.effort import Effort
from conformance.verdict.evidence import Judge

_ID = "soap-basic-profile/authentication"


@pytest.mark.requirement(_ID)
def test_messages_without_credentials(soap: SoapServices, judge: Judge) -> None:
    """Send a valid message to each service without credentials and with wrong ones: status 401."""
    for service in callable_services(soap, _ID):
        connection = service.client.connection
        if not connection.credentials:
            judge.note_unclaimed(_ID, "the run has no credentials")
            return
        good = quiet_example(service)
        if good is None:
            judge.note(_ID, f"the {service.name} service took none of the messages tried")
            continue
        stranger = replace(connection, token=None, credentials=connection.credentials.wrong, is_patient=False)
        with closing(HttpClient(service.client.base_url, stranger)) as unknown:
            for what, client, authorized in (("missing", service.client, False), ("wrong", unknown, True)):
                exchange = client.send(
                    "POST",
                    service.path,
                    headers=(("Content-Type", MEDIA_TYPE), ("SOAPAction", '""')),
                    body=envelope([good[1]]).serialize(),
                    authorized=authorized,
                    fresh=True,
                )
                expect(judge, _ID, exchange).status(401, when=f"the credentials are {what}")


_STRANGE = Node(clark("urn:example:strange", "no_such_operation"))


@pytest.mark.phase("reach")
@pytest.mark.requirement(*PASSIVE)
def test_every_answer_is_watched(soap: SoapServices, effort: Effort) -> None:
    """Provoke a fault, and call each operation without arguments; the checkers judge every response of the run."""
    for service in callable_services(soap, *PASSIVE):
        for _ in range(effort.cases(10)):
            call(service, _STRANGE)
            for operation in service.contract.operations if service is soap.subscribers else ():
                if operation.request:
                    call(service, Node(operation.request))
