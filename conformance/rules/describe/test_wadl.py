"""/application.wadl: served, well-formed, and with the contract's resources (paper, REST; contract, describe)."""

import pytest

from conformance.api.expectation import expect
from conformance.api.rest.calls import example_call
from conformance.api.rest.description import Described, described_by_wadl, differences
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.presence import judge_there
from conformance.documents.openapi import operations_of
from conformance.documents.representation import UnreadableError
from conformance.transport.client import HttpClient
from conformance.transport.exchange import Exchange
from conformance.verdict.evidence import Judge

pytestmark = [pytest.mark.phase("settling"), pytest.mark.needs("rest")]
_PATH = "/application.wadl"
_BEHAVIOUR = "describe/wadl-behaviour"
_IDS = ("describe/wadl", "describe/wadl-resources", _BEHAVIOUR)
_BESIDE = frozenset({"HEAD", "OPTIONS", ""})  # methods that a WADL may add to a resource's own, as Jersey does
_MEDIA_TYPES = {"application/vnd.sun.wadl+xml", "application/wadl+xml", "application/xml", "text/xml"}


def _without(api: RestInterface) -> bool:
    """Return whether the contract has no WADL, and mark the requirements as not applicable then."""
    if api.run.contract.wadl_path is not None:
        return False
    for id_ in _IDS:
        api.run.judge.note_unclaimed(id_, "the contract has no WADL")
    return True


def _read(rest: HttpClient) -> tuple[list[Described], Exchange, str]:
    """Return the WADL's operations, the exchange that fetched it, and what is wrong with it."""
    exchange = rest.send("GET", _PATH)
    answer = exchange.response
    if answer.status != 200:
        return [], exchange, exchange.came
    if answer.media_type not in _MEDIA_TYPES:
        return [], exchange, "another media type than that of WADL or XML"
    try:
        return described_by_wadl(answer.body, rest.base_url), exchange, ""
    except UnreadableError as error:
        return [], exchange, str(error)


@pytest.mark.requirement("describe/wadl")
def test_wadl_is_served(api: RestInterface, rest: HttpClient, judge: Judge) -> None:
    """GET the WADL: the robot must serve a WADL application."""
    if _without(api):
        return
    _, exchange, fault = _read(rest)
    expect(judge, "describe/wadl", exchange).that(not fault, "status 200 with a well-formed WADL", fault)


@pytest.mark.requirement("describe/wadl-resources")
def test_wadl_has_the_resources(api: RestInterface, rest: HttpClient, judge: Judge) -> None:
    """Compare the WADL's resources, methods and parameters with the contract's; it may have more."""
    if _without(api):
        return
    found, exchange, fault = _read(rest)
    missing = [fault] if fault else differences(operations_of(api.run.contract), found)
    expected = "a WADL with the resources, methods and parameters of the contract"
    expect(judge, "describe/wadl-resources", exchange).that(not missing, expected, "; ".join(missing[:3]))


@pytest.mark.requirement(_BEHAVIOUR)
def test_what_is_described_is_there(api: RestInterface, rest: HttpClient) -> None:
    """Send a request for each operation of the WADL: it does not get 404 or 405."""
    if _without(api):
        return
    known = {Described(item, item.template).address: item for item in operations_of(api.run.contract)}
    for item in _read(rest)[0]:
        ours = known.get(item.address)
        if ours is not None and not ours.optional:
            judge_there(api, _BEHAVIOUR, example_call(api, ours))
        elif ours is None and item.path == item.operation.template and item.operation.method not in _BESIDE:
            judge_there(api, _BEHAVIOUR, example_call(api, item.operation), known=False)
