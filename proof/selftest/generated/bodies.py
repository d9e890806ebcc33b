"""Generated mutants that alter the body as a whole or replace the whole response, always or intermittently."""

import re
from collections.abc import Callable, Iterator

from proof.mutation.changes import becomes
from proof.mutation.messages import Change, Request, Response
from proof.selftest.generated.mutant import GeneratedMutant, Tally, answers, classes_of_answers, in_mode
from proof.selftest.generated.operators import single
from proof.selftest.generated.places import Exchange

_SUCCESS = range(200, 300)
# Makes a mutant of an operation's whole answers, in a mode.
Whole = Callable[[Exchange, str], Callable[[Tally], Change]]
_NUMBER = re.compile(rb"-?\d+\.\d+(?:[eE][+-]?\d+)?")


def _numbers(change: Callable[[float], str]) -> Callable[[bytes], bytes]:
    return lambda body: _NUMBER.sub(lambda found: change(float(found[0])).encode(), body)


BODIES: dict[str, Callable[[bytes], bytes]] = {
    "body-truncate": lambda body: body[: len(body) // 2],
    "body-empty": lambda _: b"",
    "body-duplicate": lambda body: body + body,
    "body-rest": lambda body: body + b"\nok",
    "body-bom": lambda body: b"\xef\xbb\xbf" + body,
    "body-latin": lambda body: body + "<!-- \u00e9 -->".encode("latin-1"),
}
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

            yield GeneratedMutant(
                f"{operator}:{exchange.name}:body:{form}",
                f"{exchange.name}'s body as {media_type} is altered as a whole ({operator}).",
                operator,
                exchange,
                classes,
                in_mode("", answers(exchange, when, apply)),
            )


def crossed(
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
