"""Of a body that does not end the beginning is a response; what is silent, or finite and slow, is none."""

import threading
import time

import pytest
from toy_server import Handler, server_of

from conformance.transport.client import Connection, HttpClient
from conformance.transport.exchange import NoAnswerError


class _Endless(Handler):
    """Serves at /TYPE/SUBTYPE/WHAT: WHAT is `drips`, `floods`, `silent`, or a number of octets."""

    def answer(self) -> None:
        media_type, _, what = self.path[1:].rpartition("/")
        self.send_response(200)
        self.send_header("Content-Type", media_type)
        if what.isdigit():
            self.send_header("Content-Length", what)
            self.end_headers()
            self.wfile.write(b"x" * min(int(what), 1 << 26))
            return
        self.send_header("Connection", "close")
        self.end_headers()
        self.wfile.flush()
        self.close_connection = True
        try:
            while what != "silent" or not self.server.over.is_set():
                if what == "floods":
                    self.wfile.write(b"x" * 65536)
                    continue
                if what == "drips":
                    self.wfile.write(b"data: 1\n\n")
                    self.wfile.flush()
                if self.server.over.wait(0.02):
                    return
        except OSError:
            return


@pytest.fixture
def url():
    with server_of(_Endless, over=threading.Event()) as server:
        yield server.url
        server.over.set()


def _get(url: str, path: str, *, endless: bool = True):
    return HttpClient(url, Connection(timeout_s=1.5, endless=endless)).send("GET", path).response


@pytest.mark.parametrize(
    ("path", "cut"),
    [
        ("/text/event-stream/drips", True),
        ("/text/event-stream/floods", True),
        ("/text/event-stream/silent", True),
        ("/multipart/x-mixed-replace/drips", True),
        ("/video/mp4/floods", True),
        ("/text/plain/drips", True),
        ("/application/octet-stream/floods", True),
        ("/application/octet-stream/50000000", True),
        ("/application/octet-stream/50", False),
        ("/text/event-stream/9", False),
    ],
)
def test_an_endless_body_is_a_response(url, path, cut):
    started = time.monotonic()
    response = _get(url, path)
    assert (response.status, bool(response.cut)) == (200, cut)
    assert len(response.body) < 6_000_000
    assert time.monotonic() - started < 60


@pytest.mark.parametrize(
    ("path", "endless"),
    [("/text/plain/silent", True), ("/application/json/drips", True), ("/text/event-stream/drips", False)],
)
def test_what_hangs_is_no_response(url, path, endless):
    with pytest.raises(NoAnswerError, match="no response within") as error:
        _get(url, path, endless=endless)
    assert error.value.kind == "timeout"
