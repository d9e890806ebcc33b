"""The status that other responses are compared with."""

import pytest

from conformance.api.rest.statuses import usual_status
from conformance.transport.exchange import Exchange, Request, Response


@pytest.mark.parametrize(
    ("statuses", "usual"), [((200,), 200), ((404,), 404), ((500, 200), 200), ((503, 500, 404), 404), ((503,) * 3, 503)]
)
def test_a_server_error_now_and_then_is_not_the_usual_status(statuses, usual):
    left = list(statuses)
    request = Request("GET", "http://h/a", (), b"")
    assert usual_status(lambda: Exchange(request, Response(left.pop(0), (), b"", 1.0))) == usual
    assert left == []
