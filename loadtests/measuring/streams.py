"""Listen to streams of a robot's state, and poll beside them: rate, jitter, gaps, and the age of the data.

Streams are server-sent events (HTML Living Standard, section 9.2), WebSocket messages (RFC 6455), and topics of a
rosbridge (its protocol v2, section 3.4). The age is this machine's clock less the stamp in a message. The polls show
what the robot's clock differs by from this machine's.
"""

import time
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from http import HTTPStatus
from typing import Any
from urllib.parse import urldefrag

import gevent
import gevent.socket
import httptools
import msgspec
import numpy as np
from jsonpath import JSONPointer
from websockets.client import ClientProtocol
from websockets.exceptions import InvalidHandshake
from websockets.frames import Frame, Opcode
from websockets.http11 import Response
from websockets.uri import parse_uri

from loadtests.clients.endpoint import Endpoint
from loadtests.clients.failures import CallError, clip, connect_error
from loadtests.clients.robot import Robot, Stream
from loadtests.clients.rosbridge import bridge_endpoint
from loadtests.clients.wire import now_ns
from loadtests.measuring.clocks import RobotClock, stamp_of
from loadtests.measuring.robot_process import is_here, same_machine
from loadtests.settings.settings import Settings, Streams
from loadtests.statistics.figures import rounded
from loadtests.statistics.histogram import SHARES
from loadtests.statistics.intervals import samples_for_point
from loadtests.statistics.recorder import Offset

_GAP = 2.0
_ENOUGH = 3


def stream_figures(
    moments_ns: Sequence[int], ages_ms: Sequence[float], listened_s: float, offset: Offset | None
) -> dict[str, Any]:
    """Return figures on the messages of a stream; None where there are too few.

    A gap is an interval of more than twice the median; the jitter is the intervals' standard deviation.

    Args:
        moments_ns: when each came.
        ages_ms: our clock less the stamp, of those with a stamp.
        listened_s: for how long they were waited for.
        offset: the offset of the robot's clock; None where it is not known, so that the ages are not known either.
    """
    intervals = np.diff(np.array(moments_ns, dtype=np.float64)) / 1e6
    found: dict[str, Any] = {
        "messages": len(moments_ns),
        "listened_s": rounded(listened_s),
        "rate": None,
        "interval_ms": None,
        "jitter_ms": None,
        "gaps": None,
        "stamped": len(ages_ms),
        "clock_offset_ms": None if offset is None else rounded(offset.middle_s * 1e3),
        "age_ms": None if offset is None else _spread([age + offset.middle_s * 1e3 for age in ages_ms]),
        "age_error_ms": None if offset is None else rounded(offset.error_s * 1e3),
    }
    if len(intervals) >= _ENOUGH:
        limit = _GAP * float(np.median(intervals))
        found |= {
            "rate": rounded(1e3 * len(intervals) / float(intervals.sum())) if intervals.sum() else None,
            "interval_ms": _spread(intervals.tolist()),
            "jitter_ms": rounded(float(intervals.std(ddof=1))),
            "gaps": {"longer_than_ms": rounded(limit), "count": int((intervals > limit).sum())},
        }
    return found


def _spread(values: Sequence[float]) -> dict[str, float | None] | None:
    """Return extremes and quantiles in ms; None where there are too few values."""
    if len(values) < _ENOUGH:
        return None
    found = {"min": min(values), "max": max(values)}
    for name in ("p50", "p90", "p99"):
        if len(values) >= samples_for_point(SHARES[name]):
            found[name] = float(np.quantile(np.array(values), SHARES[name]))
    return {name: rounded(found.get(name)) for name in ("min", "p50", "p90", "p99", "max")}


_CHUNK = 65_536
_MOST_MESSAGES = 200_000
_MOST_BYTES = 16 * 1024 * 1024
_POLLS = 20.0


