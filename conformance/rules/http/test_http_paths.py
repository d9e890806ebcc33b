"""Targets: unknown paths, trailing slashes, and targets and fields that are too long."""

from functools import partial

import pytest

from conformance.api.expectation import expect
from conformance.api.permission import permitted_methods
from conformance.api.rest import by_hand
from conformance.api.rest.applicable import reads
from conformance.api.rest.calls import JSON, example_call
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.statuses import usual_status
from conformance.documents.openapi import inside_prefix, known_path, resources_of
from conformance.transport import raw
from conformance.transport.client import HttpClient
from conformance.transport.exchange import Attempt, Exchange, NoAnswer, NoAnswerError
from conformance.transport.reach import joined, path_of
from conformance.verdict.evidence import Judge

pytestmark = [pytest.mark.phase("settling"), pytest.mark.needs("rest")]
_METHODS = ("GET", "HEAD", "PUT", "POST", "DELETE", "OPTIONS", "PATCH")
_STRANGE = "roaas-nobody-has-this"
_PATHS = 40
_LONG_TARGETS = (9_000, 70_000)
_TARGET_TAKEN = 8_000
_LONG_FIELD = 128 * 1024


def _unknown_paths(api: RestInterface) -> list[str]:
    """Return paths that are similar to the contract's, and match none of them."""
    literal = [item.template for item in resources_of(api.run.contract) if "{" not in item.template]
    near = [f"/{_STRANGE}", f"/{_STRANGE}/"]
    near += [path.rstrip("/") + f"/{_STRANGE}/" for path in literal[:4]]
    near += ["/".join([*path.strip("/").split("/")[:-1], _STRANGE]) for path in literal[:2]]
    paths = [path if path.startswith("/") else f"/{path}" for path in near]
    return [path for path in dict.fromkeys(paths) if not known_path(api.run.contract, path)]


@pytest.mark.requirement(
    "http/not-found",
    "http/problem-type",
    "http/problem-type-server",
    "http/problem-status",
    "http/no-traceback",
    "rest-formats/problem-xml",
)
def test_unknown_paths(api: RestInterface, rest: HttpClient, judge: Judge) -> None:
    """Send each method to unknown paths; the checkers judge the problem documents."""
    paths = _unknown_paths(api)
    for path in api.run.effort.draw(paths, _PATHS, f"{api.run.seed}/unknown paths"):
        for method in api.run.effort.subsample(permitted_methods(api.run, rest, _METHODS, path), 3):
            exchange = rest.send(method, path)
            status = exchange.response.status
            # Outside the contract's paths another server may answer, in front of the robot.
            refused = 400 <= status < 500 and not inside_prefix(api.run.contract, path)
            expect(judge, "http/not-found", exchange).status(
                404,
                when="the path is unknown",
                or_else=refused or _leads_nowhere(api, exchange),
                cause=f"{method} {status}",
            )
        rest.send("GET", path, headers=[("Accept", "application/xml")])


def _leads_nowhere(api: RestInterface, exchange: Exchange) -> bool:
    """Return whether a response redirects outside the base URL or to another unknown path."""
    location = exchange.response.header("location")
    if exchange.response.status not in {301, 302, 303, 307, 308} or location is None:
        return False
    target = joined(exchange.request.url, location)
    path = path_of(target).removeprefix(api.client.prefix)
    return not target.startswith(api.client.base_url) or not known_path(api.run.contract, path)


@pytest.mark.requirement("http/trailing-slash")
def test_trailing_slash(api: RestInterface, rest: HttpClient, judge: Judge) -> None:
    """Cut the trailing slash off a path: the rest is unknown, or redirects to the right path."""
    ending = [item for item in resources_of(api.run.contract) if item.template.endswith("/") and len(item.template) > 1]
    tried = 0
    for resource in ending:
        operation = resource.operations.get("GET")
        if operation is None or operation.optional:
            continue
        path = example_call(api, operation).path.split("?", 1)[0]
        cut = path.rstrip("/")
        if known_path(api.run.contract, cut):
            continue
        tried += 1
        exchange = rest.send("GET", cut)
        status = exchange.response.status
        right = status == 404 or (status in {301, 307, 308} and _leads_to(exchange, rest.prefix + path))
        location = exchange.response.header("location")
        expected = f"status 404, or a redirect (301, 307, 308) to {path}"
        got = f"status {status}" + (f" to {location}" if location else "")
        expect(judge, "http/trailing-slash", exchange).that(right, expected, got, cause=f"{status}")
    if not tried:
        judge.note_unclaimed("http/trailing-slash", "the contract has no path with a trailing slash to cut")


