"""The WSDL of each SOAP service: served with all that it refers to, and the same as the contract."""

from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass
from functools import partial

import pytest

from conformance.api.expectation import expect
from conformance.api.soap import comparison
from conformance.api.soap.callable_services import SoapServices, repetitions
from conformance.api.soap.envelope import EMPTY
from conformance.api.soap.published_wsdl import get
from conformance.api.soap.service import NO_SERVICE, SoapService
from conformance.api.soap.wsdl_rules import RULES
from conformance.documents.wsdl import Wsdl, WsdlError, describe, is_http, name, unusable
from conformance.documents.xml import WSDL_SOAP, clark
from conformance.transport.client import HttpClient
from conformance.transport.exchange import Attempt, Exchange, NoAnswerError
from conformance.transport.reach import Trust, is_same, split
from conformance.verdict.effort import Effort
from conformance.verdict.evidence import Judge

pytestmark = pytest.mark.phase("settling")
_WHOLE = "a WSDL with all that it refers to"
_COMPARED: dict[str, tuple[Callable[[Wsdl, Wsdl], Iterator[str]], str]] = {
    "wsdl-names": (comparison.names, "a WSDL with the names of the contract"),
    "wsdl-operations": (comparison.operations, "a WSDL with the operations of the contract"),
    "wsdl-types": (comparison.types, "a WSDL with the types of the contract"),
    "wsdl-action": (comparison.actions, "a wsam:Action in a form that the contract allows"),
}


@dataclass(frozen=True)
class _Served:
    """The description that a robot serves, the request for it, and what is wrong with it."""

    exchange: Exchange
    description: Wsdl | None
    problem: str


def _services(soap: SoapServices, *ids: str) -> list[SoapService]:
    """Return the services of the contract, including the one that moves the robot: reading its WSDL is harmless."""
    found = []
    for service in (soap.publishers, soap.subscribers):
        if service is None or service.contract_wsdl_path is None:
            continue
        if service.name in soap.run.unreachable:
            for id_ in ids:
                soap.run.judge.skip(
                    id_, f"the {service.name} interface does not answer: {soap.run.unreachable[service.name]}"
                )
            continue
        found.append(service)
    if not found:
        pytest.skip("no SOAP service that answers has an address and a contract")
    return found


def _get_wsdl(service: SoapService) -> _Served:
    """Get the description from its address in the statement, else from ?wsdl at the endpoint."""
    source = service.published.url or f"{service.endpoint}?wsdl"
    exchange = get(source, service.client.connection)
    answer = exchange.response
    if answer.status != 200:
        return _Served(exchange, None, exchange.came)
    if "xml" not in answer.media_type:
        return _Served(exchange, None, "a document that is not XML")
    try:
        description = describe(answer.body, source, service.fetch)
    except WsdlError as error:
        return _Served(exchange, None, str(error))
    missing = [(place, why) for place, why in description.documents.missing.items() if is_same(place, source)]
    # A missing document of another host matters only if the description uses something from it.
    problem = next((f"a reference to {place}: {why}" for place, why in missing), "") or next(unusable(description), "")
    return _Served(exchange, description, problem)


def _read(service: SoapService, judge: Judge, *ids: str) -> tuple[Wsdl | None, Exchange]:
    """Return the description and its exchange; one that cannot be read is a finding of ``describe/wsdl`` alone."""
    served = _get_wsdl(service)
    if served.description is None:
        expect(judge, "describe/wsdl", served.exchange).that(False, _WHOLE, served.problem)
        for id_ in ids:
            judge.skip(id_, f"the WSDL of the {service.name} service could not be read: {served.problem}")
    return served.description, served.exchange


@pytest.mark.requirement("describe/wsdl")
def test_served(soap: SoapServices, judge: Judge, effort: Effort) -> None:
    """Get the description, and everything that it refers to."""
    for service in _services(soap, "describe/wsdl"):
        for _ in range(repetitions(effort, 6)):
            served = _get_wsdl(service)
            expect(judge, "describe/wsdl", served.exchange).that(not served.problem, _WHOLE, served.problem)