@dataclass
class Heard:
    """Messages of one stream, or responses of one polled operation.

    Attributes:
        kind: `sse`, `websocket`, `rosbridge` or `polling`.
        moments_ns: when each message came, monotonic.
        ages_ms: our clock less the stamp of each message that had one.
        listened_s: for how long.
        error: why it ended before its time, or None.
        clock: the robot's clock; None where the stream comes from another host than the polls.
    """

    name: str
    kind: str
    clock: RobotClock | None = None
    moments_ns: list[int] = field(default_factory=list)
    ages_ms: list[float] = field(default_factory=list)
    listened_s: float = 0.0
    error: str | None = None

    def take(self, message: bytes, pointer: JSONPointer | None) -> None:
        """Record a message that has just come."""
        if len(self.moments_ns) >= _MOST_MESSAGES:
            return
        self.moments_ns.append(now_ns())
        received_s = time.time()
        stamp = None if pointer is None else stamp_of(message, pointer)
        if stamp is not None:
            self.ages_ms.append((received_s - stamp.seconds) * 1e3)
            if self.clock is not None:
                self.clock.data(stamp, received_s)


def hear(robot: Robot, settings: Settings, stopped: Callable[[], bool], tell: Callable[[str], None]) -> list[Heard]:
    """Listen to the streams of the settings for as long as the comparison took, and poll the first read beside them."""
    wanted, load = settings.streams, settings.load
    if not (wanted.listen or wanted.stamp) or stopped():
        return []
    tell(f"listening to {', '.join(each.name for each in wanted.listen) or 'polls'} for {load.duration_s:g} s")
    polled = next((each.name for each in robot.described if each.method == "GET" and each.octets), None)
    return listen(robot, wanted, polled, load.duration_s, settings.limits.max_rate, stopped)


def listen(
    robot: Robot, wanted: Streams, polled: str | None, seconds: float, rate: float | None, stopped: Callable[[], bool]
) -> list[Heard]:
    """Listen to all streams at once, and poll an operation meanwhile; never raises for the robot's faults.

    Args:
        robot: addresses and credentials.
        wanted: what to listen to, and where messages have their stamps.
        polled: the operation to poll, or None.
        seconds: for how long.
        rate: the highest rate of the polls, per second.
        stopped: returns whether to end.
    """
    stamp, told = (None if pointer is None else JSONPointer(pointer) for pointer in (wanted.stamp, wanted.clock))
    clock, here = RobotClock(), same_machine(robot)
    jobs: list[tuple[Heard, Callable[[Heard], None]]] = [
        (
            Heard(each.name, each.kind, clock if _same_host(robot, each) or (here and is_here(_host(each))) else None),
            lambda item, each=each: _HEAR[each.kind](robot, each, item, stamp),  # type: ignore[misc]
        )
        for each in wanted.listen
    ]
    if polled is not None:
        polls = min(rate or _POLLS, _POLLS)
        jobs.append((Heard(polled, "polling", clock), lambda message: _poll(robot, message, stamp, told, polls)))
    work = [gevent.spawn(_run_guarded, run, one) for one, run in jobs]
    until = time.monotonic() + seconds
    while time.monotonic() < until and not stopped() and not all(job.ready() for job in work):
        gevent.sleep(0.05)
    gevent.killall(work)
    return [one for one, _ in jobs]


def _run_guarded(run: Callable[[Heard], None], one: Heard) -> None:
    began = time.monotonic()
    try:
        run(one)
        count = len(one.moments_ns)
        one.error = f"the robot ended it after {count} message{'' if count == 1 else 's'}"
    except (CallError, OSError, httptools.HttpParserError) as error:
        one.error = str(error) or type(error).__name__
    finally:
        one.listened_s = time.monotonic() - began


def _same_host(robot: Robot, stream: Stream) -> bool:
    """Return whether a stream comes from the robot's own host."""
    return robot.rest is not None and Endpoint.parse(robot.rest).host == _host(stream)


def _host(stream: Stream) -> str:
    return Endpoint.parse(stream.url, {"http": 80, "https": 443, "ws": 80, "wss": 443}).host


