"""Generated mutants that alter a whole response: its status, its header fields, or its body.

A status becomes another; a field is dropped, doubled or changed; a body is malformed, or the response another's, always
or now and then.
"""

import re
from collections.abc import Callable, Iterator
from http import HTTPStatus
from typing import Any

from proof.mutation.changes import becomes
from proof.mutation.changes import status as status_is
from proof.mutation.messages import Change, Request, Response
from proof.selftest.generated.mutant import GeneratedMutant, Tally, answers, classes_of_answers, in_mode
from proof.selftest.generated.operators import single
from proof.selftest.generated.places import Exchange

_KNOWN = frozenset(status.value for status in HTTPStatus)
_SUCCESS = range(200, 300)
# Makes a mutant that changes an operation's whole response, in a mode.
Whole = Callable[[Exchange, str], Callable[[Tally], Change]]
_NUMBER = re.compile(rb"-?\d+\.\d+(?:[eE][+-]?\d+)?")
BODIES: dict[str, Callable[[bytes], bytes]] = {
    "body-truncate": lambda body: body[: len(body) // 2],
    "body-empty": lambda _: b"",
    "body-duplicate": lambda body: body + body,
    "body-rest": lambda body: body + b"\nok",
    "body-bom": lambda body: b"\xef\xbb\xbf" + body,
    "body-latin": lambda body: body + "<!-- \u00e9 -->".encode("latin-1"),
}


def neighbours(exchange: Exchange, status: int) -> tuple[int, ...]:
    """Return statuses to replace a status by: adjacent codes, others of the operation, one of another class."""
    soap_statuses = (200, 202, 204, 400, 404, 405, 415, 500)
    others = {status - 1, status + 1, *(exchange.statuses if exchange.side == "rest" else soap_statuses)}
    others |= {500, 404} if status in _SUCCESS else {200, 500}
    return tuple(sorted(others & _KNOWN - {status} - set(range(100, 200))))


def of_statuses(exchange: Exchange) -> Iterator[GeneratedMutant]:
    """Yield mutants that replace each declared status with each of its neighbours."""
    for status in dict.fromkeys((*exchange.statuses, *((500,) if exchange.side == "soap" else (405, 415)))):
        for other in neighbours(exchange, status):
            says = f"{exchange.name} answers {other} in place of {status}."
            make = in_mode("", answers(exchange, status_is(status), becomes(other)))
            yield GeneratedMutant.of("status", exchange, f"{status}-{other}", says, make, classes_of_answers(exchange))


def _set(name: str, value: Callable[[str], str]) -> Callable[[Response], None]:
    def edit(response: Response) -> None:
        now = response.field(name)
        if now is not None:
            response.put(name, value(now))

    return edit


def _other_charset(value: str) -> str:
    """Return a media type with another charset; not for JSON, where a charset has no effect (RFC 8259 11)."""
    media_type = value.partition(";")[0]
    return value if media_type.endswith("json") else f"{media_type}; charset=utf-16"


def _twice(name: str, other: str) -> Callable[[Response], None]:
    def edit(response: Response) -> None:
        if response.field(name) is not None:
            response.fields.append((name, other))

    return edit


def _headers(exchange: Exchange) -> Iterator[tuple[str, str, Callable[[Response], bool], dict[str, Any]]]:
    """Yield for each header its name, the kind of message, the condition for a change, and the edits by operator."""
    fine, bad = (lambda answer: answer.status in _SUCCESS), (lambda answer: answer.status not in range(400))
    for said, when in (("", fine), ("-of-errors", bad)):
        if said or exchange.formats:
            yield (
                "Content-Type",
                said,
                when,
                {
                    "header-drop": lambda answer: answer.drop("Content-Type"),
                    "header-double": _twice("Content-Type", "application/octet-stream"),
                    "header-change": _set("Content-Type", lambda _: "application/octet-stream"),
                    "header-truncate": _set("Content-Type", lambda value: value.partition("/")[0]),
                    "header-charset": _set("Content-Type", _other_charset),
                },
            )
    if exchange.side == "rest" and exchange.formats:
        yield (
            "Vary",
            "",
            fine,
            {
                "header-drop": lambda answer: answer.drop("Vary"),
                "header-change": _set("Vary", lambda _: "Accept-Language"),
            },
        )


def of_headers(exchange: Exchange) -> Iterator[GeneratedMutant]:
    """Yield mutants that drop, double or change each header field that the contract names."""
    for field, of, when, edits in _headers(exchange):
        for operator, edit in edits.items():
            says = f"{exchange.name}: {field}{of.replace('-', ' ')} is not as it should be ({operator})."
            make = in_mode("", answers(exchange, when, edit))
            yield GeneratedMutant.of(operator, exchange, f"{field}{of}", says, make, classes_of_answers(exchange))
    if exchange.side == "rest":
        yield from _of_allow(exchange)


def _of_allow(exchange: Exchange) -> Iterator[GeneratedMutant]:
    """Yield mutants whose Allow header lacks a method of the resource or lists one that it does not have."""

    def resource(request: Request) -> bool:
        return request.side == "rest" and re.fullmatch(exchange.path, request.path) is not None

    def less(value: str) -> str:
        return ", ".join(word for word in re.split(r"\s*,\s*", value) if word != exchange.method)

    edits: dict[str, Callable[[Response], object]] = {
        "header-drop": lambda answer: answer.drop("Allow"),
        "header-less": _set("Allow", less),
        "header-more": _set("Allow", lambda value: f"{value}, PATCH"),
    }
    for operator, edit in edits.items():

        def alter(request: Request, response: Response, edit: Callable[[Response], object] = edit) -> Response | None:
            if not resource(request) or response.field("Allow") is None:
                return None
            altered = response.copy()
            edit(altered)
            return None if altered.fields == response.fields else altered

        says = f"Allow of {exchange.name}'s resource is not as it should be ({operator})."
        yield GeneratedMutant.of(operator, exchange, "Allow", says, in_mode("", alter), ("http",))


def _numbers(change: Callable[[float], str]) -> Callable[[bytes], bytes]:
    return lambda body: _NUMBER.sub(lambda found: change(float(found[0])).encode(), body)


_NUMBERS: dict[str, Callable[[bytes], bytes]] = {
    "comma": _numbers(lambda number: repr(number).replace(".", ",")),
    "single": _numbers(lambda number: repr(single(number))),
    "negate": _numbers(lambda number: repr(-number)),
    "scale": _numbers(lambda number: repr(1.5 * number)),
    "round": _numbers(lambda number: repr(round(number, 2))),
}


def of_bodies(exchange: Exchange, *, numbers: bool) -> Iterator[GeneratedMutant]:
    """Yield mutants that alter the whole body of successful responses in each format.

    Args:
        exchange: the operation.
        numbers: whether its responses have numbers, which are altered in plain text; a robot's own additions are not.
    """
    for media_type in exchange.formats:
        form = media_type.rpartition("/")[2].replace("plain", "text")
        edits = {**BODIES, **_NUMBERS} if form == "text" and numbers else BODIES
        json_ = form == "json"
        classes = classes_of_answers(exchange) if json_ or exchange.side == "soap" else ("rest-formats", "http")
        for operator, edit in edits.items():

            def apply(answer: Response, edit: Callable[[bytes], bytes] = edit) -> None:
                answer.body = edit(answer.body)

            def when(answer: Response, media_type: str = media_type) -> bool:
                return answer.status in _SUCCESS and bool(answer.body) and answer.media_type == media_type

            says = f"{exchange.name}'s body as {media_type} is altered as a whole ({operator})."
            make = in_mode("", answers(exchange, when, apply))
            yield GeneratedMutant.of(operator, exchange, f"body:{form}", says, make, classes)


def cross_responses(
    exchange: Exchange, mode: str, breaks: Callable[[Response], bool] = lambda _: True
) -> Callable[[Tally], Change]:
    """Return a change that sends the robot's previous response, of any operation, instead of the current one.

    Args:
        exchange: the operation.
        mode: when.
        breaks: whether such a response breaks a rule; others are left as they are.
    """

    def make(tally: Tally) -> Change:
        before: list[Response] = []

        def alter(request: Request, response: Response) -> Response | None:
            then = before[-1] if before else None
            before[:] = [response]
            if then is None or not exchange.concerns(request) or then.body == response.body or not breaks(then):
                return None
            return then.copy()

        return in_mode(mode, alter)(tally)

    return make


def failing(exchange: Exchange, mode: str) -> Callable[[Tally], Change]:
    """Return a change that replaces successful responses by 500."""
    return in_mode(mode, answers(exchange, lambda answer: answer.status in _SUCCESS, becomes(500)))


def cut(exchange: Exchange, mode: str) -> Callable[[Tally], Change]:
    """Return a change that sends half of a successful response's body, or adds a body where none is allowed."""

    def edit(answer: Response) -> None:
        answer.body = answer.body[: len(answer.body) // 2]

    return in_mode(mode, answers(exchange, lambda answer: answer.status in _SUCCESS, edit))
