"""Problem details (RFC 9457): what an error answer has to be."""

import re
from typing import Any

from conformance.api.rest.interface import RestInterface
from conformance.api.rest.request_context import RequestContext
from conformance.documents.json_text import read_json
from conformance.documents.openapi import inside_prefix, is_normal
from conformance.documents.representation import UnreadableError, local_name, parse_xml
from conformance.transport.exchange import Exchange, Response

JSON = "application/problem+json"
XML = "application/problem+xml"
#: Those that every server knows; what comes with another one may never reach a resource.
STANDARD_METHODS = frozenset({"GET", "HEAD", "PUT", "POST", "DELETE", "OPTIONS", "PATCH"})
_NAMESPACE = "urn:ietf:rfc:7807"
# What servers, proxies and gateways answer before any resource is asked; and 401, which tells by its own field.
_TRANSPORT = frozenset({401, 407, 408, 411, 413, 414, 417, 421, 426, 429, 431})
# What servers do not let into a path, as they and what stands behind them may take it for another one: an encoded slash
# (Apache), backslash, percent, control character, a parameter (Tomcat, Jetty, Spring's firewall).
_AMBIGUOUS = re.compile(r"%(?:2f|5c|25|7f|[01][0-9a-f])|[;\\]", re.IGNORECASE)
# Of what a target is made (RFC 3986 3.3, 3.4); one of anything else is malformed (RFC 9112 3.2).
_TARGET = re.compile(r"(?:[A-Za-z0-9._~!$&'()*+,;=:@/?-]|%[0-9A-Fa-f]{2})*")
_NOT_ACCEPTABLE = 406
_SERVER_ERROR = 500
_UNAVAILABLE = 503


def judge(api: RestInterface, exchange: Exchange, answer: Response, context: RequestContext) -> None:
    """Judge one answer of 400 and above."""
    status = answer.status
    if status in _TRANSPORT or not context.usual or (status >= _SERVER_ERROR and status != _UNAVAILABLE):
        return
    if status == _UNAVAILABLE and context.operation is None:
        return
    if context.is_head and not answer.media_type:
        return
    media_type = answer.media_type
    if _by_server(api, context, answer):
        api.run.judge.check(
            "http/problem-type-server",
            media_type in {JSON, XML},
            exchange,
            f"an error as {JSON}, from the server too",
            found=f"status {status} as {media_type or 'no media type'}",
            cause=f"{status} {media_type}",
        )
        return
    allowed = [JSON, *([XML] if context.names_xml or status == _NOT_ACCEPTABLE else [])]
    api.run.judge.check(
        "http/problem-type",
        media_type in allowed,
        exchange,
        f"an error as {' or '.join(allowed)}",
        found=f"status {status} as {media_type or 'no media type'}",
        cause=f"{media_type} {context.operation.id if context.operation else 'elsewhere'}",
    )
    if context.likes_xml > context.likes_json and status != _NOT_ACCEPTABLE:
        fault = "" if context.is_head or media_type != XML else _xml_fault(answer)
        api.run.judge.check(
            "rest-formats/problem-xml",
            media_type == XML and not fault,
            exchange,
            f"an error as {XML}, because XML was asked for",
            found=fault or f"status {status} as {media_type or 'no media type'}",
            cause=fault or media_type,
        )
    if not context.is_head and media_type in {JSON, XML}:
        _judge_status(api, exchange, answer)


def _by_server(api: RestInterface, context: RequestContext, answer: Response) -> bool:
    """Whether a server may have answered before any resource saw the request (contract, errors)."""
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
    return "" if root.tag == f"{{{_NAMESPACE}}}problem" else f"the root element is {root.tag}"


def _judge_status(api: RestInterface, exchange: Exchange, answer: Response) -> None:
    members = members_of(answer)
    stated = None if members is None else members.get("status")
    missing = stated is None and members is not None
    holds = stated == answer.status and not isinstance(stated, bool)
    api.run.judge.check(
        "http/problem-status",
        holds,
        exchange,
        f"a problem with the status of the answer, {answer.status}",
        found=f"status member {stated!r} in an answer {answer.status}"
        if members is not None
        else "a problem that cannot be read",
        cause="missing" if missing else type(stated).__name__,
    )


def members_of(answer: Response) -> dict[str, Any] | None:
    """The members of a problem, status as a number; None where it cannot be read as one."""
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
    """The detail of a problem; empty where there is none."""
    members = members_of(answer) or {}
    detail = members.get("detail")
    return detail if isinstance(detail, str) else ""


def names(detail: str, *words: str) -> bool:
    """Whether a detail names a field by one of its names: as a word of its own, not as a part of another one."""
    return any(re.search(rf"(?<![A-Za-z0-9_]){re.escape(word)}(?![A-Za-z0-9_])", detail) for word in words)
