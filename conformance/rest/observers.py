"""Observers: they judge every exchange over REST that any check has, so that a fault that comes once in fifty shows.

They judge only what the request itself makes applicable; strange requests are left to the checks that send them.
"""

from __future__ import annotations

from email.utils import parsedate_to_datetime
from typing import TYPE_CHECKING

from conformance.documents.json_text import read_json
from conformance.documents.openapi import is_json
from conformance.documents.traceback import inside_shown
from conformance.rest import declared, problem
from conformance.rest.request_context import RequestContext
from conformance.transport.exchange import Listener, NoAnswer

if TYPE_CHECKING:
    from conformance.engine.session import Session
    from conformance.transport.exchange import Exchange, Request, Response, Unanswered

# Methods of which a server may say that it knows none (RFC 9110 15.6.2); the others it has to know.
KNOWN_METHODS = frozenset({"GET", "HEAD", "PUT", "POST", "DELETE", "OPTIONS"})


def watch(session: Session) -> None:
    """Have every exchange with the session's REST interface judged, whoever sends it."""
    if not any(isinstance(listener, Observer) for listener in session.connection.listeners):
        session.connection.listeners.append(Observer(session))


class Observer(Listener):
    """Judges exchanges.

    Args:
        session: the run; its REST interface may still be to come.
    """

    def __init__(self, session: Session) -> None:
        self._session = session

    def answered(self, exchange: Exchange) -> None:
        """Judge one exchange; what went to another interface is none of ours."""
        session, answer = self._session, exchange.response
        context = self._seen(exchange.request)
        if context is None:
            return
        self._judge_fields(exchange, answer, context)
        if answer.body and not context.is_head and is_json(answer.media_type):
            self._judge_json(exchange, answer)
        if answer.status >= 400:  # noqa: PLR2004 - RFC 9110 15
            inside = inside_shown(answer.body)
            session.judge.check(
                "http/no-traceback",
                not inside,
                exchange,
                "an error without the inside of the program",
                found=f"the answer shows {inside!r}",
                cause="traceback",
            )
            problem.judge(session, exchange, answer, context)
        self._judge_server_error(exchange, answer, context)
        if context.operation is not None:
            declared.judge(session, exchange, answer, context)

    def unanswered(self, request: Unanswered) -> None:
        """Judge an answer that is no HTTP, where the request gave no reason for it."""
        context = self._seen(request.request)
        if context is not None and context.usual and request.kind is NoAnswer.MALFORMED:
            self._session.judge.check(
                "http/framing", holds=False, exchange=request, expected="well-framed HTTP", found=request.problem
            )

    def _seen(self, request: Request) -> RequestContext | None:
        """The request, seen from the contract; None where it went to another interface."""
        session = self._session
        if session.rest is None or self._is_soap(request.url):
            return None
        return RequestContext.of(session.contract, session.rest.base_url, request)

    def _is_soap(self, url: str) -> bool:
        services = (self._session.publishers, self._session.subscribers)
        return any(url.split("?", 1)[0] == service.endpoint.split("?", 1)[0] for service in services if service)

    def _judge_fields(self, exchange: Exchange, answer: Response, context: RequestContext) -> None:
        judge = self._session.judge
        judge.check("http/framing", holds=True, exchange=exchange, expected="well-framed HTTP")
        if answer.body:
            media_type = answer.media_type
            judge.check(
                "http/content-type",
                "/" in media_type,
                exchange,
                "Content-Type with a media type",
                found=f"Content-Type {answer.header('content-type')!r} on {len(answer.body)} octets",
            )
        if answer.status < 500 and context.request.raw is None:  # noqa: PLR2004 - RFC 9110 6.6.1 leaves 5xx free
            date = answer.header("date")
            judge.check(
                "http/date", _is_date(date), exchange, "Date with the time of the answer", found=f"Date: {date}"
            )

    def _judge_json(self, exchange: Exchange, answer: Response) -> None:
        judge = self._session.judge
        text = read_json(answer.body)
        judge.check(
            "http/json-finite",
            not text.non_finite,
            exchange,
            "JSON with finite numbers",
            found=f"the number {text.non_finite}",
            cause="non-finite",
        )
        judge.check("http/json-encoding", not text.encoding, exchange, "UTF-8 without a BOM", found=text.encoding)
        judge.check(
            "http/json-unique-names",
            not text.twice,
            exchange,
            "each name once in an object",
            found=f"the name {text.twice!r} twice in one object",
        )

    def _judge_server_error(self, exchange: Exchange, answer: Response, context: RequestContext) -> None:
        status = answer.status
        fine = (
            status < 500  # noqa: PLR2004 - RFC 9110 15.6
            or (status == 501 and context.request.method not in KNOWN_METHODS)  # noqa: PLR2004
            or (status == 503 and answer.header("retry-after") is not None)  # noqa: PLR2004
            or (status == 505 and context.request.raw is not None)  # noqa: PLR2004 - HTTP version not supported
        )
        retry = " without Retry-After" if status == 503 else ""  # noqa: PLR2004
        self._session.judge.check(
            "http/no-server-error",
            fine,
            exchange,
            "no 5xx",
            found=f"status {status}{retry} for {context.request.method}",
            cause=f"{status} {context.operation.id if context.operation else context.request.method}",
        )


def _is_date(value: str | None) -> bool:
    try:
        return value is not None and parsedate_to_datetime(value) is not None
    except (ValueError, TypeError, IndexError):
        return False
