"""The REST observer: judges every exchange of every check, so that one failure in fifty responses is noticed.

It judges only what applies to every request of its kind; checks judge the responses to their unusual requests.
"""

import re
from collections.abc import Iterable
from email.utils import parsedate_to_datetime
from functools import lru_cache
from http import HTTPStatus

from conformance.api.expectation import expect
from conformance.api.rest import declared, problem
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.request_context import RequestContext
from conformance.api.rest.statuses import CRASHES, is_cut_off
from conformance.api.rest.validity import INVALID, VALID, validity
from conformance.documents.json_text import read_json
from conformance.documents.openapi import Operation, is_json, is_xml
from conformance.documents.traceback import inside_shown
from conformance.transport.exchange import Exchange, Listener, NoAnswer, Request, Response, Unanswered
from conformance.verdict.finding import Showing, likeness

_CHARSET = re.compile(r"""charset\s*=\s*["']?([^\s;"']+)""", re.IGNORECASE)
# Fields that clients act on, and that several values make meaningless (RFC 9110 5.3).
_SINGLE = ("Content-Type", "Location", "Retry-After")
# Fields that ask for a part or set a condition, and the statuses that only such requests get.
_CONDITIONS = frozenset({"range", "if-none-match", "if-modified-since", "if-match", "if-unmodified-since"})
_CONDITIONAL = frozenset({206, 304, 412, 416})
# An operation that took so long once is asked less often, ms.
_SLOW_MS = 1000.0
_WELL_FRAMED = "well-framed HTTP"
# Fields that contain one time and nothing else, in lower case, and the grammar of that time (RFC 9110 5.6.7).
_TIMES = frozenset({"date", "last-modified"})
_IMF_FIXDATE = re.compile(
    r"(?:Mon|Tue|Wed|Thu|Fri|Sat|Sun), \d{2} (?:Jan|Feb|Mar|Apr|May|Jun|Jul|Aug|Sep|Oct|Nov|Dec) \d{4} "
    r"\d{2}:\d{2}:\d{2} GMT",
    re.ASCII,
)
# What a web server answers by itself when it refuses a request: an API's author has no hand in these.
_OF_PARSERS = frozenset({400, 413, 414, 431})
# RFC 9110 8.8.3: entity-tag.
_ENTITY_TAG = re.compile(r'(?:W/)?"[\x21\x23-\x7e\x80-\xff]*"')


