import pytest

from conformance.transport.client import Connection
from conformance.transport.exchange import Exchange, Request, Response
from conformance.transport.parallel import put_off_s, until_taken


def _exchange(status: int, after: str | None) -> Exchange:
    fields = () if after is None else (("Retry-After", after),)
    return Exchange(Request("PUT", "http://robot/"), Response(status, fields, b"", 1.0))


def _statuses(*answers: tuple[int, str | None], patience_s: float = 120.0) -> list[int]:
    left = list(answers)
    connection = Connection(patience_s=patience_s)
    sent = until_taken(connection, lambda: _exchange(*(left.pop(0) if len(left) > 1 else left[0])))
    return [one.response.status for one in sent]


def test_what_is_put_off_is_sent_again_until_it_is_taken():
    assert _statuses((503, "0"), (429, "0"), (204, None)) == [503, 429, 204]


def test_who_puts_everything_off_is_given_up():
    assert _statuses((503, "0")) == [503] * 6


@pytest.mark.parametrize("answer", [(503, None), (503, "3600"), (503, "Fri, 20 Nov 2026 23:00:00 GMT"), (500, "0")])
def test_what_is_not_put_off_for_a_while_is_taken_as_it_is(answer):
    assert _statuses(answer, (204, None)) == [answer[0]]


def test_a_run_does_not_wait_for_ever():
    assert _statuses((503, "2"), (204, None), patience_s=1.0) == [503]


def test_for_how_long_a_request_is_put_off():
    assert put_off_s(_exchange(429, "7")) == 7
    assert put_off_s(_exchange(204, "7")) is None
    assert put_off_s(_exchange(429, "9" * 5000)) is None  # more digits than int takes