@pytest.mark.requirement("describe/wsdl", *(f"describe/{name_}" for name_ in _COMPARED))
def test_same_as_contract(soap: SoapServices, judge: Judge, effort: Effort) -> None:
    """Compare names, operations, types and actions with the contract's."""
    ids = [f"describe/{name_}" for name_ in _COMPARED]
    for service in _services(soap, *ids):
        for _ in range(repetitions(effort, 3)):
            description, exchange = _read(service, judge, *ids)
            if description is None:
                continue
            for name_, (compare, expected) in _COMPARED.items():
                problem = next(_violations(partial(compare, service.contract), description), "")
                expect(judge, f"describe/{name_}", exchange).that(not problem, expected, problem)


# Not while the robot settles after the last POST: the check before this one started that time.
@pytest.mark.phase("resting")
@pytest.mark.requirement("describe/wsdl", "describe/wsdl-address")
def test_address(soap: SoapServices, judge: Judge) -> None:
    """Send a request to each address that the description names."""
    for service in _services(soap, "describe/wsdl-address"):
        description, read = _read(service, judge, "describe/wsdl-address")
        if description is None:
            continue
        ports = description.all("w:service/w:port[s:address]")
        located = [(name(port), port.find(clark(WSDL_SOAP, "address"))) for port in ports]
        if not located:
            got = "a WSDL without soap:address"
            expect(judge, "describe/wsdl-address", read).that(False, "a WSDL with a soap:address", got)
        for port, element in located:
            location = (element.get("location") if element is not None else None) or ""
            exchange, problem = _answers(service, location)
            expect(judge, "describe/wsdl-address", exchange or read).that(
                not problem, f"a service at the soap:address {location!r} of port {port}", problem
            )


def _answers(service: SoapService, location: str) -> tuple[Attempt | None, str]:
    """Send a message with an empty Body, which has no effect, to an address; return the exchange and its fault.

    Without permission to move the robot, GET is sent instead to what is not known to only read, and any response will
    do: a service need not have GET.
    """
    if not is_http(location):
        return None, "an address that is no http URL"
    trust = service.client.connection.trust or Trust.of(service.endpoint)
    if reason := trust.refusal(location):
        return None, f"an address to which nothing was sent: {reason}"
    base, path = split(trust.place(location))
    try:
        with closing(HttpClient(base, service.client.connection)) as client:
            if client.refusal("POST", path):
                return client.send("GET", path), ""
            exchange = client.send(
                "POST", path, headers=(("Content-Type", "text/xml; charset=utf-8"), ("SOAPAction", '""')), body=EMPTY
            )
    except NoAnswerError as none:
        return none.unanswered, str(none)
    status = exchange.response.status
    return exchange, f"status {status} for POST" if status in NO_SERVICE else ""


@pytest.mark.requirement("describe/wsdl", *(f"describe/wsdl-{rule}" for rule in RULES))
def test_profile(soap: SoapServices, judge: Judge, effort: Effort) -> None:
    """Check the description by the rules of the Basic Profile."""
    ids = [f"describe/wsdl-{rule}" for rule in RULES]
    for service in _services(soap, *ids):
        for _ in range(repetitions(effort, 3)):
            description, exchange = _read(service, judge, *ids)
            if description is None:
                continue
            for rule, check in RULES.items():
                problem = next(_violations(check, description), "")
                expected = f"a WSDL that meets rule {rule} of the WS-I Basic Profile"
                expect(judge, f"describe/wsdl-{rule}", exchange).that(not problem, expected, problem)


def _violations(check: Callable[[Wsdl], Iterator[str]], description: Wsdl) -> Iterator[str]:
    """Yield the violations that a check finds; a description too broken for the check is a violation as well."""
    try:
        yield from check(description)
    except WsdlError as error:
        yield str(error)
