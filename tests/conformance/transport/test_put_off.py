"""A request that an overloaded device puts off is sent again, within bounds of time."""

import itertools

import pytest

from conformance.transport import pace
from conformance.transport.client import Connection
from conformance.transport.exchange import Exchange, Request, Response
from conformance.transport.pace import Overload
from conformance.transport.parallel import until_taken

_NOW = ("Date", "Fri, 20 Nov 2026 22:59:50 GMT")


def _response(status: int, after: str | None) -> Response:
    return Response(status, (_NOW,) if after is None else (_NOW, ("Retry-After", after)), b"", 1.0)


@pytest.fixture(autouse=True, name="slept")
def _slept(monkeypatch):
    slept = []
    monkeypatch.setattr(pace.time, "sleep", slept.append)
    return slept


def _statuses(*answers: tuple[int, str | None], patience_s: float = 120.0) -> list[int]:
    left = list(answers)
    connection = Connection(overload=Overload(patience_s))
    request = Request("PUT", "http://robot/")
    sent = until_taken(connection, lambda: Exchange(request, _response(*(left.pop(0) if len(left) > 1 else left[0]))))
    return [one.response.status for one in sent]


def test_what_is_put_off_is_sent_again_until_it_is_taken():
    assert _statuses((503, "0"), (429, "0"), (204, None)) == [503, 429, 204]


def test_who_puts_everything_off_is_given_up():
    assert _statuses((503, "0")) == [503] * 3
    assert _statuses((429, None)) == [429] * 6


@pytest.mark.parametrize("answer", [(503, None), (503, "3600"), (429, "Fri, 20 Nov 2026 23:00:10 GMT"), (500, "0")])
def test_what_is_not_put_off_for_a_while_is_taken_as_it_is(answer):
    assert _statuses(answer, (204, None)) == [answer[0]]


def test_a_run_does_not_wait_for_ever():
    assert _statuses((503, "2"), (204, None), patience_s=1.0) == [503]


@pytest.mark.parametrize(
    ("status", "after", "seconds"),
    [
        (429, "7", 7),
        (503, "Fri, 20 Nov 2026 23:00:00 GMT", 10),
        (503, "Fri, 20 Nov 2026 22:00:00 GMT", 0),
        (429, None, 0),
        (429, "9" * 5000, 0),  # more digits than int takes
        (503, "soon", None),
        (503, "Fri, 20 Nov 2026 99:00:00 GMT", None),  # no time
        (204, "7", None),
    ],
)
def test_for_how_long_a_request_is_put_off(status, after, seconds):
    assert _response(status, after).put_off_s == seconds


@pytest.mark.parametrize(("after", "longest_s"), [("3600", 0), ("60", 60), (None, 90)])
def test_a_limit_that_all_requests_share_ends_the_run(after, longest_s, slept):
    overload, ends = Overload(), []
    overload.ended = ends.append
    names = itertools.cycle(["GET /a", "GET /b"])
    for _ in range(20):
        name = next(names)
        tries = 1
        while overload.waits(_response(429, after), lambda name=name: name, tries):
            tries += 1
    assert len(ends) >= 1
    assert "Retry-After " + (after or "missing") in ends[0]
    assert sum(slept) <= longest_s
    assert overload.waits(_response(200, None), lambda: "GET /a", 1) is False
    assert overload.waits(_response(429, "1"), lambda: "GET /a", 1)  # the row has ended
