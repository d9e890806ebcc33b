"""Load on one HTTP request by wrk, whose connections each send the next request after a response; and in turns."""

import gc
import json
import os
import re
import socket
import statistics
import subprocess
import tempfile
import time
from dataclasses import dataclass

_DEADLINE = 10.0  # seconds for an answer
_LENGTH = re.compile(rb"\r\ncontent-length: (\d+)", re.IGNORECASE)
_SUMMARY = """
done = function(summary, latency, requests)
  local errors = summary.errors
  local shape = '{"requests": %d, "seconds": %f, "median_us": %f, "p99_us": %f, "errors": %d}\\n'
  io.write(string.format(shape, summary.requests, summary.duration / 1e6,
    latency:percentile(50), latency:percentile(99),
    errors.connect + errors.read + errors.write + errors.status + errors.timeout))
end
"""


@dataclass(frozen=True)
class Call:
    """An HTTP request to be repeated."""

    host: str
    port: int
    method: str
    target: str
    body: str = ""
    content_type: str = ""

    def octets(self) -> bytes:
        """Return the request as it goes over the wire."""
        fields = f"Host: {self.host}:{self.port}\r\n"
        if self.body:
            fields += f"Content-Type: {self.content_type}\r\nContent-Length: {len(self.body.encode())}\r\n"
        return f"{self.method} {self.target} HTTP/1.1\r\n{fields}\r\n{self.body}".encode()


@dataclass(frozen=True)
class Load:
    """The result of a load: requests with a response, failures among them, and the response times in µs."""

    requests: int
    seconds: float
    median_us: float
    p99_us: float
    errors: int

    @property
    def rate(self) -> float:
        """Return the number of requests per second."""
        return self.requests / self.seconds


def load(call: Call, connections: int, seconds: float, cpus: set[int] | None = None) -> Load:
    """Repeat a request over several connections for a time, by wrk.

    Args:
        call: the request.
        connections: number of connections, each with one request under way.
        seconds: the duration.
        cpus: the processors that the loader may use; None for all.
    """
    script = f"wrk.method = {json.dumps(call.method)}\n"
    if call.body:
        script += f"wrk.body = {json.dumps(call.body)}\nwrk.headers['Content-Type'] = {json.dumps(call.content_type)}\n"
    with tempfile.NamedTemporaryFile("w", suffix=".lua") as lua:
        lua.write(script + _SUMMARY)
        lua.flush()
        url = f"http://{call.host}:{call.port}{call.target}"
        command = ["wrk", "-t1", f"-c{connections}", f"-d{max(1, round(seconds))}s", "-s", lua.name, url]
        pinned = ["taskset", "-c", ",".join(map(str, cpus or os.sched_getaffinity(0))), *command]
        done = subprocess.run(pinned, check=True, capture_output=True, text=True)
    return Load(**json.loads(done.stdout.splitlines()[-1]))


def alternately(calls: list[Call], rate: float, seconds: float) -> list[Load]:
    """Send each request once in turn, at a rate of so many turns per second, each after the response to the last.

    Short turns expose all servers to the same disturbances of the machine. The first request of a turn finds the
    processors asleep, and the second finds them awake: each turn begins with the next request.
    """
    connections = [_Connection(call.host, call.port, call.octets()) for call in calls]
    seen: list[list[tuple[float, bool]]] = [[] for _ in calls]
    started = time.perf_counter()
    gc.disable()
    for turn in range(round(rate * seconds)):
        time.sleep(max(0.0, started + turn / rate - time.perf_counter()))
        for place in range(turn, turn + len(connections)):
            connection = connections[place % len(connections)]
            connection.send()
            while (outcome := connection.received()) is None:
                pass
            seen[place % len(connections)].append(outcome)
    gc.enable()
    took = time.perf_counter() - started
    for connection in connections:
        connection.socket.close()
    return [_load_of([at for at, _ in answers], sum(not ok for _, ok in answers), took) for answers in seen]


def _load_of(times: list[float], errors: int, seconds: float) -> Load:
    p99 = statistics.quantiles(times, n=100)[-1]
    return Load(len(times), seconds, statistics.median(times) * 1e6, p99 * 1e6, errors)


class _Connection:
    def __init__(self, host: str, port: int, request: bytes) -> None:
        self.socket = socket.create_connection((host, port), timeout=_DEADLINE)
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._request = request
        self._answer = b""
        self._sent = 0.0

    def send(self) -> None:
        self._answer, self._sent = b"", time.perf_counter()
        self.socket.sendall(self._request)

    def received(self) -> tuple[float, bool] | None:
        """Return seconds and success once the answer is complete, None before."""
        octets = self.socket.recv(65536)
        if not octets:
            raise ConnectionError("the server closed the connection")
        self._answer += octets
        head, end, rest = self._answer.partition(b"\r\n\r\n")
        length = _LENGTH.search(head)
        if not end or len(rest) < (int(length[1]) if length else 0):
            return None
        return time.perf_counter() - self._sent, head[9:10] == b"2"
