"""Problem details (RFC 9457): the form of an error response."""

import re
from typing import Any

from conformance.api.expectation import expect
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.request_context import RequestContext
from conformance.documents.json_text import read_json
from conformance.documents.representation import UnreadableError, local_name, parse_xml
from conformance.documents.resources import inside_prefix, is_normal
from conformance.transport.exchange import Exchange, Response

JSON = "application/problem+json"
XML = "application/problem+xml"
#: Methods that every server knows; a request with another one may never reach a resource.
STANDARD_METHODS = frozenset({"GET", "HEAD", "PUT", "POST", "DELETE", "OPTIONS", "PATCH"})
_NAMESPACE = "urn:ietf:rfc:7807"
# Statuses that servers, proxies and gateways send before a resource sees the request; and 401, which has its field.
_TRANSPORT = frozenset({401, 407, 408, 411, 413, 414, 417, 421, 426, 429, 431})
# What servers refuse in a path, because they and the application may read it differently: an encoded slash
# (Apache), backslash, percent, control character, a parameter (Tomcat, Jetty, Spring's firewall).
_AMBIGUOUS = re.compile(r"%(?:2f|5c|25|7f|[01][0-9a-f])|[;\\]", re.IGNORECASE)
# The characters of a target (RFC 3986 3.3, 3.4); a target with any other one is malformed (RFC 9112 3.2).
_TARGET = re.compile(r"(?:[A-Za-z0-9._~!$&'()*+,;=:@/?-]|%[0-9A-Fa-f]{2})*")
_NOT_ACCEPTABLE = 406
_SERVER_ERROR = 500
_UNAVAILABLE = 503


def judge(api: RestInterface, exchange: Exchange, answer: Response, context: RequestContext) -> None:
    """Judge one response of 400 and above."""
    status = answer.status
    if status in _TRANSPORT or not context.usual or (status >= _SERVER_ERROR and status != _UNAVAILABLE):
        return
    if status == _UNAVAILABLE and context.operation is None:
        return
    if context.is_head and not answer.media_type:
        return
    media_type = answer.media_type
    found = f"status {status} {f'as {media_type}' if media_type else 'without Content-Type'}"
    if _by_server(api, context, answer):
        expect(api.run.judge, "http/problem-type-server", exchange).that(
            media_type in {JSON, XML},
            f"an error as {JSON}, also where the web server generates it",
            found,
            cause=f"{status} {media_type}",
        )
        return
    allowed = [JSON, *([XML] if context.names_xml or status == _NOT_ACCEPTABLE else [])]
    expect(api.run.judge, "http/problem-type", exchange).that(
        media_type in allowed,
        f"an error as {' or '.join(allowed)}",
        found,
        cause=f"{media_type} {context.operation.id if context.operation else 'elsewhere'}",
    )
    if context.likes_xml > context.likes_json and status != _NOT_ACCEPTABLE:
        fault = "" if context.is_head or media_type != XML else _xml_fault(answer)
        expect(api.run.judge, "rest-formats/problem-xml", exchange).that(
            media_type == XML and not fault,
            f"an error as {XML} when Accept prefers XML",
            fault or found,
            cause=fault or media_type,
        )
    if not context.is_head and media_type in {JSON, XML}:
        _judge_status(api, exchange, answer)


def _by_server(api: RestInterface, context: RequestContext, answer: Response) -> bool:
    """Return whether a server may have responded before any resource saw the request (contract, errors)."""
    path = context.target.split("?", 1)[0]
    return (
        context.request.method not in STANDARD_METHODS
        or not is_normal(path)
        or bool(_AMBIGUOUS.search(path))
        or not _TARGET.fullmatch(context.target)
        or not inside_prefix(api.run.contract, path)
        or (answer.status == _NOT_ACCEPTABLE and not answer.body)
    )


def _xml_fault(answer: Response) -> str:
    try:
        root = parse_xml(answer.body)
    except UnreadableError as error:
        return str(error)
    return "" if root.tag == f"{{{_NAMESPACE}}}problem" else f"the root element {root.tag}"


def _judge_status(api: RestInterface, exchange: Exchange, answer: Response) -> None:
    members = members_of(answer)
    stated = None if members is None else members.get("status")
    missing = stated is None and members is not None
    found = "a problem that cannot be read" if members is None else f"a problem whose status is {stated!r}"
    expect(api.run.judge, "http/problem-status", exchange).that(
        stated == answer.status and not isinstance(stated, bool),
        f"a problem whose status is that of the response, {answer.status}",
        "a problem without status" if missing else found,
        cause="missing" if missing else type(stated).__name__,
    )


def members_of(answer: Response) -> dict[str, Any] | None:
    """Return the members of a problem, status as a number; None where the problem cannot be read."""
    if answer.media_type == XML:
        try:
            root = parse_xml(answer.body)
        except UnreadableError:
            return None
        members: dict[str, Any] = {
            local_name(child): (child.text or "") for child in root if isinstance(child.tag, str)
        }
        status = str(members.get("status", "")).strip()
        if re.fullmatch(r"[+-]?\d{1,9}", status, re.ASCII):
            members["status"] = int(status)
        return members
    value = read_json(answer.body).value
    return value if isinstance(value, dict) else None


def detail_of(answer: Response) -> str:
    """Return the detail of a problem; empty where there is none."""
    members = members_of(answer) or {}
    detail = members.get("detail")
    return detail if isinstance(detail, str) else ""


def names(detail: str, *words: str) -> bool:
    """Return whether a detail has one of some names of a field as a word, not as a part of another one."""
    return any(re.search(rf"(?<![A-Za-z0-9_]){re.escape(word)}(?![A-Za-z0-9_])", detail) for word in words)
