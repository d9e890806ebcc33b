"""Listen to streams of a robot's state, and poll beside them: rate, jitter, gaps, and the age of the data on arrival.

Streams are server-sent events (HTML Living Standard, section 9.2) and WebSocket messages (RFC 6455). The age is this
machine's clock less the stamp in a message. It includes what the clocks of two machines differ by.
"""

import time
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from datetime import UTC, datetime
from http import HTTPStatus
from typing import Any

import gevent
import gevent.socket
import httptools
import msgspec
from jsonpath import JSONPointer
from websockets.client import ClientProtocol
from websockets.exceptions import InvalidHandshake
from websockets.frames import Frame, Opcode
from websockets.uri import parse_uri

from loadtests.clients.described import Stream
from loadtests.clients.endpoint import Endpoint
from loadtests.clients.failures import CallError, connect_error
from loadtests.clients.robot import Robot
from loadtests.clients.rosbridge import bridge_endpoint
from loadtests.clients.wire import now_ns
from loadtests.settings.settings import Settings

_CHUNK = 65_536
_MOST_MESSAGES = 200_000
_MOST_BYTES = 16 * 1024 * 1024
_POLLS = 20.0
#: Numbers from these on are Unix time in nanoseconds, microseconds and milliseconds: as seconds they lie after 5000.
_UNITS = ((1e17, 1e9), (1e14, 1e6), (1e11, 1e3))


@dataclass
class Heard:
    """What came over one stream, or by polling one operation.

    Attributes:
        kind: `sse`, `websocket` or `polling`.
        moments_ns: when each message came, monotonic.
        ages_ms: how old the data of each message with a stamp was.
        listened_s: for how long.
        error: why it ended before its time, or None.
    """

    name: str
    kind: str
    moments_ns: list[int] = field(default_factory=list)
    ages_ms: list[float] = field(default_factory=list)
    listened_s: float = 0.0
    error: str | None = None

    def take(self, message: bytes, pointer: JSONPointer | None) -> None:
        """Record a message that has just come."""
        if len(self.moments_ns) >= _MOST_MESSAGES:
            return
        self.moments_ns.append(now_ns())
        stamp = None if pointer is None else stamp_s(message, pointer)
        if stamp is not None:
            self.ages_ms.append((time.time() - stamp) * 1e3)


def stamp_s(message: bytes, pointer: JSONPointer) -> float | None:
    """Return the stamp in a JSON message as Unix time: a number, an ISO 8601 text, or ROS's sec and nanosec."""
    try:
        value: Any = pointer.resolve(msgspec.json.decode(message), default=None)
        if isinstance(value, dict):
            whole: Any = value.get("sec", value.get("secs"))
            part: Any = value.get("nanosec", value.get("nsecs", 0))
            return float(whole) + float(part) / 1e9
        if isinstance(value, str) and not value.replace(".", "", 1).isdigit():
            moment = datetime.fromisoformat(value)
            return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()
        number = float(value)
    except (msgspec.DecodeError, ValueError, TypeError):
        return None
    return number / next((unit for least, unit in _UNITS if number >= least), 1.0)


def hear(robot: Robot, settings: Settings, stopped: Callable[[], bool], tell: Callable[[str], None]) -> list[Heard]:
    """Listen to the streams of the settings for as long as the comparison took, and poll the first read beside them."""
    wanted, load = settings.streams, settings.load
    if not (wanted.listen or wanted.stamp) or stopped():
        return []
    tell(f"listening to {', '.join(each.name for each in wanted.listen) or 'polls'} for {load.duration_s:g} s")
    polled = next((each.name for each in robot.described if each.method == "GET"), None)
    return listen(robot, wanted.listen, polled, wanted.stamp, load.duration_s, settings.limits.max_rate, stopped)


def listen(
    robot: Robot,
    streams: Sequence[Stream],
    polled: str | None,
    pointer: str | None,
    seconds: float,
    rate: float | None,
    stopped: Callable[[], bool],
) -> list[Heard]:
    """Listen to all streams at once, and poll an operation meanwhile; never raises for what the robot does.

    Args:
        robot: addresses and credentials.
        streams: what to listen to.
        polled: the operation to poll, or None.
        pointer: JSON pointer (RFC 6901) to the stamp in each message.
        seconds: for how long.
        rate: the highest rate of the polls, per second.
        stopped: returns whether to end.
    """
    stamp = None if pointer is None else JSONPointer(pointer)
    jobs: list[tuple[Heard, Callable[[Heard], None]]] = [
        (Heard(each.name, each.kind), lambda one, each=each: _HEAR[each.kind](robot, each, one, stamp))  # type: ignore[misc]
        for each in streams
    ]
    if polled is not None:
        polls = min(rate or _POLLS, _POLLS)
        jobs.append((Heard(polled, "polling"), lambda one: _poll(robot, one, stamp, polls)))
    work = [gevent.spawn(_guarded, run, one) for one, run in jobs]
    until = time.monotonic() + seconds
    while time.monotonic() < until and not stopped() and not all(job.ready() for job in work):
        gevent.sleep(0.05)
    gevent.killall(work)
    return [one for one, _ in jobs]


