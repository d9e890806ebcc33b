"""A client of a rosbridge: each of its requests is an operation of the protocol, version 2, over a WebSocket.

github.com/RobotWebTools/rosbridge_suite, ROSBRIDGE_PROTOCOL.md, sections 3 and 4. The body of a request is the message
that goes out, and the body of a response the one that came. The protocol has no response to a publication, so a call
of a service goes out behind it: what was wrong with the publication is told before that call is answered.
"""

from __future__ import annotations

import itertools
import json
import time
from collections.abc import Callable, Iterable
from http import HTTPStatus
from typing import Any, Final

from conformance.transport.client import Connection, HttpClient
from conformance.transport.exchange import Exchange, NoAnswer, NoAnswerError, Request, Response, Unanswered
from conformance.transport.passage import Heard, Passage
from conformance.transport.streams import Stream

_BEHIND_S: Final = 2.0  # wait for the response to a call after a publication, s
_AT_ONCE_S: Final = 0.3  # wait for the rejection of a goal, s
_BEHIND: Final = "/rosapi/get_time"


class BridgeClient(HttpClient):
    """A client of one rosbridge, with a connection that opens at the first request.

    Args:
        base_url: its URL, with http in place of ws.
        connection: as for any client.
        publishes: types of the topics on which it publishes.
    """

    def __init__(self, base_url: str, connection: Connection, publishes: dict[str, str]) -> None:
        super().__init__(base_url, connection)
        self._publishes, self._numbers = publishes, itertools.count(1)
        self._link: Stream | None = None
        self._goals: dict[str, dict[str, Any]] = {}

    def twin(self, connection: Connection) -> BridgeClient:
        """Return another client of the same rosbridge."""
        return BridgeClient(self.base_url, connection, self._publishes)

    def close(self) -> None:
        """Close the connection."""
        if self._link is not None:
            self._link.close()
            self._link = None

    def send(
        self,
        method: str,
        path: str,
        *,
        headers: Iterable[tuple[str, str]] = (),  # noqa: ARG002 - the protocol has none
        body: bytes = b"",
        fresh: bool = False,
        authorized: bool = True,  # noqa: ARG002 - the handshake has the credentials
        timeout_s: float | None = None,
    ) -> Exchange:
        """Send an operation, and return its outcome as an exchange; the suite makes up the status.

        Raises:
            NoAnswerError: there is no connection, or no response.
            NotPermittedError: it may not be sent in this run.
        """
        within_s = timeout_s or self.connection.timeout_s
        if fresh:
            self.close()
        if self._link is None or self._link.ended:
            self._link = Stream(self, "/", "websocket", within_s)
            for topic, type_ in self._publishes.items():
                self._link.send(json.dumps({"op": "advertise", "topic": topic, "type": type_}))
        self.connection.take_slot((method, self.url(path)))
        request, began = Request(method, self.url(path), (), body), time.monotonic()
        status, came = self._carry_out(self._link, path, body, within_s)
        ended = time.monotonic()
        if status is None:
            kind = NoAnswer.CLOSED if self._link.ended else NoAnswer.TIMEOUT
            problem = f"no response within {within_s:g} s" if kind is NoAnswer.TIMEOUT else "the connection was closed"
            raise NoAnswerError(Unanswered(request, problem, kind))
        fields = (("Content-Type", "application/json"),) if came else ()
        response = Response(status, fields, came, (ended - began) * 1000, received_s=ended)
        self.connection.recorder.record(
            Passage(request, self.connection.number(), 1, 1, began, ended, ended, within_s, response, heard=Heard.NEVER)
        )
        exchange = Exchange(request, response)
        for listener in self.connection.listeners:
            listener.on_response(exchange)
        return exchange

    def _carry_out(self, link: Stream, path: str, body: bytes, within_s: float) -> tuple[HTTPStatus | None, bytes]:
        """Carry an operation out; return a status, None without any response, and the message that came."""
        what, _, name = path.removeprefix("/").partition("/")
        if what in {"goal", "cancel"}:
            self._until(link, lambda _: False, 0.0)
            goal = self._goals.get(name)
            if goal is None or what == "goal":
                return (HTTPStatus.OK if goal else HTTPStatus.NOT_FOUND), json.dumps(goal).encode()
            link.send(json.dumps({"op": "cancel_action_goal", "id": name, "action": goal["action"]}))
            return self._take_status(link, HTTPStatus.CONFLICT)
        if what not in {"publish", "call", "act"}:
            # Each subscription opens a connection of its own; here only see whether the rosbridge responds.
            return self._take_status(link, HTTPStatus.BAD_REQUEST, within_s)
        link.send(body.decode(errors="replace"))
        if what == "publish":
            return self._take_status(link, HTTPStatus.BAD_REQUEST)
        said = json.loads(body)
        id_ = said["id"]
        if what == "act":
            goal = {"id": id_, "action": said["action"], "status": "running", "feedback": None, "result": None}
            self._goals[id_] = goal
        got = self._until(link, lambda item: item.get("id") == id_, _AT_ONCE_S if what == "act" else within_s)
        if what == "act":
            return HTTPStatus.OK, json.dumps(self._goals[id_]).encode()
        last = next((item for item in got if item.get("id") == id_), None)
        status = HTTPStatus.OK if last and last.get("op") == "service_response" else HTTPStatus.BAD_REQUEST
        return (status, last["_octets"]) if last else (None, b"")

    def _take_status(self, link: Stream, refused: HTTPStatus, within_s: float = 0.0) -> tuple[HTTPStatus | None, bytes]:
        """Return `refused` and the status message if its level is "error"; otherwise 200, for the last message sent.

        With ``within_s``, silence gives None, because the outcome is not known. Without it, silence gives 200.
        """
        behind = f"behind-{next(self._numbers)}"
        link.send(json.dumps({"op": "call_service", "id": behind, "service": _BEHIND}))
        got = self._until(
            link, lambda item: item.get("id") == behind and item.get("op") == "service_response", within_s or _BEHIND_S
        )
        errors = [item for item in got if item.get("op") == "status" and item.get("level") == "error"]
        wrong = next((error for error in errors if error.get("id") != behind), None)
        if wrong:
            return refused, wrong["_octets"]
        return (None if within_s and not got else HTTPStatus.OK), b""

    def _until(self, link: Stream, ends: Callable[[dict[str, Any]], bool], within_s: float) -> list[dict[str, Any]]:
        """Return messages until one of them ends the wait; record the states of goals in them."""
        until, found = time.monotonic() + within_s, list[dict[str, Any]]()
        while True:
            for message in link.take_new(1, max(0.0, until - time.monotonic())):
                one = _object(message.octets)
                found.append(one | {"_octets": message.octets})
                goal = self._goals.get(str(one.get("id")), {})
                if one.get("op") == "action_feedback":
                    goal["feedback"] = one.get("values")
                elif one.get("op") == "action_result":
                    goal |= {"status": one.get("status"), "result": one.get("values") if one.get("result") else None}
            if any(map(ends, found)) or link.ended or time.monotonic() >= until:
                return found