class Observer(Listener):
    """Judges exchanges with the REST interface.

    Args:
        api: the robot's REST interface.
        elsewhere: URLs below its base URL that belong to other interfaces.
    """

    def __init__(self, api: RestInterface, elsewhere: Iterable[str] = ()) -> None:
        self._api = api
        self._elsewhere = frozenset(url.split("?", 1)[0] for url in elsewhere)

    def answered(self, exchange: Exchange) -> None:
        """Judge one exchange if its request went to this interface."""
        api, answer = self._api, exchange.response
        context = self._seen(exchange.request)
        if context is None:
            return
        api.server = api.server or answer.header("server") or ""
        self._judge_fields(exchange, answer, context)
        if answer.status in _CONDITIONAL and _is_conditional(exchange.request):
            return  # a server's own response (RFC 9110 13, 14), which no description declares; a part is no document
        if answer.body and not context.is_head and is_json(answer.media_type):
            self._judge_json(exchange, answer)
        if answer.body and (is_xml(answer.media_type) or answer.media_type == "text/plain"):
            wrong = _other_charset(answer)
            expected = "content in the charset that Content-Type names"
            expect(api.run.judge, "rest-formats/charset", exchange).that(not wrong, expected, wrong)
        if answer.status >= HTTPStatus.BAD_REQUEST:
            inside = inside_shown(exchange)
            expected, found = "an error that shows nothing of the program", f"{inside!r} in the response"
            expect(api.run.judge, "http/no-traceback", exchange).that(not inside, expected, found, cause="traceback")
            problem.judge(api, exchange, answer, context)
            declared.judge_refused_method(api, exchange, context)
        if context.operation is not None:
            if answer.elapsed_ms > _SLOW_MS:
                api.slow.add(context.operation.label)
            if api.values is not None and not context.operation.safe:
                api.values.learn(context.operation, exchange)
            self._judge_crash(exchange, context.operation)
            if answer.status >= HTTPStatus.BAD_REQUEST and context.usual and not is_cut_off(exchange):
                self._judge_input(exchange, answer, context)
            declared.judge(api, exchange, answer, context)

    def _judge_crash(self, exchange: Exchange, operation: Operation) -> None:
        """Judge whether the device failed, whatever check met it: one crash in sixty may meet none of a survey's."""
        status = exchange.response.status
        if status in CRASHES and not self._api.is_recorded:
            self._api.run.judge.check(
                "robustness/no-server-error",
                False,  # noqa: FBT003 - the condition of check()
                exchange,
                "a status below 500",
                cause=likeness(exchange),
                subject=operation.label,
                operations=(Showing(operation.label, 1, exchange.request),),
            )

    def unanswered(self, request: Unanswered) -> None:
        """Judge a response that is not HTTP, unless the request was malformed itself."""
        context = self._seen(request.request)
        if context is not None and context.usual and request.kind is NoAnswer.MALFORMED:
            expect(self._api.run.judge, "http/framing", request).that(
                holds=False, expected=_WELL_FRAMED, got=request.problem
            )

    def _seen(self, request: Request) -> RequestContext | None:
        """Return what the contract says about the request; None if it went to another interface."""
        api = self._api
        if request.url.split("?", 1)[0] in self._elsewhere:
            return None
        return RequestContext.of(api.run.contract, api.client.base_url, request)

    def _judge_fields(self, exchange: Exchange, answer: Response, context: RequestContext) -> None:
        judge = self._api.run.judge
        # RFC 9112 6.2: of two lengths, readers may take either one.
        both = answer.header("transfer-encoding") is not None and answer.header("content-length") is not None
        found = "Content-Length beside Transfer-Encoding"
        expect(judge, "http/framing", exchange).that(not both, _WELL_FRAMED, found, cause="two lengths")
        if answer.body:
            named = answer.header("content-type")
            found = (
                f"{f'Content-Type: {named}' if named else 'no Content-Type'} with a body of {len(answer.body)} bytes"
            )
            is_named = "/" in answer.media_type
            expect(judge, "http/content-type", exchange).that(
                is_named, "a Content-Type header field with a media type", found
            )
        twice = answer.repeated(*_SINGLE)
        expected = "no header twice, unless its value is a list"
        expect(judge, "http/field-once", exchange).that(not twice, expected, f"{twice} several times")
        # RFC 9110 6.6.1 leaves 5xx free.
        by_server = self._api.run.contract.described and answer.status in _OF_PARSERS
        if answer.status < HTTPStatus.INTERNAL_SERVER_ERROR and context.request.raw is None and not by_server:
            date = answer.header("date")
            found = "no header field Date" if date is None else f"Date: {date}"
            expect(judge, "http/date", exchange).that(_is_date(date), "Date with the time of the response", found)
        for name, value in answer.headers:
            if name.lower() in _TIMES:
                expected, found = f"{name} in the format Sun, 06 Nov 1994 08:49:37 GMT", f"{name}: {value}"
                holds = _IMF_FIXDATE.fullmatch(value.strip()) is not None
                expect(judge, "http/date-format", exchange).that(holds, expected, found, cause=name.lower())
            elif name.lower() == "etag":
                holds = _ENTITY_TAG.fullmatch(value.strip()) is not None
                expected = 'ETag with a tag in double quotes, such as "a1" or W/"a1"'
                expect(judge, "http/etag-format", exchange).that(holds, expected, f"ETag: {value}", cause="etag")

    def _judge_json(self, exchange: Exchange, answer: Response) -> None:
        judge = self._api.run.judge
        text = read_json(answer.body)
        expect(judge, "http/json-finite", exchange).that(
            not text.non_finite, "JSON with finite numbers", f"the number {text.non_finite}", cause="non-finite"
        )
        expect(judge, "http/json-encoding", exchange).that(not text.encoding, "UTF-8 without a BOM", text.encoding)
        expect(judge, "http/json-unique-names", exchange).that(
            not text.twice, "each name once in an object", f"the name {text.twice!r} twice in one object"
        )

    def _judge_input(self, exchange: Exchange, answer: Response, context: RequestContext) -> None:
        """Judge a 5xx response: it is wrong for an invalid request, and undeclared for a valid one."""
        api, request = self._api, context.request
        said = validity(api.run.contract, request.method, context.target, request.media_type, request.body)
        status = answer.status
        crashed = status >= HTTPStatus.INTERNAL_SERVER_ERROR
        if status == HTTPStatus.SERVICE_UNAVAILABLE:
            crashed = answer.header("retry-after") is None
        retry = " without Retry-After" if status == HTTPStatus.SERVICE_UNAVAILABLE else ""
        operation = said.operation.id if said.operation else request.method
        for verdict, id_, expected in (
            (INVALID, "http/no-server-error", f"a status below 500 for invalid input ({said.why})"),
            (VALID, "http/declared-status", f"a status that the contract declares for {operation}"),
        ):
            if said.verdict == verdict and (crashed or verdict == INVALID):
                found, cause = f"status {status}{retry}", f"{status} {operation}"
                expect(api.run.judge, id_, exchange).that(not crashed, expected, found, cause=cause)


def _is_conditional(request: Request) -> bool:
    return any(name.lower() in _CONDITIONS for name, _ in request.headers)


def _other_charset(answer: Response) -> str:
    """Return why the body is not in the charset of Content-Type; empty if it is.

    Without charset, XML declares its encoding itself, and plain text is UTF-8, unless it is a server's own error. A
    byte order mark is ignored.
    """
    named = _CHARSET.search(answer.header("content-type") or "")
    if named is None and (is_xml(answer.media_type) or not answer.ok):
        return ""
    charset = named[1] if named else "utf-8"
    found = f"Content-Type {answer.header('content-type')!r} with bytes that are not {charset}"
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