def _guarded(run: Callable[[Heard], None], one: Heard) -> None:
    began = time.monotonic()
    try:
        run(one)
        one.error = f"the robot ended it after {len(one.moments_ns)} messages"
    except (CallError, OSError, httptools.HttpParserError) as error:
        one.error = str(error) or type(error).__name__
    finally:
        one.listened_s = time.monotonic() - began


def _poll(robot: Robot, one: Heard, pointer: JSONPointer | None, rate: float) -> None:
    request = robot.requests("rest", one.name, 0)[0]
    with closing(robot.http("rest", one.name)) as connection:
        due = time.monotonic()
        while True:
            gevent.sleep(max(0.0, due - time.monotonic()))
            due += 1 / rate
            answer = connection.call(request)
            answer.require_good(request.expects)
            one.take(answer.body, pointer)


def _connect(endpoint: Endpoint, robot: Robot, url: str) -> Any:
    """Return a connected socket, without a deadline for reading: the measurement ends by itself."""
    try:
        plain = gevent.socket.create_connection((endpoint.host, endpoint.port), robot.timeout_s)
        if endpoint.scheme in {"https", "wss"}:
            plain = robot.context().wrap_socket(plain, server_hostname=endpoint.host)
        plain.settimeout(None)
    except OSError as error:
        raise connect_error(error, url) from None
    return plain


class _Events:
    """The events of a response's body; llhttp calls its methods."""

    def __init__(self, take: Callable[[bytes], None]) -> None:
        self._take = take
        self._rest = b""
        self.parser: Any = httptools.HttpResponseParser(self)
        self.media_type = b""

    def on_header(self, name: bytes, value: bytes) -> None:
        if name.lower() == b"content-type":
            self.media_type = value.partition(b";")[0].strip().lower()

    def on_headers_complete(self) -> None:
        status = self.parser.get_status_code()
        if status != HTTPStatus.OK:
            raise CallError("status", f"status {status}")
        if self.media_type != b"text/event-stream":
            raise CallError("content", f"it is {self.media_type.decode('latin-1') or 'no media type'}, no event stream")

    def on_body(self, body: bytes) -> None:
        *events, self._rest = (self._rest + body).replace(b"\r\n", b"\n").split(b"\n\n")
        if len(self._rest) > _MOST_BYTES:
            raise CallError("malformed", f"an event is longer than {_MOST_BYTES} bytes")
        for event in events:
            lines = [line[5:].removeprefix(b" ") for line in event.split(b"\n") if line.startswith(b"data:")]
            if lines:
                self._take(b"\n".join(lines))


def _hear_events(robot: Robot, stream: Stream, one: Heard, pointer: JSONPointer | None) -> None:
    events = _Events(lambda message: one.take(message, pointer))
    with closing(_connect(Endpoint.parse(stream.url), robot, stream.url)) as plain:
        plain.sendall(robot.fixed.revealed(stream.octets))
        while data := plain.recv(_CHUNK):
            try:
                events.parser.feed_data(data)
            except httptools.HttpParserCallbackError as error:
                raise error.__context__ or error from None


def _hear_messages(robot: Robot, stream: Stream, one: Heard, pointer: JSONPointer | None) -> None:
    protocol, pieces = ClientProtocol(parse_uri(stream.url), max_size=_MOST_BYTES), list[bytes]()
    endpoint = bridge_endpoint(stream.url)
    handshake = protocol.connect()
    if robot.rest and Endpoint.parse(robot.rest).host == endpoint.host:  # no other host gets them
        for name, value in robot.fixed.fields("GET", handshake.path):
            handshake.headers[name] = value
    protocol.send_request(handshake)
    with closing(_connect(endpoint, robot, stream.url)) as plain:
        plain.sendall(b"".join(protocol.data_to_send()))
        while data := plain.recv(_CHUNK):
            protocol.receive_data(data)
            for event in protocol.events_received():
                if isinstance(event, Frame) and event.opcode in {Opcode.TEXT, Opcode.BINARY, Opcode.CONT}:
                    pieces.append(bytes(event.data))
                    if event.fin:
                        one.take(b"".join(pieces), pointer)
                        pieces.clear()
            if protocol.handshake_exc is not None:
                words = "it does not speak WebSocket" if isinstance(protocol.handshake_exc, InvalidHandshake) else ""
                raise CallError("status", f"{words}: {protocol.handshake_exc}".lstrip(": "))
            plain.sendall(b"".join(protocol.data_to_send()))  # answers to pings


_HEAR = {"sse": _hear_events, "websocket": _hear_messages}