class Subscription(Stream):
    """A connection of its own on which one topic is subscribed to.

    Args:
        client: the client of the rosbridge.
        body: the body of the operation: op, topic and type.
        timeout_s: until it is open, s.
        throttle_s: the least time between two messages, s; 0 if each message is sent.
    """

    def __init__(self, client: HttpClient, body: dict[str, Any], timeout_s: float, throttle_s: float) -> None:
        topic = body["topic"]
        super().__init__(client, "/", "websocket", timeout_s, lambda octets: _object(octets).get("topic") == topic)
        # The counterpart of a client's operation, which counts the calls.
        said = json.dumps({**body, "throttle_rate": round(throttle_s * 1000), "queue_length": 0})
        self.request = client.send("GET", f"/subscribe{topic}", body=said.encode(), timeout_s=timeout_s).request
        self._ends = json.dumps({"op": "unsubscribe", "topic": topic})
        self.send(said)

    def unsubscribe(self) -> None:
        """Unsubscribe, and keep the connection."""
        self.send(self._ends)


def _object(octets: bytes) -> dict[str, Any]:
    """Return the object that a message is; empty if it is none. Never raises."""
    try:
        found = json.loads(octets)
    except (ValueError, RecursionError):
        return {}
    return found if isinstance(found, dict) else {}
