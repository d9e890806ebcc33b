"""Methods: those that a resource has, those that it has not, and how it tells (RFC 9110 9, 10.2.1, 15.5.6)."""

import pytest

from conformance.documents.openapi import Resource, resources_of
from conformance.rest.applicable import reads
from conformance.rest.calls import Call, example_call
from conformance.rest.interface import RestInterface
from conformance.rest.observers import KNOWN_METHODS
from conformance.transport import raw
from conformance.transport.client import HttpClient
from conformance.transport.exchange import Exchange, Unanswered
from conformance.verdict.evidence import Judge

pytestmark = [pytest.mark.phase("reading"), pytest.mark.needs("rest")]
# What a robot might take by mistake: the usual methods, one that only WebDAV knows, and one that nobody knows.
_TRIED = ("GET", "PUT", "POST", "DELETE", "PATCH", "PROPFIND", "FOO")
_ALWAYS_ALLOWED = frozenset({"HEAD", "OPTIONS", "TRACE"})


def _resources(api: RestInterface) -> list[tuple[Resource, Call]]:
    """Each resource with a valid request for it; extensions that this robot lacks are left out."""
    found = []
    for resource in resources_of(api.run.contract):
        first = example_call(api, next(iter(resource.operations.values())))
        # Only the address is used: what has a body or moves is never sent from here.
        call = Call(first.operation, first.values)
        if resource.optional:
            answer = call.send(api, method="GET").response
            if answer.status == 404:
                continue
        found.append((resource, call))
    return found


@pytest.mark.requirement("http/method-not-allowed", "http/allow", "http/allow-agrees")
def test_methods_that_a_resource_has_not(api: RestInterface, judge: Judge) -> None:
    """Each resource refuses each method that the contract does not give it with 405 and Allow."""
    for resource, call in _resources(api):
        for method in api.run.effort.subsample([name for name in _TRIED if name not in resource.methods], 2):
            exchange = call.send(api, method=method)
            status = exchange.response.status
            unknown = method not in KNOWN_METHODS
            judge.check(
                "http/method-not-allowed",
                status == 405 or (unknown and status == 501),
                exchange,
                f"405 for {method}" + (" (or 501)" if unknown else ""),
                found=f"{method} {resource.template} is answered {status}",
                cause=f"{method} {status}",
            )
            if status == 405:
                _judge_allow(judge, "http/allow", resource, exchange)


@pytest.mark.requirement("http/options", "http/allow-agrees")
def test_options(api: RestInterface, judge: Judge) -> None:
    """OPTIONS tells the methods of each resource."""
    for resource, call in _resources(api):
        exchange = call.send(api, method="OPTIONS")
        status = exchange.response.status
        if judge.check("http/options", status in {200, 204}, exchange, "200 or 204 for OPTIONS"):
            _judge_allow(judge, "http/options", resource, exchange)


def _judge_allow(judge: Judge, requirement: str, resource: Resource, exchange: Exchange) -> None:
    """Judge whether Allow is there, and names what the contract gives the resource and nothing else."""
    value = exchange.response.header("allow")
    if not judge.check(requirement, value is not None, exchange, "Allow", found="no Allow field"):
        return
    named = {name.strip() for name in (value or "").split(",")} - {""}
    wanted = set(resource.methods) - _ALWAYS_ALLOWED
    judge.check(
        "http/allow-agrees",
        wanted <= named <= wanted | _ALWAYS_ALLOWED,
        exchange,
        f"Allow: {', '.join(sorted(wanted))} (HEAD and OPTIONS beside them)",
        found=f"Allow: {value}",
        cause=f"{resource.template}",
    )


@pytest.mark.requirement("http/head")
def test_head_is_get_without_its_body(api: RestInterface, judge: Judge) -> None:
    """HEAD has the status and the media type of GET; asked again where the resource may have changed between."""
    for call in reads(api):
        others = [name for name in call.operation.formats if name != "application/json"]
        for accept in ("application/json", *(others if api.run.effort.name != "quick" else ())):
            for attempt in (1, 2, 3):
                got = call.send(api, ("Accept", accept))
                exchange = call.send(api, ("Accept", accept), method="HEAD")
                fault = _difference(got, exchange)
                if not fault or attempt == 3:
                    judge.check("http/head", not fault, exchange, "HEAD as GET", found=fault, cause=call.operation.id)
                    break


def _difference(got: Exchange, exchange: Exchange) -> str:
    """What HEAD says otherwise than GET; empty where they agree."""
    one, two = got.response, exchange.response
    if one.status != two.status:
        return f"HEAD is answered {two.status}, GET {one.status}"
    if two.media_type and one.media_type != two.media_type:
        return f"HEAD says {two.media_type}, GET {one.media_type}"
    if one.ok and one.body and not two.media_type:
        return f"HEAD has no Content-Type, GET has {one.media_type}"
    return ""


@pytest.mark.requirement("http/head-no-body", "http/framing")
def test_head_has_no_body(api: RestInterface, rest: HttpClient, judge: Judge) -> None:
    """Not one octet follows the header section of an answer to HEAD: read from the socket, as clients ignore them."""
    for call in reads(api):
        octets = raw.head(rest, "HEAD", call.path, "Connection: close")
        attempt, surplus = raw.read_one(rest, octets, raw.talk(rest, octets), "HEAD")
        if isinstance(attempt, Unanswered):
            judge.check("http/framing", False, attempt, "a well-framed answer to HEAD")
            continue
        judge.check(
            "http/head-no-body",
            not surplus,
            attempt,
            "nothing behind the header section",
            found=f"{len(surplus)} octets of body in the answer to HEAD {call.operation.template}",
            cause=call.operation.id,
        )
