"""A robot with artificial noise, for `calibration.py`: `python noisy_robot.py SEED SHIFT` prints its port.

It returns the pose over REST and SOAP after a time that is log-normal around a drifting level, a first-order
autoregressive series, as on a shared machine. Over SOAP the time is multiplied by SHIFT. It runs with real-time
priority where that is allowed, so that the machine adds little noise of its own.
"""

import json
import math
import random
import sys
import time
from socketserver import StreamRequestHandler, ThreadingTCPServer
from threading import Lock

from loadtests.measuring.machine import first_in_line

LEVEL_S = 0.020  # beside which the transport's own 0.2 ms hardly dilute what is planted
FAST, DRIFT, MEMORY_S = 0.2, 0.1, 2.0  # standard deviations on the logarithmic scale; how long the level remembers

_AXES = {"x": 0.0, "y": 0.0, "z": 0.0}
_POSE = {
    "header": {"stamp": {"sec": 1, "nanosec": 2}, "frame_id": "odom"},
    "child_frame_id": "base_link",
    "pose": {"pose": {"position": _AXES, "orientation": _AXES | {"w": 1.0}}, "covariance": [0.0] * 36},
    "twist": {"twist": {"linear": _AXES, "angular": _AXES}, "covariance": [0.0] * 36},
}


def _xml(name: str, value: object) -> str:
    if isinstance(value, dict):
        return f"<{name}>{''.join(_xml(key, inner) for key, inner in value.items())}</{name}>"
    if isinstance(value, list):
        return "".join(_xml(name, inner) for inner in value)
    return f"<{name}>{value}</{name}>"


_REST = ("application/json", json.dumps(_POSE).encode())
_SOAP = (
    "text/xml",
    (
        '<S:Envelope xmlns:S="http://schemas.xmlsoap.org/soap/envelope/"><S:Body>'
        f'<n:GetPoseResponse xmlns:n="http://soap.turtlebot.mybot.org/">{_xml("return", _POSE)}</n:GetPoseResponse>'
        "</S:Body></S:Envelope>"
    ).encode(),
)


class Noise:
    """The level of the noise, and the time when it was last read."""

    def __init__(self, seed: int, shift: float) -> None:
        self._random = random.Random(seed)  # noqa: S311 -- noise, no secret
        self._shift = shift
        self._level = self._random.gauss(0.0, DRIFT)
        self._at = time.monotonic()
        self._lock = Lock()

    def takes_s(self, *, soap: bool) -> float:
        """Return how long the next response takes."""
        with self._lock:
            now = time.monotonic()
            kept = math.exp(-(now - self._at) / MEMORY_S)
            self._level = kept * self._level + math.sqrt(1 - kept * kept) * self._random.gauss(0.0, DRIFT)
            self._at = now
            return LEVEL_S * math.exp(self._level + self._random.gauss(0.0, FAST)) * (self._shift if soap else 1.0)


class Answers(StreamRequestHandler):
    """A request handler for the requests of one connection."""

    disable_nagle_algorithm = True
    noise: Noise

    def handle(self) -> None:
        """Respond to requests until the client disconnects."""
        with first_in_line(wanted=True):
            while self._answered():
                pass

    def _answered(self) -> bool:
        """Read a request and respond to it; return False at the end of the connection."""
        lines = [self.rfile.readline()]
        while lines[-1] not in {b"\r\n", b""}:
            lines.append(self.rfile.readline())
        if not lines[-1]:  # the connection was closed
            return False
        soap = lines[0].startswith(b"POST")
        due = time.monotonic() + self.noise.takes_s(soap=soap)
        lengths = [line.split(b":")[1] for line in lines if line.lower().startswith(b"content-length:")]
        self.rfile.read(int(lengths[0]) if lengths else 0)
        kind, body = _SOAP if soap else _REST
        answer = f"HTTP/1.1 200 OK\r\nContent-Type: {kind}\r\nContent-Length: {len(body)}\r\n\r\n".encode() + body
        time.sleep(max(0.0, due - time.monotonic()))
        self.wfile.write(answer)
        return True


class Robot(ThreadingTCPServer):
    """A thread for each connection: time.sleep is right to 0.1 ms, where asyncio's sleep rounds up to milliseconds."""

    daemon_threads = True
    request_queue_size = 128

    def handle_error(self, request: object, client_address: object) -> None:
        """Ignore a client that has disconnected."""


def main() -> None:
    """Serve until killed."""
    Answers.noise = Noise(int(sys.argv[1]), float(sys.argv[2]))
    with Robot(("127.0.0.1", 0), Answers) as robot:
        print(robot.server_address[1], flush=True)
        robot.serve_forever()


if __name__ == "__main__":
    main()
