"""Mutants that are wrong only while several clients send requests concurrently."""

import json
import threading
import time
from collections.abc import Callable
from typing import Final

from proof.mutation.changes import Make, Where, inputs, parsed, plain, problem, rest, soap
from proof.mutation.messages import Change, Forward, Request, Response
from proof.mutation.table import Table
from proof.table1.mutants.crowd import COMPANY_S, Crowd, when_crowded
from proof.table1.mutants.paths import GOAL, TNS, VELOCITY
from proof.table1.mutants.soap_responses import envelop

MUTANTS = Table()
_resource = MUTANTS.of_class("rest-resources", "rest")
_mutant = MUTANTS.of_class("http", "rest")

# How long a response waits for another one to be mixed up with, s.
_MEETS_S: Final = 0.05


class _Mixed:
    """A change that mixes up two concurrent responses, every ``nth`` time.

    Args:
        where: chooses the requests whose responses are mixed up.
        mix: takes the first and the second response, and returns what the first and the second client get.
        nth: how often.
    """

    def __init__(self, where: Where, mix: Callable[[Response, Response], tuple[Response, Response]], nth: int) -> None:
        self._where, self._mix, self._nth = where, mix, nth
        self._crowd = Crowd()
        self._lock = threading.Lock()
        self._first: list[Response] = []
        self._met = threading.Event()
        self._seen = 0

    def __call__(self, request: Request, forward: Forward) -> Response:
        if not self._where(request):
            return forward(request)
        with self._crowd.join() as others:
            response = forward(request)
            return self._mixed_up(response) if others() else response

    def _mixed_up(self, response: Response) -> Response:
        with self._lock:
            self._seen += 1
            if self._first:
                return self._meet(response)
            if self._seen % self._nth:
                return response
            mine, met = self._first, self._met = [response], threading.Event()
        met.wait(_MEETS_S)
        with self._lock:
            if len(mine) == 1:
                self._first = []
            return mine[-1]

    def _meet(self, response: Response) -> Response:
        """Mix this response with the one that is waiting, release the waiting client, and return this client's part."""
        first, second = self._mix(self._first[0].copy(), response.copy())
        self._first.append(first)
        self._first = []
        self._met.set()
        return second


def _mix_reads(mix: Callable[[Response, Response], tuple[Response, Response]], nth: int = 1) -> Make:
    def make() -> Change:
        return _Mixed(rest("GET"), mix, nth)

    return make


def _exchange(one: Response, two: Response) -> tuple[Response, Response]:
    return two, one


@_mutant(
    "clients-spliced",
    "concurrent-answers",
    "Two concurrent responses are spliced: one ends with the second half of the other.",
).through(_mix_reads)
def _splice(one: Response, two: Response) -> tuple[Response, Response]:
    half = len(two.body) // 2
    two.body = two.body[:half] + one.body[half:]
    return one, two


def _repeat(one: Response, two: Response) -> tuple[Response, Response]:
    """Give both clients the body of the first response."""
    two.body = one.body
    return one, two


def _twice(request: Request, forward: Forward) -> Response:
    forward(request)
    return forward(request)


def _with_another_source(request: Request, forward: Forward) -> Response:
    """Forward a delivery with another client's source_y, as if all clients shared a variable."""
    head, _, _ = request.target.rpartition("/")
    return forward(request.copy(target=f"{head}/1.5"))


def _as_created(response: Response) -> Response:
    response = response.copy()
    if response.status in {200, 202, 204}:
        response.status, response.reason = 201, ""
    return response


@_resource(
    "clients-goal-doubled",
    "goal-concurrent",
    "A goal that two clients send concurrently becomes two goals; one continues after the other is cancelled.",
)
class _GoalOfTwo:
    def __init__(self) -> None:
        self._crowd = Crowd()
        self._second: Request | None = None

    def __call__(self, request: Request, forward: Forward) -> Response:
        if _PUT_GOAL(request):
            with self._crowd.join() as others:
                time.sleep(COMPANY_S)
                if others():
                    self._second = request.copy()
                return forward(request)
        response = forward(request)
        second = self._second
        if rest("DELETE", GOAL)(request) and second is not None:
            self._second = None
            inputs(lambda value: {**value, "goal_id": {"id": "the other one"}})(second)
            forward(second)
        return response


class _OneServed:
    """A change that serves one read at a time; others meanwhile get 429."""

    def __init__(self) -> None:
        self._serving = threading.Lock()

    def __call__(self, request: Request, forward: Forward) -> Response:
        if not rest("GET")(request):
            return forward(request)
        if not self._serving.acquire(blocking=False):
            return problem(503, "busy", ("Retry-After", "1"))(request)
        try:
            time.sleep(_MEETS_S)
            return forward(request)
        finally:
            self._serving.release()


class _Blended:
    """A change that gives concurrent requests the same value of one JSON member: that of the first request."""

    def __init__(self, where: Where, field: str) -> None:
        self._where, self._field = where, field
        self._crowd = Crowd()
        self._last: object = None

    def __call__(self, request: Request, forward: Forward) -> Response:
        if not self._where(request):
            return forward(request)
        with self._crowd.join() as others:
            value = parsed(request.body)
            own = value.get(self._field) if isinstance(value, dict) else None
            other, self._last = self._last, own
            time.sleep(COMPANY_S)
            if others() and own is not None and other is not None:
                request = request.copy(body=json.dumps({**value, self._field: other}).encode())
            return forward(request)


_PUT_GOAL, _PUT_VELOCITY = rest("PUT", GOAL), rest("PUT", VELOCITY)
_SMALL: Final = 32 * 1024
_EMPTY = plain(204)
_SOAP_DELIVERY = soap("ExecuteDeliveryRequest")
_ACCEPTED = envelop(f'<t:ExecuteDeliveryRequestResponse xmlns:t="{TNS}"/>')

_resource(
    "clients-goal-new-to-all", "goal-concurrent", "Every client that sends the same new goal concurrently gets 201."
).made(when_crowded(_PUT_GOAL, lambda request, forward: _as_created(forward(request))))
