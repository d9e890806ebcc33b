"""The ROS map: which topic, service or action each operation of a web gateway stands for (tables ``[ros]``).

Operations are written as in ``--call``: "METHOD PATH", the path as the description has it, or "POST /PORT/OPERATION" of
a WSDL. Positions in bodies are JSON pointers (RFC 6901); in XML they go by local names. Message types are written as
ROS writes them: "PACKAGE/msg/NAME", "PACKAGE/srv/NAME", "PACKAGE/action/NAME".
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from typing import Annotated, Any, Final, Literal

import msgspec
from msgspec import Meta

from conformance.contract.toml_file import Positive, TomlFileError, fit
from conformance.statement.motion_map import Call, Pointer

#: ROS names are unlimited; DDS domains are not (design.ros2.org, "ROS domain id").
_MOST_DOMAINS: Final = 232
_CALL: Final = re.compile(r"[A-Z]+ /\S*$")
Topic = Annotated[str, Meta(pattern=r"^/\S+$")]
Status = Annotated[int, Meta(ge=400, le=599)]
MessageType = Annotated[str, Meta(pattern=r"^[A-Za-z]\w*/msg/[A-Za-z]\w*$")]
ServiceType = Annotated[str, Meta(pattern=r"^[A-Za-z]\w*/srv/[A-Za-z]\w*$")]
ActionType = Annotated[str, Meta(pattern=r"^[A-Za-z]\w*/action/[A-Za-z]\w*$")]


#: Time that is allowed where a map declares none, s.
_USUAL_S: Final = 5.0
_PATIENT_S: Final = 30.0


class Failure(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The member of a 2xx response that reports a failed request, or a message that is too old.

    Attributes:
        at: where.
        values: any of these values there says so.
    """

    at: Pointer
    values: tuple[Any, ...]


