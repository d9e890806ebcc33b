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
    """Judge Allow where a device refuses a method that its description does not have."""
    method, is_refused = occasion.request.method, occasion.response.status == HTTPStatus.METHOD_NOT_ALLOWED
    is_own = (
        occasion.contract.described
        and occasion.context.usual
        and occasion.operation is None
        and method not in _OF_SERVERS
    )
    if not (is_refused and is_own):
        return
    resource = resource_at(occasion.contract, occasion.context.target.split("?", 1)[0])
    if resource is None:
        return
    said = occasion.response.header("allow")
    yield occasion.case("http/allow", said is not None, "the header field Allow", "no header field Allow")
    if said is None:
        return
    named, wanted = {name.strip() for name in said.split(",")}, set(resource.methods) - _ALWAYS_ALLOWED
    yield occasion.case(
        "http/allow-agrees",
        wanted <= named and method not in named,
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
