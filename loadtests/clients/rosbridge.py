"""The third interface: rosbridge, ROS messages as JSON over a WebSocket.

It follows the rosbridge v2 protocol (github.com/RobotWebTools/rosbridge_suite, ROSBRIDGE_PROTOCOL.md, section 3.2),
which has no response to a publish. So a delivery counts as done when its echo is back: the client subscribes to the
topic that it publishes to, and an echo has been through ROS. A pose is a subscription until its first message, which
waits for the robot's next odometry.

All users of a process share one connection, as in a program with rosbridge's own client library: if each subscribed for
itself, rosbridge would send every echo to all of them. The WebSocket (RFC 6455) is the protocol of `websockets` on
gevent's sockets; of the maintained libraries it is the one that masks and parses in C.
"""

import ssl
from collections import defaultdict, deque
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import gevent
import gevent.socket
import msgspec
from gevent.event import AsyncResult
from gevent.lock import BoundedSemaphore
from websockets.client import ClientProtocol
from websockets.exceptions import InvalidHandshake
from websockets.frames import Frame, Opcode
from websockets.uri import parse_uri

from conformance.papers_robot.delivery import MESSAGE_FIELDS
from loadtests.clients.endpoint import Endpoint
from loadtests.clients.failures import CallError, clip, connect_error
from loadtests.clients.wire import Answer, Request, now_ns

ODOMETRY_TOPIC = "/odom"
_DELIVERY_TYPE = "mybot_delivery_app/msg/DeliveryRequestMsg"
_ODOMETRY_TYPE = "nav_msgs/msg/Odometry"
_CHUNK = 65_536
_MAX_MESSAGE = 16 * 1024 * 1024
_STATUS_OK = 200  # callers check it; rosbridge has no status of its own
#: DDS needs a moment to match a new publisher with a new subscription; rosbridge does not say when they match.
_MATCHING_S = 0.5

Key = tuple[float, ...]


@dataclass(frozen=True, slots=True)
class BridgeRequest(Request):
    """A request over rosbridge: the JSON message to send, and the ROS message that counts as its response.

    Attributes:
        topic: the topic on which the response arrives.
        echo: the values of a delivery in the order of the ROS message; empty for a read.
    """

    topic: str = ""
    echo: Key = ()


def bridge_requests(values: list[dict[str, float]], topic: str) -> list[BridgeRequest]:
    """Return the requests that publish deliveries to a topic; empty values become a request that reads the pose."""
    return [_publish(each, topic) if each else _READ for each in values]


def _publish(values: dict[str, float], topic: str) -> BridgeRequest:
    message = {name: values[name] for name in MESSAGE_FIELDS}
    octets = msgspec.json.encode({"op": "publish", "topic": topic, "msg": message})
    return BridgeRequest(octets, b"", topic, tuple(float(value) for value in message.values()))


_READ = BridgeRequest(b"", b'"pose"', ODOMETRY_TOPIC)


