"""Observers: they judge every exchange over REST that any check has, so that a fault that comes once in fifty shows.

They judge only what the request itself makes applicable; strange requests are left to the checks that send them.
"""

import re
from collections.abc import Iterable
from email.utils import parsedate_to_datetime
from functools import lru_cache
from http import HTTPStatus

from conformance.api.rest import declared, problem
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.request_context import RequestContext
from conformance.api.rest.statuses import is_cut_off
from conformance.api.rest.validity import INVALID, VALID, validity
from conformance.documents.json_text import read_json
from conformance.documents.openapi import is_json, is_xml
from conformance.documents.traceback import inside_shown
from conformance.transport.exchange import Exchange, Listener, NoAnswer, Request, Response, Unanswered

_CHARSET = re.compile(r"""charset\s*=\s*["']?([^\s;"']+)""", re.IGNORECASE)
# Fields by which clients act, and which several values make meaningless (RFC 9110 5.3).
_SINGLE = ("Content-Type", "Location", "Retry-After")
# What asks for a part, or for an answer on a condition, and the statuses that only such a request has.
_CONDITIONS = frozenset({"range", "if-none-match", "if-modified-since", "if-match", "if-unmodified-since"})
_CONDITIONAL = frozenset({206, 304, 412, 416})


class Observer(Listener):
    """Judges exchanges.

    Args:
        api: the robot's REST interface.
        elsewhere: URLs below its base URL that belong to other interfaces.
    """

    def __init__(self, api: RestInterface, elsewhere: Iterable[str] = ()) -> None:
        self._api = api
        self._elsewhere = frozenset(url.split("?", 1)[0] for url in elsewhere)

    def answered(self, exchange: Exchange) -> None:
        """Judge one exchange; what went to another interface is none of ours."""
        api, answer = self._api, exchange.response
        context = self._seen(exchange.request)
        if context is None:
            return
        self._judge_fields(exchange, answer, context)
        if answer.status in _CONDITIONAL and _is_conditional(exchange.request):
            return  # a server's own answer (RFC 9110 13, 14), which no description need have; a part is no document
        if answer.body and not context.is_head and is_json(answer.media_type):
            self._judge_json(exchange, answer)
        if answer.ok and answer.body and (is_xml(answer.media_type) or answer.media_type == "text/plain"):
            wrong = _other_charset(answer)
            api.run.judge.check(
                "rest-formats/charset", not wrong, exchange, "content in the charset that is named", found=wrong
            )
        if answer.status >= HTTPStatus.BAD_REQUEST:
            inside = inside_shown(answer.body)
            api.run.judge.check(
                "http/no-traceback",
                not inside,
                exchange,
                "an error without the inside of the program",
                found=f"the answer shows {inside!r}",
                cause="traceback",
            )
            problem.judge(api, exchange, answer, context)
        if context.operation is not None:
            if answer.status >= HTTPStatus.BAD_REQUEST and context.usual and not is_cut_off(exchange):
                self._judge_input(exchange, answer, context)
            declared.judge(api, exchange, answer, context)

    def unanswered(self, request: Unanswered) -> None:
        """Judge an answer that is no HTTP, where the request gave no reason for it."""
        context = self._seen(request.request)
        if context is not None and context.usual and request.kind is NoAnswer.MALFORMED:
            self._api.run.judge.check(
                "http/framing", holds=False, exchange=request, expected="well-framed HTTP", found=request.problem
            )

    def _seen(self, request: Request) -> RequestContext | None:
        """The request, seen from the contract; None where it went to another interface."""
        api = self._api
        if request.url.split("?", 1)[0] in self._elsewhere:
            return None
        return RequestContext.of(api.run.contract, api.client.base_url, request)

    def _judge_fields(self, exchange: Exchange, answer: Response, context: RequestContext) -> None:
        judge = self._api.run.judge
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
        twice = answer.repeated(*_SINGLE)
        judge.check(
            "http/field-once", not twice, exchange, "each field once that is no list", found=f"{twice} several times"
        )
        # RFC 9110 6.6.1 leaves 5xx free.
        if answer.status < HTTPStatus.INTERNAL_SERVER_ERROR and context.request.raw is None:
            date = answer.header("date")
            judge.check(
                "http/date", _is_date(date), exchange, "Date with the time of the answer", found=f"Date: {date}"
            )

    def _judge_json(self, exchange: Exchange, answer: Response) -> None:
        judge = self._api.run.judge
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

    def _judge_input(self, exchange: Exchange, answer: Response, context: RequestContext) -> None:
        """Invalid input is no server's error; a valid request is answered as the contract declares."""
        api, request = self._api, context.request
        media_type = next((value for name, value in request.headers if name.lower() == "content-type"), "")
        media_type = media_type.split(";", 1)[0].strip().lower()
        said = validity(api.run.contract, request.method, context.target, media_type, request.body)
        status = answer.status
        crashed = status >= HTTPStatus.INTERNAL_SERVER_ERROR
        if status == HTTPStatus.SERVICE_UNAVAILABLE:
            crashed = answer.header("retry-after") is None
        retry = " without Retry-After" if status == HTTPStatus.SERVICE_UNAVAILABLE else ""
        operation = said.operation.id if said.operation else request.method
        for verdict, id_, expected in (
            (INVALID, "http/no-server-error", f"no 5xx for invalid input ({said.why})"),
            (VALID, "http/declared-status", f"a status that the contract declares for {operation}"),
        ):
            if said.verdict == verdict and (crashed or verdict == INVALID):
                api.run.judge.check(
                    id_, not crashed, exchange, expected, found=f"status {status}{retry}", cause=f"{status} {operation}"
                )


def _is_conditional(request: Request) -> bool:
    return any(name.lower() in _CONDITIONS for name, _ in request.headers)


def _other_charset(answer: Response) -> str:
    """How the content is not in the charset that Content-Type names; empty where it is.

    Without one, XML says its encoding itself, and plain text is UTF-8. A byte order mark is no part of the text.
    """
    named = _CHARSET.search(answer.header("content-type") or "")
    if named is None and is_xml(answer.media_type):
        return ""
    charset = named[1] if named else "utf-8"
    found = f"Content-Type {answer.header('content-type')!r} on octets that are not {charset}"
    try:
        text = answer.body.decode(charset).lstrip("\ufeff")
    except (UnicodeError, LookupError):
        return found
    try:
        return "" if text == answer.body.decode().lstrip("\ufeff") else found
    except UnicodeDecodeError:
        return ""


@lru_cache(maxsize=64)
def _is_date(value: str | None) -> bool:
    try:
        return value is not None and parsedate_to_datetime(value) is not None
    except (ValueError, TypeError, IndexError):
        return False