class Body(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """How a message is written in the body of an operation.

    Attributes:
        at: where the message is in the body; empty if the body is the message.
        fields: position in the web's message = position in the ROS message, where their names differ. What is under the
            position goes with it. Without it, all names are those of the message.
        values: values of the parameters in the path or query, by name: "PUT /speed?x={x}" has the parameter x.
        in_url: other parameters there = position in the ROS message; the body then has the rest of it, or nothing.
        body: other members of the body that the operation gets.
        failure: how a 2xx response says that its request failed; None means by no value.
        timeout_s: time that the gateway has for a response, and for what the response stands for, s; None: 5 s, and how
            long it waits for a service that does not respond is not judged.
        type: the type of the message, service or action.
    """

    type: str = ""
    at: Pointer = ""
    fields: dict[Pointer, Pointer] = {}
    values: dict[str, Any] = {}
    in_url: dict[str, Pointer] = {}
    body: dict[str, Any] = {}
    failure: Failure | None = None
    timeout_s: Positive | None = None

    @property
    def places(self) -> tuple[Pointer, ...]:
        """Return the positions in the ROS message that a request has; empty if it has all."""
        return (*self.fields.values(), *self.in_url.values())

    @property
    def within_s(self) -> float:
        """Return the time limit for a response and its effect, s."""
        return self.timeout_s or _USUAL_S

    @property
    def response_s(self) -> float:
        """How long a response is waited for, s; without a declared time so long that a busy machine is not blamed."""
        return self.timeout_s or _PATIENT_S


class Reads(Body, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """An operation that returns the last message of a topic, or streams its messages.

    Attributes:
        topic: its full name.
        type: the type of its messages.
        absent: the statuses without a message: the topic has no publisher or no message, or the last is too old. Empty:
            not judged.
        max_age_s: how old a message may be that the operation returns, s; None means as old as it gets.
        stream: how it sends each message of the topic, once and in order; empty: it does not, it returns the last one.
        throttle_s: the least time between two messages of a stream, which leaves out those between, s; 0: it sends all.
    """

    topic: Topic
    type: MessageType
    absent: tuple[Status, ...] = ()
    max_age_s: Positive | None = None
    stream: Literal["sse", "websocket", "rosbridge", ""] = ""
    throttle_s: Annotated[float, Meta(ge=0)] = 0.0


class Publishes(Body, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """An operation that publishes the message of its body on a topic.

    Attributes:
        publishes: the topic's full name.
        type: the type of its messages.
    """

    publishes: Topic
    type: MessageType


class State(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How the state of a goal or a call is read.

    Attributes:
        read: the operation, a template: "{id}" is the id; without it, there is one goal at a time.
        at: where the word for the state is in the response.
        ended: where the word for the end is in the response of a device that has no goal any more, of any status.
        running, succeeded, aborted, canceled, rejected: these words; an empty list: not judged.
        body: the body of the request, a template as well.
    """

    read: Call
    at: Pointer
    ended: Pointer | None = None
    running: tuple[str, ...] = ()
    succeeded: tuple[str, ...] = ()
    aborted: tuple[str, ...] = ()
    canceled: tuple[str, ...] = ()
    rejected: tuple[str, ...] = ()
    body: dict[str, Any] = {}


class Calls(Body, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """An operation that calls a service.

    Attributes:
        service: its full name.
        type: the type of the service.
        result: where the response of the service is in the response's body, or in that of ``state.read``.
        id: where the call's id is in the response; None means at the end of its Location.
        state: what the call says of itself until it has ended; None if the response to the call is its outcome.
        unavailable: the statuses when the service is not there; empty means any that is no success.
        too_late: the statuses when the service does not respond in time; empty means any that is no success.
    """

    service: Topic
    type: ServiceType
    result: Pointer = ""
    id: Pointer | None = None
    state: State | None = None
    unavailable: tuple[Status, ...] = ()
    too_late: tuple[Status, ...] = ()


class Acts(Body, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """An operation that sends a goal to an action; ``at`` is where the goal is in its body.

    Attributes:
        action: its full name.
        type: the type of the action.
        id: where the goal's id is in the response; None means at the end of its Location.
        state: what the goal says of itself; None if not judged.
        feedback: where the last feedback is in the response of ``state.read``; None means nowhere.
        result: where the result is in the response of ``state.read``; None means nowhere.
        cancel: the operation that cancels the goal, a template: "{id}" is the goal's id.
        cancel_body: the cancel body of that request, a template as well.
        rejected: the statuses when the action server rejects a goal; empty means any error, or a state that says so.
        disconnect: what becomes of a goal when the client that sent it disconnects; None: not judged.
    """

    action: Topic
    type: ActionType
    id: Pointer | None = None
    state: State | None = None
    feedback: Pointer | None = None
    result: Pointer | None = None
    cancel: Call | Literal[""] = ""
    cancel_body: dict[str, Any] = {}
    rejected: tuple[Status, ...] = ()
    disconnect: Literal["cancels", "goes on"] | None = None


class Parameter(Body, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """An operation on a parameter of a node: by GET it returns the value, by another method it sets it.

    Attributes:
        parameter: its name.
        node: the node's full name.
        type: the type of its value: a name of rcl_interfaces/msg/ParameterType in lower case, without PARAMETER_.
        sets: whether it sets the value; None if its method is not GET.
        refused: the statuses when the node refuses a value; empty means any error.
    """

    parameter: Annotated[str, Meta(pattern=r"^\S+$")]
    node: Topic
    type: Literal[
        "bool", "integer", "double", "string", "byte_array", "bool_array", "integer_array", "double_array",
        "string_array",
    ]  # fmt: skip
    sets: bool | None = None
    refused: tuple[Status, ...] = ()


class Lists(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """An operation that lists names on the graph.

    Attributes:
        lists: what.
        at: where the array is in the body.
        name: where the full name is in an item; empty if the item is the name.
        type: where its type, or the list of its types, is in an item; None means nowhere.
        of: the type whose names it has, where it has no others; empty if it has all.
        hidden: whether names that are hidden (with a part that begins with "_") are listed; None means either.
        timeout_s: time in which a change of the graph has to show, s.
    """

    lists: Literal["topics", "services", "actions", "nodes"]
    at: Pointer = ""
    name: Pointer = ""
    type: Pointer | None = None
    of: str = ""
    hidden: bool | None = None
    timeout_s: Positive = _USUAL_S


Operation = Reads | Publishes | Calls | Acts | Parameter | Lists
#: The kind of an operation, by the key that declares it.
KINDS: Final[dict[str, type[Operation]]] = {
    "topic": Reads, "publishes": Publishes, "service": Calls, "action": Acts, "parameter": Parameter, "lists": Lists,
}  # fmt: skip


def end_of(one: Operation) -> str:
    """Return the full name of the topic, service, action or node that an operation reaches; empty for a list."""
    keys = ("topic", "publishes", "service", "action", "node")
    return next((str(getattr(one, key)) for key in keys if hasattr(one, key)), "")


def followers(one: Operation) -> tuple[str, ...]:
    """Return the operations that read the state of a goal or call, and cancel it."""
    state = one.state.read if isinstance(one, Acts | Calls) and one.state else ""
    return tuple(filter(None, (state, one.cancel if isinstance(one, Acts) else "")))


def is_setter(call: str, one: Operation) -> bool:
    """Return whether an operation sets a parameter."""
    return isinstance(one, Parameter) and (one.sets if one.sets is not None else not call.startswith("GET "))


class _Forms(msgspec.Struct, frozen=True, kw_only=True):
    """Where a robot is, and how all its messages are written.

    Attributes:
        domain_id: the robot's ROS domain; None means that of the environment.
        non_finite: how NaN and infinities are written: as null, as the strings "NaN", "Infinity" and "-Infinity", as a
            bare NaN or Infinity, or not at all but refused with an error status; None if not judged.
        integers: how integers of 64 bits are written; None means either, but exactly.
        bytes: how uint8[] and byte[] are written; None means either.
    """

    domain_id: Annotated[int, Meta(ge=0, le=_MOST_DOMAINS)] | None = None
    non_finite: Literal["null", "string", "refused", "literal"] | None = None
    integers: Literal["number", "string"] | None = None
    bytes: Literal["base64", "array"] | None = None


class RosMap(_Forms, frozen=True):
    """What a gateway makes of a ROS graph.

    Attributes:
        operations: by operation.
        rosbridge: URL of the rosbridge that has these operations; empty if they are a web API's.
    """

    operations: dict[str, Operation]
    rosbridge: str = ""

    @property
    def domain(self) -> int:
        """The ROS domain: that of the map, else of the environment variable ROS_DOMAIN_ID, else 0."""
        given = os.environ.get("ROS_DOMAIN_ID", "")
        return self.domain_id if self.domain_id is not None else int(given) if given.isdecimal() else 0

    @property
    def calls(self) -> tuple[str, ...]:
        """The operations that the map names. A suffix "#..." only distinguishes two tables of one operation."""
        own = (call.partition("#")[0] for call in self.operations)
        return (*dict.fromkeys(own), *(call for one in self.operations.values() for call in followers(one)))

    @property
    def describable(self) -> tuple[str, ...]:
        """Return the operations in a form that a description has: without queries. OpenAPI has no WebSocket."""
        found = self.operations.items()
        sockets = {
            call.partition("#")[0] for call, one in found if isinstance(one, Reads) and one.stream == "websocket"
        }
        return tuple(call.partition("?")[0] for call in self.calls if call not in sockets)


class _Rosbridge(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The table ``[ros.rosbridge]``: by name, the types of topics, services and actions used over it.

    ``disconnect`` is that of its actions.
    """

    url: Annotated[str, Meta(pattern=r"^wss?://\S+$")]
    subscribe: dict[Topic, MessageType] = {}
    publish: dict[Topic, MessageType] = {}
    call: dict[Topic, ServiceType] = {}
    act: dict[Topic, ActionType] = {}
    disconnect: Literal["cancels", "goes on"] | None = None
    timeout_s: Positive | None = None

    def operations(self) -> Iterator[tuple[str, Operation]]:
        """Yield the operations, as if each had a path of its own (ROSBRIDGE_PROTOCOL.md, 3.3 to 3.4)."""
        words: dict[str, Any] = {
            "running": ("running",), "succeeded": ("4",), "canceled": ("5",), "aborted": ("6",), "rejected": ("0",)
        }  # fmt: skip
        goal: dict[str, Any] = {"id": "/id", "feedback": "/feedback", "result": "/result"}
        goal |= {"cancel": "POST /cancel/{id}", "state": State("GET /goal/{id}", "/status", **words)}
        goal["disconnect"] = self.disconnect
        fails = {"result": "/values", "failure": Failure("/result", (False,))}
        for kind, key, call, at, said, types, more in (
            (Reads, "topic", "GET /subscribe", "/msg", {"op": "subscribe"}, self.subscribe, {"stream": "rosbridge"}),
            (Publishes, "publishes", "POST /publish", "/msg", {"op": "publish"}, self.publish, {}),
            (Calls, "service", "POST /call", "/args", {"op": "call_service"}, self.call, fails),
            (Acts, "action", "POST /act", "/args", {"op": "send_action_goal", "feedback": True}, self.act, goal),
        ):
            for name, type_ in types.items():
                body = {**said, key.replace("publishes", "topic"): name}
                body |= {"action_type": type_} if kind is Acts else {"type": type_} if kind is Reads else {}
                named: dict[str, Any] = {key: name, "type": type_, "at": at, "body": body, "timeout_s": self.timeout_s}
                yield f"{call}{name}", kind(**named, **more)


class _Ros(_Forms, frozen=True, forbid_unknown_fields=True):
    """The table ``[ros]`` as written; its operations are of several kinds."""

    operations: dict[str, dict[str, Any]] = {}
    rosbridge: _Rosbridge | None = None


class _File(msgspec.Struct, frozen=True):
    ros: _Ros


def read_ros_map(table: Any, where: str, error: type[TomlFileError]) -> RosMap:
    """Return the ROS map that a statement's table ``[ros]`` holds.

    Args:
        table: its content.
        where: the statement's file, for messages.
        error: the type of what is raised.

    Raises:
        TomlFileError: as ``error``: a key is unknown or missing, or a value is invalid.
    """
    found = fit({"ros": table}, _File, where, error).ros
    given = {name: getattr(found, name) for name in _Forms.__struct_fields__}
    bridge = found.rosbridge
    if bool(found.operations) == bool(bridge):
        raise error(f"{where}: [ros] needs one of [ros.operations] and [ros.rosbridge], each in a statement of its own")
    if bridge:
        return RosMap(dict(bridge.operations()), rosbridge=bridge.url, **given)
    return RosMap({call: _operation(call, one, where, error) for call, one in found.operations.items()}, **given)


def _operation(call: str, table: dict[str, Any], where: str, error: type[TomlFileError]) -> Operation:
    place = f"{where}: [ros.operations] {call!r}"
    if not _CALL.match(call):
        raise error(f"{place} must be a method and a path on the device, such as 'GET /pose', and no URL")
    kinds = [name for name in KINDS if name in table]
    if len(kinds) != 1:
        found = f"has {' and '.join(kinds)}" if kinds else "has none"
        raise error(f"{place}: one key of {', '.join(KINDS)} must say what it is; it {found}")
    made = fit(table, KINDS[kinds[0]], place, error)
    if isinstance(made, Parameter):
        # Its message is the value alone.
        made = msgspec.structs.replace(made, fields={"": "/value"})
    if isinstance(made, Reads) and made.in_url:
        raise error(f"{place}: in_url is of a request that sends a message; topic = {made.topic!r} is read: use values")
    strange = [name for name in getattr(made, "in_url", ()) if f"{{{name}}}" not in call]
    if strange:
        raise error(f"{place}: in_url has {strange[0]!r}, but the path and query have no {{{strange[0]}}}")
    if isinstance(made, Acts | Calls):
        asked = [("state.read", made.state.read, made.state.body)] if made.state else []
        asked += [("cancel", made.cancel, made.cancel_body)] if isinstance(made, Acts) and made.cancel else []
        nameless = [(name, path) for name, path, body in asked if "{id}" not in path + str(body) and "/{" not in path]
        # A device with one goal at a time gives it no id.
        if nameless and not (isinstance(made, Acts) and made.id is None and len(nameless) == len(asked)):
            name, path = nameless[0]
            raise error(f"{place}: {name} = {path!r} must name what it is about by {{id}}, or its body must")
    elif isinstance(made, Reads) and not call.startswith(("GET ", "POST ")):
        raise error(f"{place}: topic = {made.topic!r} is read by GET, or by an operation of a WSDL")
    return made
