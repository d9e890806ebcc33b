"""Bodies: media types that an operation does not take, charset, and sizes (RFC 9110 8.3, 15.5.14, 15.5.16)."""

from collections.abc import Iterator

import pytest

from conformance.rest.applicable import applicable_operations
from conformance.rest.calls import JSON, Call, example_call
from conformance.rest.interface import RestInterface
from conformance.rest.statuses import is_taken, judge_status
from conformance.robot.stopping import stop_robot
from conformance.transport.exchange import NoAnswer, NoAnswerError
from conformance.verdict.evidence import Judge

pytestmark = [pytest.mark.phase("input"), pytest.mark.needs("rest")]
_OTHERS = (
    "text/plain",
    "application/x-www-form-urlencoded",
    "multipart/form-data; boundary=x",
    "image/png",
    "text/csv",
)
_CHARSETS = ("application/json; charset=utf-8", "application/json;charset=UTF-8", 'application/json; charset="utf-8"')
_TAKEN = 64 * 1024
_TOO_LARGE = 10 * 1024 * 1024 + 1


def _valid(api: RestInterface, judge: Judge, ids: tuple[str, ...]) -> Iterator[Call]:
    """A valid request for each operation that takes JSON and is answered as one should be."""
    tried = 0
    for operation in applicable_operations(api, ids, lambda item: JSON in item.bodies, "takes JSON"):
        stop_robot(api)
        call = example_call(api, operation)
        exchange = call.send(api)
        if is_taken(exchange):
            tried += 1
            yield call
        else:
            for id_ in ids:
                judge.note(id_, f"a valid {operation.id} is answered {exchange.came}, so it was not tried")
    stop_robot(api)


@pytest.mark.requirement("http/unsupported-media-type")
def test_media_types_that_are_not_taken(api: RestInterface, judge: Judge) -> None:
    """A valid body under another media type, and under none at all, is not looked at."""
    for operation in applicable_operations(
        api, ["http/unsupported-media-type"], lambda item: JSON in item.bodies, "takes JSON"
    ):
        call = example_call(api, operation)
        for media_type in api.run.effort.subsample(_OTHERS, 2):
            if media_type in operation.bodies:
                continue
            exchange = call.send(api, ("Content-Type", media_type))
            status = exchange.response.status
            judge_status(
                judge, "http/unsupported-media-type", status == 415, exchange, f"415 for a body of {media_type}"
            )


@pytest.mark.requirement("http/charset")
def test_charset_parameter(api: RestInterface, judge: Judge) -> None:
    """application/json is the same with a charset parameter as without."""
    for call in _valid(api, judge, ("http/charset",)):
        for media_type in api.run.effort.subsample(_CHARSETS, 1):
            exchange = call.send(api, ("Content-Type", media_type))
            judge.check(
                "http/charset",
                is_taken(exchange),
                exchange,
                f"Content-Type: {media_type} taken like {JSON}",
                cause=media_type,
            )


@pytest.mark.requirement("http/content-too-large")
def test_sizes(api: RestInterface, judge: Judge) -> None:
    """64 KiB are taken; more than 10 MiB are answered 413, or the connection is closed."""
    judge.at_risk = ("http/content-too-large",)
    for call in _valid(api, judge, ("http/content-too-large",)):
        padded = call.carrying(call.body[:1] + b" " * (_TAKEN - len(call.body)) + call.body[1:])
        exchange = padded.send(api)
        judge.check("http/content-too-large", is_taken(exchange), exchange, "a body of 64 KiB taken")
        huge = call.carrying(call.body[:1] + b" " * (_TOO_LARGE - len(call.body)) + call.body[1:])
        for fields in ((), (("Transfer-Encoding", "chunked"),)):
            _judge_too_large(api, judge, huge, fields)
        exchange = call.send(api)
        judge.check("http/content-too-large", is_taken(exchange), exchange, "the next valid request taken as ever")


def _judge_too_large(api: RestInterface, judge: Judge, call: Call, fields: tuple[tuple[str, str], ...]) -> None:
    try:
        exchange = call.send(api, *fields, fresh=True)
    except NoAnswerError as none:
        if none.kind is not NoAnswer.CLOSED:
            raise
        judge.check("http/content-too-large", True, none.unanswered, "413, or a closed connection")
        return
    status = exchange.response.status
    # A server that takes no chunked bodies at all may say so (RFC 9112 6.3, RFC 9110 15.6.2 for an old one).
    refused = {413, 411, 400, 501} if fields else {413}
    judge.check(
        "http/content-too-large",
        status in refused,
        exchange,
        "413, or a closed connection",
        found=f"status {status} for a body of {_TOO_LARGE:,} octets",
        cause=f"{status} {bool(fields)}",
    )
