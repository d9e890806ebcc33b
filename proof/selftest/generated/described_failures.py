"""Changes that make a described device fail: it closes connections, hangs, slows down, shows its insides."""

import json
import re
import threading
import time
from collections.abc import Callable

from proof.mutation.messages import Change, Forward, HangUpError, Request, Response
from proof.selftest.generated.mutant import Mode, Tally
from proof.selftest.generated.places import Exchange

_SUCCESS, _BAD_REQUEST = range(200, 300), 400
# _HANGS_S: how long a hanging mutant waits, s: longer than a request's deadline. _LATER_S: delay after each request.
# _LATEST_S: longest delay.
_HANGS_S, _LATER_S, _LATEST_S = 30.0, 0.002, 0.4
_TRACEBACK = json.dumps(
    'Traceback (most recent call last):\n  File "/srv/device/app/handlers.py", line 83, in handle\n    '
    "value = table[key]\nKeyError: 'speed'\n"
).encode()
Edit = Callable[[Request, Response], Response | None]


def make_failed(answer: Response) -> None:
    """Make a response the 500 of a server that failed."""
    answer.status, answer.reason, answer.body = 500, "", b"Internal Server Error"
    answer.put("Content-Type", "text/plain")


def hanging_up(exchange: Exchange, mode_name: str) -> Callable[[Tally], Change]:
    """Return a change that closes the connection in place of a successful response, in a mode."""

    def make(tally: Tally) -> Change:
        mode = Mode(mode_name)

        def change(request: Request, forward: Forward) -> Response:
            together = mode.begin()
            response: Response | None = None
            try:
                response = forward(request)
                fits = exchange.concerns(request) and response.status in _SUCCESS
                if fits and mode.strikes(together=together):
                    tally()
                    raise HangUpError
                return response
            finally:
                mode.end(response)

        return change

    return make


def hanging(exchange: Exchange) -> Callable[[Tally], Change]:
    """Return a change that does not answer an operation's requests until the client has gone."""

    def make(tally: Tally) -> Change:
        def change(request: Request, forward: Forward) -> Response:
            if not exchange.concerns(request):
                return forward(request)
            tally()
            time.sleep(_HANGS_S)
            raise HangUpError

        return change

    return make


def slower(exchange: Exchange) -> Callable[[Tally], Change]:
    """Return a change that answers an operation later with each request."""

    def make(tally: Tally) -> Change:
        lock, count = threading.Lock(), 0

        def change(request: Request, forward: Forward) -> Response:
            nonlocal count
            if exchange.concerns(request):
                with lock:
                    count += 1
                    later = min(count * _LATER_S, _LATEST_S)
                tally()
                time.sleep(later)
            return forward(request)

        return change

    return make


def showing_insides(exchange: Exchange) -> Callable[[Tally], Change]:
    """Return a change that puts a traceback into the first text of a JSON error."""

    def edit(_request: Request, answer: Response) -> Response | None:
        altered = answer.copy()
        altered.body = re.sub(rb'(:\s*)"[^"\\]*"', lambda found: found[1] + _TRACEBACK, answer.body, count=1)
        bad = answer.status >= _BAD_REQUEST and answer.media_type.endswith("json")
        return altered if bad and altered.body != answer.body else None

    return edit_responses(exchange.concerns, edit)


def edit_responses(where: Callable[[Request], bool], edit: Edit) -> Callable[[Tally], Change]:
    """Return a change that edits responses to some requests; ``edit`` returns None to leave one as it is."""

    def make(tally: Tally) -> Change:
        def change(request: Request, forward: Forward) -> Response:
            response = forward(request)
            altered = edit(request, response) if where(request) else None
            if altered is None:
                return response
            tally()
            return altered

        return change

    return make
