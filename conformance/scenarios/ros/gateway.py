"""A gateway with both of its ends: its web API, and the ROS graph that the suite watches or plays."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field, replace
from http import HTTPStatus
from typing import Any, Final, TypeVar

import msgspec

from conformance.api.rest.interface import RestInterface
from conformance.documents.openapi import matching
from conformance.documents.parameters import Parameter
from conformance.observe.clock import WALL_CLOCK
from conformance.scenarios.motion.binding import Binding
from conformance.scenarios.motion.templates import fill
from conformance.scenarios.reaching import key_of, new_key
from conformance.scenarios.ros.definition import Definition, value_at
from conformance.scenarios.ros.robot import ProbeError, Robot
from conformance.scenarios.ros.samples import Maker
from conformance.scenarios.ros.web import document_for, document_of, parameters_for, with_texts
from conformance.scenarios.scenario import NotDeclaredError, NotPossibleError
from conformance.statement.motion_calls import NAME
from conformance.statement.ros_map import KINDS, Acts, Body, Calls, Publishes, Reads, RosMap
from conformance.transport.exchange import Attempt, Exchange, NoAnswer, NoAnswerError, Outgoing, Response
from conformance.transport.rosbridge import Subscription
from conformance.transport.streams import Message, Stream
from conformance.verdict.run import Run

_Operation = TypeVar("_Operation")
#: Clients at once for a gateway without a robot.
CROWD: Final = 32
# Pause between two reads of the gateway, s.
PACE_S: Final = 0.03
#: Additional time for a busy machine to show the last messages, s.
PATIENCE_S: Final = 10.0
#: Longest wait for the discovery of the graph, s.
_DISCOVERY_S: Final = 15.0
#: How long the suite listens whether another robot publishes, s.
_ALONE_S: Final = 1.2
_KEYS: Final[dict[type, str]] = {kind: name for name, kind in KINDS.items()}
#: The part of a type that a request contains.
_PARTS: Final[dict[type, str]] = {Calls: "#Request", Acts: "#Goal"}


@dataclass
class Gateway:
    """One gateway.

    Args:
        run: the run's data.
        api: its web API.
        binding: how its operations become requests.
        ros: its map.
    """

    run: Run
    api: RestInterface
    binding: Binding
    ros: RosMap
    _robot: Robot | None = field(default=None, init=False)
    _is_alone: bool = field(default=False, init=False)
    _problem: str = field(default="", init=False)
    _numbers: Iterator[int] = field(default_factory=lambda: itertools.count(1), init=False)
    _makers: dict[str, Maker] = field(default_factory=dict, init=False)
    _streams: dict[str, Stream] = field(default_factory=dict, init=False)

    @property
    def plays(self) -> bool:
        """Whether the suite is the robot; otherwise it watches one."""
        return self.run.ros == "play"

    @property
    def robot(self) -> Robot:
        """The robot's end.

        Raises:
            NotPossibleError: it cannot be had, or there is no gateway on the graph.
        """
        if self._problem:
            raise NotPossibleError(self._problem)
        if self._robot is None:
            try:
                self._robot = Robot(self.ros.domain)
                self._robot.await_ready()
                self._await_others(self._robot)
                self._check_alone(self._robot)
            except ProbeError as error:
                self._problem = f"the suite's ROS node in domain {self.ros.domain}: {error}"
                raise NotPossibleError(self._problem) from error
        return self._robot

    def _await_others(self, robot: Robot) -> None:
        """Wait until the node finds another one; otherwise a gateway would be blamed for messages that never left."""
        until = WALL_CLOCK.now() + _DISCOVERY_S
        while not robot.tell("graph")["nodes"]:
            if WALL_CLOCK.now() > until:
                raise ProbeError(
                    "it finds no other node: start the gateway in this domain, with ROS_AUTOMATIC_DISCOVERY_RANGE and "
                    "ROS_STATIC_PEERS such that it is found on this machine"
                )
            WALL_CLOCK.sleep(PACE_S)

    def check_alone(self) -> None:
        """Hear once more whether anybody else is the robot; a node may be discovered late.

        Raises:
            NotPossibleError: somebody is.
        """
        self._is_alone = False
        try:
            self._check_alone(self.robot)
        except ProbeError as error:
            self._problem = f"the suite's ROS node in domain {self.ros.domain}: {error}"
            raise NotPossibleError(self._problem) from error

    def _check_alone(self, robot: Robot) -> None:
        """Listen whether another node publishes to the suite's topics: a gateway would be blamed for its messages.

        Raises:
            ProbeError: somebody does.
        """
        ends = [] if not self.plays or self._is_alone else self.ros.operations.values()
        # The gateway may repeat its own messages, as a watchdog does.
        own = {one.publishes for one in ends if isinstance(one, Publishes)}
        types = {one.topic: one.type for one in ends if isinstance(one, Reads) and one.topic not in own}
        with ExitStack() as listening:
            for topic, type_ in types.items():
                listening.enter_context(robot.publishing(topic))
                # A missing type is reported where it is needed.
                with suppress(ProbeError):
                    robot.tell("listen", topic=topic, type=type_)
            began = WALL_CLOCK.now()
            until = began + bool(types) * _ALONE_S
            while WALL_CLOCK.now() < until or (
                # A publisher that is known, and not heard yet, may only be discovered late.
                WALL_CLOCK.now() < began + _DISCOVERY_S / 3 and any(robot.count(one, "publishers") for one in types)
            ):
                if found := next((topic for topic in types if robot.take_heard(topic)), ""):
                    raise ProbeError(
                        f"another node publishes on {found}: with --ros-play the suite is the robot, so end the real "
                        "one or the other run, or give the gateway a ROS domain of its own"
                    )
                WALL_CLOCK.sleep(PACE_S)
        self._is_alone = True

    def kill(self) -> None:
        """Kill the suite's ROS process, so that its nodes leave the graph abruptly; the next use starts another."""
        if self._robot is not None:
            self._robot.kill()
            self._robot = None

    def close(self) -> None:
        """End the robot's end, and all streams."""
        for stream in self._streams.values():
            stream.close()
        if self._robot is not None:
            self._robot.close()

    def of(self, kind: type[_Operation]) -> Iterator[tuple[str, _Operation]]:
        """Yield the map's operations of a kind.

        Raises:
            NotDeclaredError: there is none.
        """
        found = [(call, one) for call, one in self.ros.operations.items() if isinstance(one, kind)]
        if not found:
            raise NotDeclaredError(f"[ros.operations] has no operation with {_KEYS[kind]!r}")
        yield from found

    def need_permission(self) -> None:
        """Check that something may be sent to the robot.

        Raises:
            NotPossibleError: it is a real one, and may not be moved.
        """
        if not (self.plays or self.run.allow_motion):
            raise NotPossibleError("it sends to the robot: give --ros-play (the suite is the robot) or --allow-motion")

    def definition(self, name: str) -> Definition:
        """Return the definition of a type.

        Raises:
            NotPossibleError: it is not installed.
        """
        try:
            return self.robot.definition(name)
        except ProbeError as error:
            raise NotPossibleError(f"{name}: {error}") from error

    def complete(self, name: str, value: dict[str, Any]) -> dict[str, Any]:
        """Return the message of a type with all its fields.

        Raises:
            ProbeError: the value is none of this type.
        """
        found: dict[str, Any] = self.robot.tell("complete", type=name, value=value)["value"]
        return found

    def maker(self, definition: Definition) -> Maker:
        """Return this run's generator for messages of a type, so that none of its usual messages comes again."""
        made = Maker(definition, self.run.seed, self.binding.syntax == "XML", is_gentle=not self.plays)
        return self._makers.setdefault(definition.root, made)

    def usual(self, name: str) -> dict[str, Any]:
        """Return a message of a type, or of a part of it, that differs from all others."""
        return self.complete(name, self.maker(self.definition(name)).usual().value)

    def request(
        self, call: str, body: Body, value: dict[str, Any] | None = None, definition: Definition | None = None
    ) -> Outgoing:
        """Return the request of an operation; ``value``: of the ROS message that it gets, by the map's type."""
        document, values = None, body.values
        if self.ros.rosbridge:
            # Its id identifies the response to this message.
            body = msgspec.structs.replace(body, body={**body.body, "id": f"roaas-{next(self._numbers)}"})
        if value is not None:
            definition = definition or self.definition(body.type + _PARTS.get(type(body), ""))
            document = document_for(value, definition, body, self.ros)
            values = {**parameters_for(value, body), **values}
        made = self.binding.make(fill(call.partition("#")[0], values), document)
        key = self.key_of(call) if value is not None else None
        return with_header(made, key.name, new_key(key)) if key and key.required else made

    def key_of(self, call: str) -> Parameter | None:
        """Return the idempotency key that the description of an operation offers, or None."""
        contract = self.run.contract if self.binding.syntax == "JSON" and not self.ros.rosbridge else None
        method, _, path = re.split("[?#]", call)[0].partition(" ")
        declared = matching(contract, method, path) if contract else None
        return key_of(declared) if declared else None

    def usual_request(self, call: str, body: Body) -> tuple[Outgoing, dict[str, Any]]:
        """Return a request with a message that differs from all others, and that message."""
        value = self.usual(body.type + _PARTS.get(type(body), ""))
        return self.request(call, body, value), value

    def send_texts(self, call: str, body: Body) -> None:
        """Send an invalid request, if JSON makes one: a gateway that refuses it may treat the next one otherwise."""
        name = body.type + _PARTS.get(type(body), "")
        if self.binding.syntax == "JSON" and not body.places and self.maker(self.definition(name)).has_numbers:
            made, _ = self.usual_request(call, body)
            with suppress(NoAnswerError):
                self.send(replace(made, body=with_texts(made.body, body)), body.response_s)

    def following(
        self, exchange: Exchange, body: Acts | Calls, template: str, content: dict[str, Any]
    ) -> Outgoing | None:
        """Return the request of an operation on a goal or a call; None if the response does not name it.

        If the template has no id, the request is for the only goal.
        """
        if not (NAME.search(template) or "{id}" in str(content)):
            return self.binding.make(template, content or None)
        name = (exchange.response.header("Location") or "").rstrip("/").rpartition("/")[2] or None
        if body.id is not None:
            name = value_at(document_of(exchange.response.body).value, body.id)
        # The id may have the name that the description's path gives it.
        values = {**dict.fromkeys(NAME.findall(template), str(name)), **body.values, "id": str(name)}
        return None if name is None else self.binding.make(fill(template, values), fill(content, values) or None)

    def read(self, call: str, reads: Reads) -> Exchange:
        """Read a topic; of a stream, return the last message.

        Raises:
            NoAnswerError: there is no response, or no message yet.
        """
        if reads.stream:
            if call not in self._streams or self._streams[call].ended:
                self._streams[call] = self.stream(call, reads)
            return exchange_of(self._streams[call], self._streams[call].last)
        return self.send(self.request(call, reads), reads.response_s)

    def stream(self, call: str, reads: Reads, after: str = "") -> Stream:
        """Open the stream of an operation; ``after`` an event, where its client has had that.

        Raises:
            NoAnswerError: it does not open.
        """
        timeout_s = max(reads.response_s, 1.0)
        if reads.stream == "rosbridge":
            return Subscription(self.api.client, reads.body, timeout_s, reads.throttle_s)
        return Stream(self.api.client, self.request(call, reads).target, reads.stream or "sse", timeout_s, after=after)

    def send(self, made: Outgoing, timeout_s: float) -> Exchange:
        """Send a request.

        Raises:
            NoAnswerError: there is no response.
        """
        return self.api.client.send(
            made.method, made.target, headers=made.headers, body=made.body, timeout_s=max(timeout_s, 1.0)
        )

    def attempt(self, made: Outgoing, timeout_s: float) -> Attempt:
        """Send a request that may get no response in time.

        Raises:
            NoAnswerError: the connection failed.
        """
        try:
            return self.send(made, timeout_s)
        except NoAnswerError as none:
            if none.kind not in {NoAnswer.TIMEOUT, NoAnswer.CIRCUIT_OPEN}:
                raise
            return none.unanswered


def with_header(made: Outgoing, name: str, value: str) -> Outgoing:
    """Return a request with this header in place of its own."""
    return replace(made, headers=(*(pair for pair in made.headers if pair[0] != name), (name, value)))


class Silence(Exchange):
    """A stream on which nothing came."""

    @property
    def came(self) -> str:
        """A short description, for findings."""
        return "no message on the stream"


def exchange_of(stream: Stream, message: Message | None) -> Exchange:
    """Return a message of a stream as a response to the request that opened it."""
    if message is None:
        return Silence(stream.request, Response(HTTPStatus.NOT_FOUND, (), b"", 0.0))
    return Exchange(stream.request, Response(HTTPStatus.OK, (), message.octets, 0.0, received_s=message.at))
