"""Methods: those that a resource has, those that it has not, and how it tells (RFC 9110 9, 10.2.1, 15.5.6)."""

import pytest

from conformance.api.rest import by_hand
from conformance.api.rest.applicable import reads
from conformance.api.rest.calls import JSON, Call, example_call
from conformance.api.rest.interface import RestInterface
from conformance.documents.openapi import Resource, resources_of
from conformance.transport import raw
from conformance.transport.client import HttpClient
from conformance.transport.exchange import Exchange, NoAnswer, NoAnswerError, Unanswered
from conformance.verdict.evidence import Judge

pytestmark = [pytest.mark.phase("reading"), pytest.mark.needs("rest")]
# What a robot might take by mistake; where GET is not allowed, HEAD is not.
_STANDARD = ("GET", "PUT", "POST", "DELETE", "PATCH", "HEAD")
# A method that only WebDAV knows, and one that nobody knows: a server answers them before any resource sees them.
_UNKNOWN = ("PROPFIND", "FOO")
# So often GET's length is compared before HEAD is wrong: numbers have more digits or fewer each time.
_LENGTHS = 8
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
        there = {*resource.methods, *(("HEAD",) if "GET" in resource.methods else ())}
        for method in api.run.effort.subsample([name for name in _STANDARD if name not in there], 2):
            exchange = call.send(api, method=method)
            status = exchange.response.status
            judge.check(
                "http/method-not-allowed",
                status == 405,
                exchange,
                f"405 for {method}",
                found=f"{method} {resource.template} is answered {status}",
                cause=f"{method} {status}",
            )
            if status == 405:
                _judge_allow(judge, "http/allow", resource, exchange)


@pytest.mark.requirement("http/unknown-method", "http/unknown-method-refused")
def test_methods_that_nobody_knows(api: RestInterface, judge: Judge) -> None:
    """What no resource has is refused, by whoever reads it first."""
    for resource, call in api.run.effort.subsample(_resources(api), 2):
        for method in _UNKNOWN:
            expected, cause = f"501 or 405 for {method}", method
            try:
                exchange = call.send(api, method=method)
            except NoAnswerError as none:
                if none.kind is not NoAnswer.CLOSED:
                    raise
                judge.check("http/unknown-method-refused", True, none.unanswered, expected)
                judge.check("http/unknown-method", False, none.unanswered, expected, cause=cause)
                continue
            status = exchange.response.status
            found = f"{method} {resource.template} is answered {status}"
            refused = 400 <= status < 500 or status == 501
            judge.check(
                "http/unknown-method-refused", refused, exchange, "4xx or 501 for " + method, found=found, cause=cause
            )
            judge.check("http/unknown-method", status in {405, 501}, exchange, expected, found=found, cause=cause)


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


@pytest.mark.requirement("http/head", "http/head-content-type")
def test_head_is_get_without_its_body(api: RestInterface, judge: Judge) -> None:
    """HEAD has the status of GET, and its media type; asked again where the resource may have changed between."""
    for call in reads(api):
        others = [name for name in call.operation.formats if name != "application/json"]
        for accept in ("application/json", *(others if api.run.effort.name != "quick" else ())):
            for attempt in (1, 2, 3):
                got = call.send(api, ("Accept", accept))
                exchange = call.send(api, ("Accept", accept), method="HEAD")
                if got.response.status == exchange.response.status or attempt == 3:
                    _judge_head(judge, got, exchange, call.operation.id)
                    break


def _judge_head(judge: Judge, got: Exchange, exchange: Exchange, cause: str) -> None:
    one, two = got.response, exchange.response
    judge.check(
        "http/head",
        one.status == two.status,
        exchange,
        f"the status of GET, {one.status}",
        found=f"HEAD is answered {two.status}",
        cause=cause,
    )
    # A field whose value comes with the content may be left out (RFC 9110 9.3.2).
    judge.check(
        "http/head-content-type",
        not two.media_type or one.media_type == two.media_type,
        exchange,
        f"the media type of GET, {one.media_type}",
        found=f"HEAD says {two.media_type}",
        cause=cause,
    )


@pytest.mark.requirement("http/head-length")
def test_head_says_the_length_of_get(api: RestInterface, judge: Judge) -> None:
    """Content-Length of HEAD, where it comes, is that of GET; asked again where the length of GET is not steady."""
    for call in reads(api):
        others = [name for name in call.operation.formats if name != JSON]
        # A server may know the length of one format, and guess that of another.
        for accept in (JSON, *others[: 0 if api.run.effort.slow else 1]):
            _judge_head_length(api, judge, call, accept)


def _judge_head_length(api: RestInterface, judge: Judge, call: Call, accept: str) -> None:
    lengths: set[int] = set()
    for attempt in range(_LENGTHS):
        got = call.send(api, ("Accept", accept)).response
        exchange = call.send(api, ("Accept", accept), method="HEAD")
        after = call.send(api, ("Accept", accept)).response
        lengths |= {len(got.body), len(after.body)}
        said = exchange.response.header("content-length")
        same = got.status == exchange.response.status == after.status
        right = said is None or (said.isdigit() and min(lengths) <= int(said) <= max(lengths))
        if right or (attempt == _LENGTHS - 1 and same):
            judge.check(
                "http/head-length",
                right,
                exchange,
                f"Content-Length {min(lengths)}, as GET, or none",
                found=f"Content-Length: {said}",
                cause=f"{call.operation.id} {accept}",
            )
            break


@pytest.mark.requirement("http/head-no-body", "http/framing")
def test_head_has_no_body(api: RestInterface, rest: HttpClient, judge: Judge) -> None:
    """Not one octet follows the header section of an answer to HEAD: read from the socket, as clients ignore them."""
    for call in reads(api):
        octets = raw.head(rest, "HEAD", call.path, "Connection: close")
        attempt, surplus = raw.read_one(rest, octets, by_hand.talk(api, octets), "HEAD")
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