def _poll(robot: Robot, one: Heard, pointer: JSONPointer | None, told: JSONPointer | None, rate: float) -> None:
    request = robot.requests("rest", one.name, 0)[0]
    with closing(robot.http("rest", one.name)) as connection:
        due = time.monotonic()
        while True:
            gevent.sleep(max(0.0, due - time.monotonic()))
            due += 1 / rate
            sent_s = time.time()
            answer = connection.call(request)
            received_s = time.time()
            answer.require_good(request.expects)
            one.take(answer.body, pointer)
            if one.clock is not None:
                one.clock.add_date(answer.headers.get(b"date"), sent_s, received_s)
                if told is not None and (stamp := stamp_of(answer.body, told)) is not None:
                    one.clock.add_stamp(stamp, sent_s, received_s)


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
        plain.sendall(robot.fixed.reveal(stream.octets))
        while data := plain.recv(_CHUNK):
            try:
                events.parser.feed_data(data)
            except httptools.HttpParserCallbackError as error:
                raise error.__context__ or error from None


def _hear_messages(robot: Robot, stream: Stream, one: Heard, pointer: JSONPointer | None) -> None:
    where, topic = urldefrag(stream.url)
    protocol, endpoint = ClientProtocol(parse_uri(where), max_size=_MOST_BYTES), bridge_endpoint(where)
    messages = _Messages(protocol, lambda message: one.take(message, pointer), topic)
    handshake = protocol.connect()
    if _same_host(robot, stream):  # secrets are sent only to the robot's host
        for name, value in robot.fixed.fields("GET", handshake.path):
            handshake.headers[name] = value
    protocol.send_request(handshake)
    with closing(_connect(endpoint, robot, where)) as plain:
        plain.sendall(b"".join(protocol.data_to_send()))
        while data := plain.recv(_CHUNK):
            protocol.receive_data(data)
            if protocol.handshake_exc is not None:
                words = "it does not speak WebSocket" if isinstance(protocol.handshake_exc, InvalidHandshake) else ""
                raise CallError("status", f"{words}: {protocol.handshake_exc}".lstrip(": "))
            for event in protocol.events_received():
                messages.receive(event)
            plain.sendall(b"".join(protocol.data_to_send()))  # answers to pings, and the subscription


class _Messages:
    """The messages of a WebSocket; of a rosbridge, the ROS messages of one topic."""

    def __init__(self, protocol: ClientProtocol, take: Callable[[bytes], None], topic: str) -> None:
        self._protocol = protocol
        self._take = take
        self._topic = topic
        self._pieces: list[bytes] = []

    def receive(self, event: object) -> None:
        """Handle the protocol's events: subscribe once it is open, then collect messages."""
        if isinstance(event, Response) and self._topic:
            subscribe = {"op": "subscribe", "id": "roaas", "topic": self._topic}
            self._protocol.send_text(msgspec.json.encode(subscribe))
        if not isinstance(event, Frame) or event.opcode not in {Opcode.TEXT, Opcode.BINARY, Opcode.CONT}:
            return
        self._pieces.append(bytes(event.data))
        if not event.fin:
            return
        message = b"".join(self._pieces)
        self._pieces.clear()
        if self._topic:
            message = _message_in(message, self._topic)
        if message:
            self._take(message)


class _Bridged(msgspec.Struct):
    """A message of the rosbridge protocol."""

    op: str
    topic: str = ""
    msg: msgspec.Raw = msgspec.Raw(b"null")
    level: str = ""


def _message_in(octets: bytes, topic: str) -> bytes:
    """Return the ROS message that a rosbridge has sent for a topic; empty for anything else.

    Raises:
        CallError: rosbridge reports an error, or it is no message of its protocol.
    """
    try:
        message = msgspec.json.decode(octets, type=_Bridged)
    except (msgspec.DecodeError, RecursionError):
        raise CallError("malformed", f"not a message of the rosbridge protocol: {clip(octets)}") from None
    if message.op == "status" and message.level == "error":
        raise CallError("fault", f"rosbridge: {clip(bytes(message.msg))}")
    return bytes(message.msg) if (message.op, message.topic) == ("publish", topic) else b""


_HEAR = {"sse": _hear_events, "websocket": _hear_messages, "rosbridge": _hear_messages}
