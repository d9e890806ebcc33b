"""What a refusal says: which methods there are instead, or which credentials are wanted (RFC 9110 10.2.1, 11.6.1)."""

from collections.abc import Iterator
from http import HTTPStatus

from conformance.checkers.occasion import Occasion
from conformance.documents.resources import resource_at
from conformance.verdict.case import Case

# Methods that a server in front may refuse itself, without a word of the resource.
_OF_SERVERS = frozenset({"TRACE", "CONNECT"})
_ALWAYS_ALLOWED = frozenset({"HEAD", "OPTIONS", "TRACE"})


def allow(occasion: Occasion) -> Iterator[Case]:
    """Judge Allow where a device refuses a method that its description does not have, or answers OPTIONS."""
    method, response = occasion.request.method, occasion.response
    is_refused = response.status == HTTPStatus.METHOD_NOT_ALLOWED and occasion.operation is None
    is_asked = method == "OPTIONS" and response.ok
    if not (is_refused or is_asked) or not occasion.context.usual or method in _OF_SERVERS:
        return
    resource = resource_at(occasion.contract, occasion.context.target.split("?", 1)[0])
    if resource is None:
        return
    said = response.header("allow")
    if is_refused:
        yield occasion.case("http/allow", said is not None, "the header field Allow", "no header field Allow")
    if said is None:
        return
    named, wanted = {name.strip() for name in said.split(",")} - {""}, set(resource.methods) - _ALWAYS_ALLOWED
    besides = f"{', '.join(sorted(named - wanted - _ALWAYS_ALLOWED))} besides"
    declared = f"Allow: {', '.join(sorted(wanted))}, as declared"
    yield occasion.case("description/allow", named <= wanted | _ALWAYS_ALLOWED, declared, besides, cause=besides)
    refused = {method} - _ALWAYS_ALLOWED if is_refused else set()
    yield occasion.case(
        "http/allow-agrees",
        wanted <= named and not refused & named,
        f"Allow: {', '.join(sorted(wanted))} (others may stand beside them, but none that got 405)",
        f"Allow: {said}",
        cause="methods left out",
    )


def challenge(occasion: Occasion) -> Iterator[Case]:
    """Judge that 401 names the credentials that are wanted (RFC 9110 15.5.2)."""
    if occasion.response.status == HTTPStatus.UNAUTHORIZED:
        there = occasion.response.header("www-authenticate") is not None
        name = "WWW-Authenticate"
        yield occasion.case("http/authentication", there, f"the header field {name}", f"no header field {name}")