def _leads_to(exchange: Exchange, path: str) -> bool:
    location = exchange.response.header("location")
    return location is not None and path_of(joined(exchange.request.url, location)) == path


@pytest.mark.requirement("http/uri-too-long", "http/declared-body")
def test_long_targets(api: RestInterface, rest: HttpClient, judge: Judge) -> None:
    """Send long targets: the robot must accept or reject them, and still serve the next request."""
    judge.at_risk = ("http/uri-too-long",)
    for call in [call for call in reads(api) if not call.operation.optional]:
        usual = usual_status(partial(call.send, api))
        mark = "&" if "?" in call.path else "?"
        for length in _LONG_TARGETS:
            path = f"{call.path}{mark}roaas={'a' * length}"
            exchange: Exchange | None = None
            for second in (False, True):
                try:
                    exchange = rest.send("GET", path, fresh=True)
                    break
                except NoAnswerError as none:
                    # A server that refuses in the middle of a long head may lose the response with the connection
                    # (RFC 9112 9.6).
                    if none.kind is not NoAnswer.CLOSED or (second and length == min(_LONG_TARGETS)):
                        raise
            if exchange is not None:
                when = f"the target has {len(path):,} bytes"
                expect(judge, "http/uri-too-long", exchange).status(414, 400, 431, usual, when=when)
        again = call.send(api, fresh=True)
        expect(judge, "http/uri-too-long", again).status(usual, when="the request follows one with a long target")


@pytest.mark.requirement("web-server/header-too-large")
def test_large_field(api: RestInterface, judge: Judge) -> None:
    """Send a field of 128 KiB: the robot refuses it, closes the connection or ignores it, and never fails with 5xx."""
    judge.at_risk = ("web-server/header-too-large",)
    for call in [call for call in reads(api) if not call.operation.optional][:3]:
        usual = usual_status(partial(call.send, api))
        attempt: Attempt
        try:
            attempt = call.send(api, ("X-Roaas", "a" * _LONG_FIELD), fresh=True)
        except NoAnswerError as none:
            if none.kind is not NoAnswer.CLOSED:
                raise
            attempt = none.unanswered
        when = f"a field has {_LONG_FIELD:,} bytes"
        expect(judge, "web-server/header-too-large", attempt).status(431, 400, 413, usual, when=when, closed=True)


@pytest.mark.requirement("web-server/target-length")
def test_targets_of_8000_octets(api: RestInterface, rest: HttpClient, judge: Judge) -> None:
    """Send a target of 8,000 octets where the robot takes a short one: RECOMMENDED (RFC 9110 4.1)."""
    if rest.connection.credentials.repeats_target:
        judge.note_unclaimed(
            "http/target-length", "a digest repeats the target in a header, whose size may have a limit"
        )
        return
    for call in [call for call in reads(api) if not call.operation.optional]:
        path = f"{call.path}{'&' if '?' in call.path else '?'}roaas="
        usual = usual_status(partial(rest.send, "GET", f"{path}a"))
        exchange = rest.send("GET", path + "a" * (_TARGET_TAKEN - len(rest.prefix) - len(path)))
        when = f"the target has {_TARGET_TAKEN:,} bytes, as with a short one"
        expect(judge, "web-server/target-length", exchange).status(usual, when=when)


@pytest.mark.requirement("web-server/absolute-form")
def test_absolute_form(api: RestInterface, rest: HttpClient, judge: Judge) -> None:
    """Send targets with scheme and authority (RFC 9112 3.2.2)."""
    for call in reads(api):
        usual = usual_status(partial(call.send, api, ("Accept", JSON)))
        head = raw.head(rest, "GET", call.path, f"Accept: {JSON}", "Connection: close")
        absolute = head.replace(b" ", f" {rest.scheme}://{rest.authority}".encode(), 1)
        attempt = by_hand.ask_octets(api, absolute)
        when = "the target has scheme and authority, as without them"
        expect(judge, "web-server/absolute-form", attempt).status(usual, when=when, cause=attempt.came)
