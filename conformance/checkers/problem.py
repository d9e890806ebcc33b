"""The form of an error response: problem details (RFC 9457), and nothing of the program's inside."""

import re
from collections.abc import Iterator

from conformance.api.rest.problem import JSON, XML, members_of
from conformance.checkers.occasion import METHODS, Occasion
from conformance.documents.openapi import inside_prefix, is_normal
from conformance.documents.representation import UnreadableError, parse_xml
from conformance.documents.traceback import inside_shown, path_shown
from conformance.transport.credentials import WRONG
from conformance.transport.exchange import Response
from conformance.verdict.evidence import Case

_NAMESPACE = "urn:ietf:rfc:7807"
# Statuses that servers, proxies and gateways send before a resource sees the request; 401 is explained by
# WWW-Authenticate.
_TRANSPORT = frozenset({401, 407, 408, 411, 413, 414, 417, 421, 426, 429, 431})
# Path characters that servers refuse, because the application may read them differently: an encoded slash (Apache),
# backslash, percent, control character, a parameter (Tomcat, Jetty, Spring's firewall).
_AMBIGUOUS = re.compile(r"%(?:2f|5c|25|7f|[01][0-9a-f])|[;\\]", re.IGNORECASE)
# The characters of a target (RFC 3986 3.3, 3.4); a target with any other one is malformed (RFC 9112 3.2).
_TARGET = re.compile(r"(?:[A-Za-z0-9._~!$&'()*+,;=:@/?-]|%[0-9A-Fa-f]{2})*")
_ERROR, _NOT_ACCEPTABLE, _SERVER_ERROR, _UNAVAILABLE = 400, 406, 500, 503


def inside(occasion: Occasion) -> Iterator[Case]:
    """Judge that an error shows no traceback, no path of the device's file system, and no other request (CWE-209)."""
    if occasion.response.status >= _ERROR:
        request = occasion.request
        sent = f"{request.url} {request.headers}".encode() + request.body
        if WRONG.encode() in occasion.response.body and WRONG.encode() not in sent and request.raw is None:
            expected, found = "an error that shows nothing of other requests", f"the credentials {WRONG} of another one"
            yield occasion.case("robustness/no-internals", False, expected, found, cause="credentials")  # noqa: FBT003
        # Files and request ids in a response differ from one request to the next.
        inside, path = inside_shown(occasion.exchange), path_shown(occasion.exchange)
        found, cause = f"status {occasion.response.status} with {inside or path!r}", "inside" if inside else "path"
        expected = "an error that shows nothing of the program"
        yield occasion.case("robustness/no-internals", not (inside or path), expected, found, cause=cause)


def same_status(occasion: Occasion) -> Iterator[Case]:
    """Judge that the member `status` of a problem equals the status of its response (RFC 9457 3.1.2)."""
    answer = occasion.response
    if answer.status < _ERROR or answer.media_type not in {JSON, XML} or not answer.body or answer.cut:
        return
    number = (members_of(answer) or {}).get("status")
    if isinstance(number, int) and not isinstance(number, bool):
        expected, found = f"a problem whose status is that of the response, {answer.status}", f"the status {number}"
        cause = f"{answer.status} {number}"
        yield occasion.case("description/problem-status", number == answer.status, expected, found, cause=cause)


def form(occasion: Occasion) -> Iterator[Case]:
    """Judge one response of 400 and above."""
    status, context = occasion.response.status, occasion.context
    if status < _ERROR or status in _TRANSPORT or not context.usual:
        return
    if status >= _SERVER_ERROR and (status != _UNAVAILABLE or context.operation is None):
        return
    media_type = occasion.response.media_type
    if context.is_head and not media_type:
        return
    found = f"status {status} {f'as {media_type}' if media_type else 'without Content-Type'}"
    if _by_server(occasion):
        yield occasion.case(
            "http/problem-type-server",
            media_type in {JSON, XML},
            f"an error as {JSON}, also where the web server generates it",
            found,
            cause=f"{status} {media_type}",
        )
        return
    allowed = [JSON, *([XML] if context.names_xml or status == _NOT_ACCEPTABLE else [])]
    yield occasion.case(
        "http/problem-type",
        media_type in allowed,
        f"an error as {' or '.join(allowed)}",
        found,
        cause=f"{media_type} {context.operation.id if context.operation else 'elsewhere'}",
    )
    if context.likes_xml > context.likes_json and status != _NOT_ACCEPTABLE:
        fault = "" if context.is_head or media_type != XML else _xml_fault(occasion.response)
        yield occasion.case(
            "rest-formats/problem-xml",
            media_type == XML and not fault,
            f"an error as {XML} when Accept prefers XML",
            fault or found,
            cause=fault or media_type,
        )
    if not context.is_head and media_type in {JSON, XML}:
        yield _status(occasion)


def _by_server(occasion: Occasion) -> bool:
    """Return whether a server may have responded before any resource saw the request (contract, errors)."""
    path = occasion.context.target.split("?", 1)[0]
    return (
        occasion.request.method not in METHODS
        or not is_normal(path)
        or bool(_AMBIGUOUS.search(path))
        or not _TARGET.fullmatch(occasion.context.target)
        or not inside_prefix(occasion.contract, path)
        or (occasion.response.status == _NOT_ACCEPTABLE and not occasion.response.body)
    )


def _xml_fault(answer: Response) -> str:
    try:
        root = parse_xml(answer.body)
    except UnreadableError as error:
        return str(error)
    return "" if root.tag == f"{{{_NAMESPACE}}}problem" else f"the root element {root.tag}"


def _status(occasion: Occasion) -> Case:
    status, members = occasion.response.status, members_of(occasion.response)
    stated = None if members is None else members.get("status")
    missing = stated is None and members is not None
    found = "a problem that cannot be read" if members is None else f"a problem whose status is {stated!r}"
    return occasion.case(
        "http/problem-status",
        stated == status and not isinstance(stated, bool),
        f"a problem whose status is that of the response, {status}",
        "a problem without status" if missing else found,
        cause="missing" if missing else type(stated).__name__,
    )