class Bridge:
    """A connection to rosbridge, shared by all users of a process; it opens at the first call.

    Args:
        url: ws or wss.
        timeout_s: deadline of a whole request, including the connection.
        tls: the context for wss.
        token: bearer token of the handshake, for a gateway in front of rosbridge.
        delivery_topic: full name.
    """

    def __init__(self, url: str, timeout_s: float, tls: Any, token: str | None, delivery_topic: str) -> None:
        self.url = url
        self.timeout_s = timeout_s
        self.tls = tls
        self.connects = 0
        self._token = token
        self._delivery_topic = delivery_topic
        self._opening = BoundedSemaphore()
        self._sending = BoundedSemaphore()
        self._socket: Any = None
        self._protocol: Any = None
        self._reader: Any = None
        self._pieces: list[bytes] = []
        self._echoes: defaultdict[Key, deque[AsyncResult]] = defaultdict(deque)
        self._reads: dict[str, AsyncResult] = {}
        self._matched_ns: int | None = None
        self._numbers = 0

    def call(self, request: Request) -> Answer:
        """Send a request and wait for the ROS message that counts as its response.

        Raises:
            CallError: of any kind; the request was sent at most once.
        """
        if not isinstance(request, BridgeRequest):
            raise TypeError(f"{type(request).__name__} is not a request over rosbridge")
        with gevent.Timeout(self.timeout_s, CallError("timeout", f"no echo or message within {self.timeout_s:g} s")):
            with self._opening:
                if self._socket is None:
                    self._open()
            return self._deliver(request) if request.echo else self._read(request)

    def _deliver(self, request: BridgeRequest) -> Answer:
        with self._opening:
            self._match()
        waiter = AsyncResult()
        waiting = self._echoes[request.echo]
        waiting.append(waiter)
        try:
            self._send(request.octets)
            answer: Answer = waiter.get()
        finally:
            with suppress(ValueError):  # answered, or the connection was lost
                waiting.remove(waiter)
        return answer

    def _read(self, request: BridgeRequest) -> Answer:
        self._numbers += 1
        name = f"pose-{self._numbers}"
        waiter = self._reads[name] = AsyncResult()
        about = {"id": name, "topic": request.topic}
        try:
            self._say({"op": "subscribe", "type": _ODOMETRY_TYPE, **about})
            answer: Answer = waiter.get()
        finally:
            self._reads.pop(name, None)
            if self._socket is not None:
                self._say({"op": "unsubscribe", **about})
        return answer

    def _match(self) -> None:
        """Before the first delivery, become publisher and subscriber, and wait until DDS has probably matched both."""
        if self._matched_ns is None:
            about = {"topic": self._delivery_topic, "type": _DELIVERY_TYPE}
            self._say({"op": "advertise", "id": "delivery", **about})
            self._say({"op": "subscribe", "id": "echo", **about})
            gevent.sleep(_MATCHING_S)
            self._matched_ns = now_ns()

    def _open(self) -> None:
        endpoint = bridge_endpoint(self.url)
        try:
            plain = gevent.socket.create_connection((endpoint.host, endpoint.port), self.timeout_s)
            plain.setsockopt(gevent.socket.IPPROTO_TCP, gevent.socket.TCP_NODELAY, 1)
            if endpoint.scheme == "wss":
                plain = self.tls.wrap_socket(plain, server_hostname=endpoint.host)
            plain.settimeout(None)  # each call has its own deadline
        except OSError as error:
            raise connect_error(error, self.url) from None
        self._socket, self._matched_ns, self._pieces = plain, None, []
        self._protocol = ClientProtocol(parse_uri(self.url), max_size=_MAX_MESSAGE)
        handshake = self._protocol.connect()
        if self._token:
            handshake.headers["Authorization"] = f"Bearer {self._token}"  # RFC 6750 section 2.1
        opened = AsyncResult()
        try:
            self._protocol.send_request(handshake)
            self._flush()
            self._reader = gevent.spawn(self._listen, plain, self._protocol, opened)
            opened.get()
        except BaseException:
            self.close()
            raise
        self.connects += 1

    def _say(self, message: dict[str, Any]) -> None:
        self._send(msgspec.json.encode(message))

    def _send(self, octets: bytes) -> None:
        if self._socket is None:
            raise CallError("closed", "rosbridge closed the connection")
        with self._sending:
            self._protocol.send_text(octets)
            self._flush()

    def _flush(self) -> None:
        """Send the bytes that the WebSocket protocol object has queued."""
        try:
            for data in self._protocol.data_to_send():
                if data:
                    self._socket.sendall(data)
        except (OSError, ssl.SSLError) as error:
            raise CallError("closed", f"rosbridge closed the connection while a request was sent: {error}") from None

    def _listen(self, plain: Any, protocol: Any, opened: AsyncResult) -> None:
        """Read until the connection ends; runs in a greenlet of its own."""
        failure = CallError("closed", "rosbridge closed the connection")
        try:
            while data := plain.recv(_CHUNK):
                received = now_ns()
                protocol.receive_data(data)
                for event in protocol.events_received():
                    if isinstance(event, Frame):
                        self._frame(event, received)
                    elif protocol.handshake_exc is None:
                        opened.set(True)
                if protocol.handshake_exc is not None:
                    failure = _handshake_error(protocol.handshake_exc, self.url)
                    break
                self._flush()  # answers to pings
        except (OSError, CallError) as error:
            failure = CallError("closed", f"rosbridge reset the connection: {error}")
        if not opened.ready():
            opened.set_exception(failure)
        if self._socket is plain:
            self._lose(failure)

    def _frame(self, frame: Frame, received: int) -> None:
        if frame.opcode not in {Opcode.TEXT, Opcode.CONT}:
            return
        self._pieces.append(bytes(frame.data))
        if not frame.fin:
            return
        octets, self._pieces = b"".join(self._pieces), []
        try:
            message = msgspec.json.decode(octets)
            kind, topic = message["op"], message.get("topic")
        except (msgspec.DecodeError, TypeError, KeyError, AttributeError, RecursionError):
            self._fail(CallError("malformed", f"not a message of the rosbridge protocol: {clip(octets)}"))
            return
        answer = Answer(_STATUS_OK, {}, octets, received, len(octets))
        if kind == "publish" and topic == self._delivery_topic:
            self._take_echo(message.get("msg"), answer)
        elif kind == "publish" and topic == ODOMETRY_TOPIC:
            for waiter in list(self._reads.values()):
                waiter.set(answer)
        elif kind == "status" and message.get("level") == "error":
            self._fail(CallError("fault", f"rosbridge: {clip(str(message.get('msg')).encode())}"))

    def _take_echo(self, values: Any, answer: Answer) -> None:
        """Give a delivery that came back to the request with the same values; ignore other publishers' deliveries."""
        try:
            key = tuple(float(values[name]) for name in MESSAGE_FIELDS)
        except (KeyError, TypeError, ValueError):
            self._fail(CallError("content", f"not a delivery on {self._delivery_topic}: {clip(answer.body)}"))
            return
        waiting = self._echoes.get(key)
        if waiting:
            waiting.popleft().set(answer)

    def _waiters(self) -> Iterator[AsyncResult]:
        yield from self._reads.values()
        for waiting in self._echoes.values():
            yield from waiting

    def _fail(self, failure: CallError) -> None:
        """Fail all waiting requests, because a message without an id may belong to any of them."""
        for waiter in list(self._waiters()):
            waiter.set_exception(failure)

    def _lose(self, failure: CallError) -> None:
        plain, self._socket, self._protocol = self._socket, None, None
        if plain is not None:
            plain.close()
        self._fail(failure)

    def close(self) -> None:
        """Close; the next call opens a new connection."""
        reader, self._reader = self._reader, None
        self._lose(CallError("closed", "closed by ourselves"))
        if reader is not None and reader is not gevent.getcurrent():
            reader.kill(block=False)


def bridge_endpoint(url: str) -> Endpoint:
    """Return the endpoint of a rosbridge.

    Raises:
        EndpointError: not a ws(s) URL, no host, a port out of range, or user information in it.
    """
    return Endpoint.parse(url, {"ws": 80, "wss": 443})


def _handshake_error(error: Exception, where: str) -> CallError:
    if isinstance(error, InvalidHandshake):
        return CallError("status", f"{where} does not speak WebSocket: {error}")
    return CallError("malformed", f"{where}: {error}")
