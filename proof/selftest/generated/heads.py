"""Generated mutants of status codes and headers: other statuses, and dropped, doubled or changed header fields."""

import re
from collections.abc import Callable, Iterator
from http import HTTPStatus
from typing import Any

from proof.mutation.changes import becomes
from proof.mutation.changes import status as status_is
from proof.mutation.messages import Request, Response
from proof.selftest.generated.mutant import GeneratedMutant, answers, classes_of_answers, in_mode
from proof.selftest.generated.places import Exchange

_KNOWN = frozenset(status.value for status in HTTPStatus)
_SUCCESS = range(200, 300)

# Statuses.


def neighbours(exchange: Exchange, status: int) -> tuple[int, ...]:
    """Return the statuses to replace a status with: adjacent codes, others of the operation, one of the other class."""
    soap_statuses = (200, 202, 204, 400, 404, 405, 415, 500)
    others = {status - 1, status + 1, *(exchange.statuses if exchange.side == "rest" else soap_statuses)}
    others |= {500, 404} if status in _SUCCESS else {200, 500}
    return tuple(sorted(others & _KNOWN - {status} - set(range(100, 200))))


def of_statuses(exchange: Exchange) -> Iterator[GeneratedMutant]:
    """Yield mutants that replace each declared status with each of its neighbours."""
    for status in dict.fromkeys((*exchange.statuses, *((500,) if exchange.side == "soap" else (405, 415)))):
        for other in neighbours(exchange, status):
            yield GeneratedMutant(
                f"status:{exchange.name}:{status}-{other}",
                f"{exchange.name} answers {other} in place of {status}.",
                "status",
                exchange,
                classes_of_answers(exchange),
                in_mode("", answers(exchange, status_is(status), becomes(other))),
            )


# Header fields.


def _set(name: str, value: Callable[[str], str]) -> Callable[[Response], None]:
    def edit(response: Response) -> None:
        now = response.field(name)
        if now is not None:
            response.put(name, value(now))

    return edit


def _other_charset(value: str) -> str:
    """Return a media type with another charset; JSON has none, so that it would have no effect (RFC 8259 11)."""
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
            yield GeneratedMutant(
                f"{operator}:{exchange.name}:{field}{of}",
                f"{exchange.name}: {field}{of.replace('-', ' ')} is not as it should be ({operator}).",
                operator,
                exchange,
                classes_of_answers(exchange),
                in_mode("", answers(exchange, when, edit)),
            )
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

        yield GeneratedMutant(
            f"{operator}:{exchange.name}:Allow",
            f"Allow of {exchange.name}'s resource is not as it should be ({operator}).",
            operator,
            exchange,
            ("http",),
            in_mode("", alter),
        )
