"""Methods: declared ones, undeclared ones, and the Allow field (RFC 9110 9, 10.2.1, 15.5.6)."""

from typing import cast

import pytest

from conformance.api.expectation import expect
from conformance.api.permission import permitted_methods
from conformance.api.rest import by_hand
from conformance.api.rest.applicable import allows, reads
from conformance.api.rest.calls import JSON, Call, example_call
from conformance.api.rest.inputs import Inputs
from conformance.api.rest.interface import RestInterface
from conformance.documents.openapi import SAFE, Resource, resources_of
from conformance.transport import raw
from conformance.transport.exchange import Attempt, Exchange, NoAnswer, NoAnswerError, Unanswered
from conformance.verdict.evidence import Judge

pytestmark = [pytest.mark.phase("settling"), pytest.mark.needs("rest")]
# These checks come early: an effect of a method can then show while other checks run.
_BEFORE = pytest.mark.phase("motion")
# Methods that a robot might take by mistake; where GET is not allowed, HEAD is not.
_STANDARD = ("GET", "PUT", "POST", "DELETE", "PATCH", "HEAD")
# A method of WebDAV, and one that does not exist: a server may refuse them before any resource sees them.
_UNKNOWN = ("PROPFIND", "FOO")
# How often the lengths of GET and HEAD are compared: the numbers in a resource have more digits or fewer each time.
_LENGTHS = 8


def _resources(api: RestInterface) -> list[tuple[Resource, Call]]:
    """Return each resource with a valid request for it, without optional resources that this robot lacks.

    Each has an operation that may be called.
    """
    found = []
    for resource in resources_of(api.run.contract):
        if not any(allows(api, item) for item in resource.operations.values()):
            continue
        first = _find_call(api, resource) or example_call(api, next(iter(resource.operations.values())))
        # Only the address is used: a request with a body, or one that moves the robot, is never sent from here.
        call = first.bare
        if resource.optional:
            answer = call.send(api, method="GET").response
            if answer.status == 404:
                continue
        found.append((resource, call))
    return found


def _find_call(api: RestInterface, resource: Resource) -> Call | None:
    """Return a request for a resource, with ids of a thing that the survey has found there."""
    own = (api.working[item.label] for item in resource.operations.values() if item.label in api.working)
    if call := next(own, None):
        return cast("Call", call)
    first = next(iter(resource.operations.values()))
    names = {item.name for item in first.parameter("path")}
    for call in api.working.values() if names else ():
        known = {item.name for item in call.operation.parameter("path")}
        if names <= known and resource.template.startswith(call.operation.template.rstrip("/")):
            return Call(first, Inputs(path={name: call.inputs.path[name] for name in names}))
    return None


@_BEFORE
@pytest.mark.requirement("http/method-not-allowed", "http/allow", "http/allow-agrees")
def test_methods_that_a_resource_has_not(api: RestInterface, judge: Judge) -> None:
    """Send to each resource each method that the contract does not define for it: the robot must respond 405.

    A checker judges Allow.
    """
    is_refused = api.run.contract.demands("http/method-not-allowed")
    for resource, call in _resources(api):
        # A further method that the resource allows is the vendor's own, and may do anything: it is not sent.
        there = {*resource.methods, *(("HEAD",) if "GET" in resource.methods else ())}
        # Unless it has to be refused, such a method may act all the same; a safe one does not (RFC 9110 9.2.1).
        there |= _allowed_methods(call.send(api, method="OPTIONS")) if is_refused else set(_STANDARD) - SAFE
        lacking = [name for name in _STANDARD if name not in there]
        sendable = permitted_methods(api.run, api.client, lacking, call.path, "http/method-not-allowed", "http/allow")
        for method in api.run.effort.subsample(sendable, 2):
            exchange = call.send(api, method=method)
            cause = f"{method} {exchange.response.status}"
            expect(judge, "http/method-not-allowed", exchange).status(405, cause=cause)


@_BEFORE
@pytest.mark.requirement("http/unknown-method", "http/unknown-method-refused")
def test_methods_that_nobody_knows(api: RestInterface, judge: Judge) -> None:
    """Send unknown methods, which a server may reject before it looks at the resource."""
    ids = ("http/unknown-method", "http/unknown-method-refused")
    for _, call in api.run.effort.subsample(_resources(api), 2):
        for method in permitted_methods(api.run, api.client, _UNKNOWN, call.path, *ids):
            attempt: Attempt
            try:
                attempt = call.send(api, method=method)
            except NoAnswerError as none:
                if none.kind is not NoAnswer.CLOSED:
                    raise
                attempt = none.unanswered
            expect(judge, "http/unknown-method-refused", attempt).status("4xx", 501, closed=True, cause=method)
            # Unless a contract demands more, the server's parser may answer 400 first.
            refusals = (405, 501) if api.run.contract.demands(ids[1]) else ("4xx", 501)
            expect(judge, "http/unknown-method", attempt).status(*refusals, cause=method)


