"""Tracebacks and paths in an error are internals, unless the request had them."""

import json

import pytest

from conformance.documents.traceback import inside_shown, path_shown
from conformance.transport.exchange import Exchange, Request, Response


def _exchange(answer, target="/x", body=b"", **headers):
    request = Request("GET", f"http://r{target}", tuple(headers.items()), body)
    return Exchange(request, Response(404, (), answer.encode(), 1.0))


@pytest.mark.parametrize(
    ("answer", "sent"),
    [
        ("no page /etc/robot/passwd.", {"target": "/etc/robot/passwd"}),
        ("no page /etc/robot/passwd", {"target": "/%65tc/robot/passwd"}),
        ("no page /etc/robot/a b", {"target": "/x?f=%2Fetc%2Frobot%2Fa+b"}),
        ('{"error": "\\/home\\/robot\\/a"}', {"target": "/x?f=/home/robot/a"}),
        ("<p>&#x2F;home/robot/a</p>", {"body": b"/home/robot/a"}),
        ("/HOME/robot/a: not found".replace("HOME", "home"), {"target": "/HOME/robot/a"}),
        ("bad value Traceback (most recent call last)", {"body": b"Traceback (most recent call last)"}),
        ("bad value java.lang.RuntimeException", {"Accept": "java.lang.RuntimeException"}),
        (json.dumps({"got": 'File "/a/b.py", line 3'}), {"body": b'File "/a/b.py", line 3'}),
        (json.dumps({"got": 'File "/a/b.py", line 3'}), {"target": "/x?q=File+%22%2Fa%2Fb.py%22%2C+line+3"}),
        ("C:\\\\robot\\\\maps\\\\a", {"body": b"C:\\robot\\maps\\a"}),
    ],
)
def test_what_the_request_had_is_no_internal(answer, sent):
    exchange = _exchange(answer, **sent)
    assert (inside_shown(exchange), path_shown(exchange)) == ("", "")


@pytest.mark.parametrize(
    ("answer", "sent"),
    [
        ("Traceback (most recent call last)", {}),
        ('Traceback (most recent call last): File "/app/robot/main.py", line 3', {"body": b"Traceback"}),
        ('Traceback (most recent call last)\n File "/a.py", line 3', {"body": b"Traceback (most recent call last)"}),
        ("cannot open /srv/www/html/etc/robot", {"target": "/etc/robot"}),
        ("no /etc/robot/passwd in /var/lib/robot/pages", {"target": "/etc/robot/passwd"}),
    ],
)  # fmt: skip
def test_what_it_had_not_is_one(answer, sent):
    exchange = _exchange(answer, **sent)
    assert inside_shown(exchange) or path_shown(exchange)
