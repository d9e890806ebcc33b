"""A device behind a gateway is blamed where a request makes it go away, and not where it is away for a moment."""

import http.client
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from urllib.parse import urlsplit

from small_device import certified
from test_lost_device import arm, only_failure

_OWN = {"connection", "content-length", "date", "host", "server", "transfer-encoding"}


class _Gateway(BaseHTTPRequestHandler):
    """Forwards to ``server.device``; where that fails, or while ``server.absent``, responds ``server.status``."""

    protocol_version = "HTTP/1.1"

    def parse_request(self) -> bool:
        understood = super().parse_request()
        if understood:
            setattr(self, f"do_{self.command}", self._forward)
        return understood

    def _forward(self) -> None:
        body = self.rfile.read(int(self.headers.get("Content-Length", "0")))
        fields = {name: value for name, value in self.headers.items() if name.lower() not in _OWN}
        self.server.count += 1
        device = http.client.HTTPConnection(self.server.device, timeout=self.server.patience_s)
        try:
            if self.server.count in self.server.absent:
                raise ConnectionRefusedError
            device.request(self.command, self.path, body or None, fields)
            answer = device.getresponse()
            status, content, fields = answer.status, answer.read(), answer.getheaders()
        except (OSError, http.client.HTTPException):
            status, content, fields = self.server.status, b"<h1>no device</h1>", [("Content-Type", "text/html")]
        finally:
            device.close()
        self.send_response(status)
        for name, value in fields:
            if name.lower() not in _OWN:
                self.send_header(name, value)
        if status != http.HTTPStatus.NO_CONTENT:
            self.send_header("Content-Length", str(len(content)))
        self.end_headers()
        self.wfile.write(content if self.command != "HEAD" else b"")

    def log_message(self, *_: object) -> None:
        """Say nothing."""


@contextmanager
def gateway(device: str, status: int, absent: range, patience_s: float) -> Iterator[str]:
    with ThreadingHTTPServer(("127.0.0.1", 0), _Gateway) as server:
        server.device, server.status, server.absent, server.count = urlsplit(device).netloc, status, absent, 0
        server.patience_s = patience_s
        threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()


def judged(how, status, folder, *, restart=False, absent=range(0)):
    # Only a device that hangs makes anybody wait; on a busy machine the others may take long to respond.
    patience_s = 4 if how == "hang" else 60
    with arm(how, folder) as (device, command), gateway(device, status, absent, patience_s) as url:
        # A device that is away for some requests is back after them, however long the suite takes to send these.
        more = ("--restart-command", command) if restart else ("--wait", "60" if how == "well" else "1")
        classes = ("--class", "description", "--class", "robustness")
        return certified(f"{url}/openapi.json", folder / "out", "--timeout", 3 * patience_s, *more, *classes)


def test_a_healthy_device_that_a_gateway_misses_once_is_not_blamed(tmp_path):
    outcome = judged("well", 503, tmp_path, absent=range(20, 21))
    assert "robustness/no-crash" not in outcome.blamed, outcome.text


def test_a_device_that_stays_lost_fails_by_the_request_that_did_it(tmp_path):
    outcome = judged("hang", 504, tmp_path)
    assert outcome.exit_code == 1
    failure = only_failure(outcome, "robustness/no-hang")
    assert "/pose?z=" in failure["request"]["url"]
    assert "a gateway responded 504 in the device's place" in failure["message"]


def test_a_request_that_does_it_again_is_the_devices_fault(tmp_path):
    outcome = judged("exit", 503, tmp_path, restart=True)
    assert outcome.exit_code == 1
    failure = only_failure(outcome, "robustness/no-crash")
    assert failure["request"]["url"].endswith(("z=1e%2B308", "z=-1e%2B308"))
    assert "did it again" in failure["message"]


def test_a_device_that_is_away_for_a_moment_is_inconclusive(tmp_path):
    outcome = judged("well", 502, tmp_path, absent=range(30, 36))
    assert (outcome.exit_code, outcome.blamed) == (4, {}), outcome.text
    assert "cannot tell: a gateway responded 502" in outcome.text