@pytest.mark.requirement("http/options", "http/allow", "http/allow-agrees", "description/allow")
def test_options(api: RestInterface, judge: Judge) -> None:
    """Send OPTIONS to each resource; a checker judges the methods in Allow."""
    for _, call in _resources(api):
        exchange = call.send(api, method="OPTIONS")
        if expect(judge, "http/options", exchange).status(200, 204):
            expect(judge, "http/options", exchange).header("Allow")
    # A resource that exists now also existed at the earlier request (checkers.resources).
    for call in [call for call in api.working.values() if call.operation.method == "GET"]:
        if call.operation.parameter("path") and call.operation.label not in api.streams:
            call.send(api)


def _allowed_methods(exchange: Exchange) -> set[str]:
    """Return the methods that Allow names."""
    return {name.strip() for name in (exchange.response.header("allow") or "").split(",")} - {""}


def _formats(call: Call, most: int) -> list[str]:
    """Return JSON and ``most`` of the other formats of a GET."""
    return [JSON, *[name for name in call.operation.formats if name != JSON][:most]]


@pytest.mark.requirement("http/head", "http/head-content-type")
def test_head_is_get_without_its_body(api: RestInterface, judge: Judge) -> None:
    """Compare HEAD with GET by status and media type, several times where the resource may have changed between."""
    for call in reads(api):
        for accept in _formats(call, 0 if api.run.effort.name == "quick" else 99):
            for attempt in (1, 2, 3):
                got = call.send(api, ("Accept", accept))
                exchange = call.send(api, ("Accept", accept), method="HEAD")
                if got.response.status == exchange.response.status or attempt == 3:
                    _judge_head(judge, got, exchange, call.operation.id)
                    break


def _judge_head(judge: Judge, got: Exchange, exchange: Exchange, cause: str) -> None:
    one, two = got.response, exchange.response
    expect(judge, "http/head", exchange).status(one.status, when=f"GET gets {one.status}", cause=cause)
    if one.status != two.status or not one.ok:
        return  # another response, such as 404 by a router that knows no HEAD, says nothing of this one
    # A field whose value comes with the content may be left out (RFC 9110 9.3.2).
    expect(judge, "http/head-content-type", exchange).that(
        not two.media_type or one.media_type == two.media_type,
        f"Content-Type: {one.media_type}, as GET gets it, or no Content-Type",
        f"Content-Type: {two.media_type}",
        cause=cause,
    )


@pytest.mark.requirement("http/head-length")
def test_head_says_the_length_of_get(api: RestInterface, judge: Judge) -> None:
    """Compare Content-Length of HEAD, where it comes, with the length of GET, several times where that varies."""
    for call in reads(api):
        # A server may know the length of one format, and guess that of another.
        for accept in _formats(call, 0 if api.run.effort.slow else 1):
            _judge_head_length(api, judge, call, accept)


def _judge_head_length(api: RestInterface, judge: Judge, call: Call, accept: str) -> None:
    lengths: set[int] = set()
    for attempt in range(_LENGTHS):
        got = call.send(api, ("Accept", accept)).response
        exchange = call.send(api, ("Accept", accept), method="HEAD")
        after = call.send(api, ("Accept", accept)).response
        lengths |= {len(got.octets), len(after.octets)}
        said = exchange.response.header("content-length")
        same = got.status == exchange.response.status == after.status
        right = said is None or (said.isdigit() and min(lengths) <= int(said) <= max(lengths))
        if right or (attempt == _LENGTHS - 1 and same):
            expected = f"Content-Length: {min(lengths)}, as GET gets it, or no Content-Length"
            cause = f"{call.operation.id} {accept}"
            expect(judge, "http/head-length", exchange).that(right, expected, f"Content-Length: {said}", cause=cause)
            break
        if not got.ok or got.status == after.status != exchange.response.status:
            break  # such as 405, or 404 by a router that knows no HEAD: another response, of another length


@pytest.mark.requirement("http/head-no-body", "http/framing")
def test_head_has_no_body(api: RestInterface, judge: Judge) -> None:
    """Read responses to HEAD from the socket, as client libraries ignore octets behind the header section."""
    for call in reads(api):
        octets = raw.head(api.client, "HEAD", call.path, "Connection: close")
        attempt, surplus = raw.read_one(api.client, octets, by_hand.talk(api, octets), "HEAD")
        if isinstance(attempt, Unanswered):
            # Silence is no response that is badly framed.
            if attempt.kind is not NoAnswer.TIMEOUT:
                expect(judge, "http/framing", attempt).that(False, "a well-framed response to HEAD")
            continue
        expected, found = "nothing after the header section", f"{len(surplus)} bytes after it"
        expect(judge, "http/head-no-body", attempt).that(not surplus, expected, found, cause=call.operation.id)
