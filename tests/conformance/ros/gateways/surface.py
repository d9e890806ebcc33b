"""What the gateways serve, the OpenAPI of each and its ROS map: `python surface.py STYLE DOMAIN FOLDER` writes them."""

import json
import sys
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from messages import Forms, interface

DEADLINE_S = 2.0


@dataclass(frozen=True)
class End:
    """One topic, service or action that a gateway serves under a name."""

    name: str
    ros: str
    type: str
    max_age_s: float | None = None


READS = (
    End("odom", "/odom", "nav_msgs/msg/Odometry", 2.0),
    End("scan", "/scan", "sensor_msgs/msg/LaserScan", 2.0),
    End("camera", "/camera", "sensor_msgs/msg/CompressedImage", 2.0),
    End("counts", "/counts", "std_msgs/msg/UInt64MultiArray", 2.0),
    End("parameter", "/parameter", "rcl_interfaces/msg/ParameterValue", 2.0),
    End("status", "/status", "std_msgs/msg/String", 2.0),
    End("note", "/note", "std_msgs/msg/String"),
)
PUBLISHES = (
    End("velocity", "/cmd_vel", "geometry_msgs/msg/Twist"),
    End("say", "/say", "std_msgs/msg/String"),
    End("offsets", "/offsets", "std_msgs/msg/Int64MultiArray"),
    End("setting", "/setting", "rcl_interfaces/msg/ParameterValue"),
)
SERVICES = (End("enable", "/enable", "std_srvs/srv/SetBool"), End("route", "/route", "nav_msgs/srv/GetPlan"))
# Parameters of a node: their names, the node, and their types.
PARAMETERS = (
    End("max_speed", "/base", "double"),
    End("count", "/base", "integer"),
    End("on", "/base", "bool"),
    End("modes", "/base/inner", "string_array"),
    End("key", "/base/inner", "byte_array"),
)
_ITEMS = {"bool": "boolean", "integer": "integer", "double": "number", "string": "string", "byte": "string"}
ACTION = End("navigate", "/navigate", "nav2_msgs/action/NavigateToPose")


@dataclass(frozen=True)
class Style:
    """How one gateway lays its interface out; `{}` in a path is the name of an end."""

    forms: Forms
    reads: str
    publishes: str
    services: str
    goals: str
    cancel: str
    topics: str
    parameters: str = ""
    read_at: str = ""
    publish_at: str = ""
    call_at: str = ""
    result_at: str = ""
    goal_at: str = ""
    id_at: str = "/id"
    state_at: str = "/state"
    feedback_at: str = "/feedback"
    outcome_at: str = "/result"
    streams: dict[str, str] = field(default_factory=dict)
    topics_at: str = ""
    topic_at: str = "/name"
    type_at: str = "/type"
    absent: int = 404
    published: int = 200
    accepted: int = 202
    cancelled: int = 202
    refused: int | None = 409
    key: str = ""
    disconnect: str = ""
    states: dict[str, list[Any]] = field(default_factory=dict)


_WORDS: dict[str, list[Any]] = {
    "running": ["executing", "canceling"],
    "succeeded": ["succeeded"],
    "aborted": ["aborted"],
    "canceled": ["canceled"],
}
STYLES = {
    "fastapi": Style(
        Forms(required=True),
        key="Idempotency-Key",
        reads="/api/v1/topics/{}",
        read_at="/data",
        publishes="/api/v1/topics/{}",
        published=202,
        services="/api/v1/services/{}",
        result_at="/result",
        goals="/api/v1/goals",
        goal_at="/goal",
        cancel="POST /api/v1/goals/{id}/cancel",
        topics="/api/v1/topics",
        parameters="/api/v1/parameters/{}",
        topics_at="/topics",
        states=_WORDS,
        streams={"/api/v1/topics/{}/events": "sse"},
    ),
    "aiohttp": Style(
        Forms(non_finite="string", integers="string", bytes="array"),
        reads="/ros/{}",
        absent=503,
        publishes="/ros/{}/messages",
        publish_at="/message",
        published=204,
        services="/ros/{}/calls",
        call_at="/request",
        goals="/ros/{}/goals",
        id_at="/goal_id",
        state_at="/status",
        feedback_at="/latest",
        outcome_at="/outcome",
        accepted=201,
        refused=422,
        disconnect="goes on",
        cancel="DELETE /ros/{}/goals/{id}",
        cancelled=204,
        topics="/ros",
        topic_at="/topic",
        type_at="/kind",
        streams={"/ros/{}/events": "sse", "/ros/{}/events?every_ms=200": "sse", "/ros/{}/socket": "websocket"},
        states={"running": [1, 2, 3], "succeeded": [4], "canceled": [5], "aborted": [6]},
    ),
    "flask": Style(
        Forms(non_finite="string", bytes="base64"),
        reads="/state/{}",
        read_at="/msg",
        publishes="/command/{}",
        services="/do/{}",
        result_at="/answer",
        goals="/tasks",
        goal_at="/input",
        id_at="/task/uid",
        state_at="/task/phase",
        feedback_at="/task/progress",
        outcome_at="/task/output",
        accepted=201,
        refused=None,
        cancel="POST /tasks/{id}/abort",
        cancelled=200,
        topics="/topics",
        parameters="/params/{}",
        states={
            "running": ["running"],
            "succeeded": ["done"],
            "canceled": ["stopped"],
            "aborted": ["failed"],
            "rejected": ["rejected"],
        },
    ),
    "node": Style(
        Forms(bytes="base64"),
        reads="/robot/{}",
        read_at="/message",
        absent=503,
        publishes="/robot/{}",
        publish_at="/message",
        services="/robot/{}",
        call_at="/args",
        result_at="/values",
        goals="/robot/{}",
        goal_at="/args",
        state_at="/status",
        refused=None,
        cancel="DELETE /robot/{}/{id}",
        cancelled=200,
        topics="/robot",
        topics_at="/topics",
        states={
            "running": ["RUNNING"],
            "succeeded": ["SUCCEEDED"],
            "canceled": ["CANCELED"],
            "aborted": ["ABORTED"],
            "rejected": ["REJECTED"],
        },
    ),
}


def ros_map(style: Style, domain_id: int) -> str:
    """Return the tables `[ros]` and `[ros.operations]` of a statement."""
    forms = style.forms
    lines = ["[ros]", f"domain_id = {domain_id}"]
    lines += [f'non_finite = "{forms.non_finite}"', f'integers = "{forms.integers}"', f'bytes = "{forms.bytes}"']
    operations: dict[str, dict[str, Any]] = {}
    for end in READS:
        operations[f"GET {style.reads.format(end.name)}"] = {
            "topic": end.ros,
            "type": end.type,
            "at": style.read_at,
            "absent": [style.absent],
        } | ({"max_age_s": end.max_age_s} if end.max_age_s else {})
    for path, kind in style.streams.items():
        for end in READS[:2]:
            throttle = {"throttle_s": 0.2} if "every_ms" in path else {}
            operations[f"GET {path.format(end.name)}"] = {"topic": end.ros, "type": end.type, "stream": kind} | throttle
    for end in PUBLISHES:
        operations[f"POST {style.publishes.format(end.name)}"] = {
            "publishes": end.ros,
            "type": end.type,
            "at": style.publish_at,
            "timeout_s": 2.5 * DEADLINE_S,
        }
    for end in SERVICES:
        operations[f"POST {style.services.format(end.name)}"] = {
            "service": end.ros,
            "type": end.type,
            "at": style.call_at,
            "result": style.result_at,
            "timeout_s": 2.5 * DEADLINE_S,
        }
    for end in PARAMETERS if style.parameters else ():
        parameter = {"parameter": end.name, "node": end.ros, "type": end.type, "at": "/value"}
        path = style.parameters.format(end.name)
        operations[f"GET {path}"] = parameter
        operations[f"PUT {path}"] = parameter | {"refused": [409]}
    goals = style.goals.format(ACTION.name)
    operations[f"POST {goals}"] = {
        "action": ACTION.ros,
        "type": ACTION.type,
        "at": style.goal_at,
        "id": style.id_at,
        "state": {"read": f"GET {goals}/{{id}}", "at": style.state_at}
        | {name: [str(word) for word in words] for name, words in style.states.items()},
        "feedback": style.feedback_at,
        "result": style.outcome_at,
        "cancel": style.cancel.replace("{}", ACTION.name),
        "rejected": [style.refused] if style.refused else [],
    } | ({"disconnect": style.disconnect} if style.disconnect else {})
    operations[f"GET {style.topics}"] = {
        "lists": "topics",
        "at": style.topics_at,
        "name": style.topic_at,
        "type": style.type_at,
    }
    lines += ["", "[ros.operations]"]
    return "\n".join([*lines, *(f"{_toml(name)} = {_toml(entry)}" for name, entry in operations.items())]) + "\n"


def bridge_map(url: str, domain_id: int) -> str:
    """Return the tables `[ros]` and `[ros.rosbridge]` of a statement."""
    of = {"subscribe": READS, "publish": PUBLISHES, "call": SERVICES, "act": (ACTION,)}
    forms = STYLES["node"].forms
    lines = ["[ros]", f"domain_id = {domain_id}", f'non_finite = "{forms.non_finite}"', f'bytes = "{forms.bytes}"']
    lines += ["[ros.rosbridge]", f"url = {_toml(url)}", f"timeout_s = {2.5 * DEADLINE_S}", 'disconnect = "cancels"']
    lines += [f"{what} = {_toml({end.ros: end.type for end in ends})}" for what, ends in of.items()]
    return "\n".join(lines) + "\n"


def openapi(style: Style) -> dict[str, Any]:
    """Return the OpenAPI of a style."""
    forms = style.forms
    paths: dict[str, Any] = {}
    for end in READS:
        message = _wrapped(style.read_at, forms.schema(interface(end.type), sent=False))
        _put(paths, "get", style.reads.format(end.name), {200: message, style.absent: _ERROR})
    for path in (path for path, kind in style.streams.items() if kind == "sse" and "?" not in path):
        for end in READS[:2]:
            _put(paths, "get", path.format(end.name), {200: {"type": "string"}})
            operation = paths[path.format(end.name)]["get"]
            events = operation["responses"]["200"]
            events["content"] = {"text/event-stream": events["content"]["application/json"]}
            if f"{path}?every_ms=200" in style.streams:
                operation["parameters"] = [{"name": "every_ms", "in": "query", "schema": {"type": "integer"}}]
    for end in PUBLISHES:
        done = {style.published: None if style.published == 204 else {"type": "object"}}
        body = _wrapped(style.publish_at, forms.schema(interface(end.type), sent=True))
        _put(paths, "post", style.publishes.format(end.name), done | _REFUSED, body, style.key)
    for end in SERVICES:
        kind = interface(end.type)
        body = _wrapped(style.call_at, forms.schema(kind.Request, sent=True))
        result = _wrapped(style.result_at, forms.schema(kind.Response, sent=False))
        _put(paths, "post", style.services.format(end.name), {200: result} | _REFUSED | _UNREACHED, body, style.key)
    for end in PARAMETERS if style.parameters else ():
        item, _, array = end.type.partition("_")
        one: dict[str, Any] = {"type": _ITEMS[item]}
        value = _wrapped("/value", {"type": "array", "items": one} if array and item != "byte" else one)
        path = style.parameters.format(end.name)
        _put(paths, "get", path, {200: value} | _UNREACHED)
        _put(paths, "put", path, {204: None, 409: _ERROR} | _REFUSED | _UNREACHED, value)
    kind = interface(ACTION.type)
    path = style.goals.format(ACTION.name)
    state = {"enum": [word for words in style.states.values() for word in words]}
    begun = _merged(_wrapped(style.id_at, {"type": "string"}), _wrapped(style.state_at, state))
    feedback = {"anyOf": [forms.schema(kind.Feedback, sent=False), {"type": "null"}]}
    outcome = {"anyOf": [forms.schema(kind.Result, sent=False), {"type": "null"}]}
    goal = _merged(begun, _wrapped(style.feedback_at, feedback), _wrapped(style.outcome_at, outcome))
    body = _wrapped(style.goal_at, forms.schema(kind.Goal, sent=True))
    refused = {style.refused: _ERROR} if style.refused else {}
    _put(paths, "post", path, {style.accepted: begun} | _REFUSED | refused | _UNREACHED, body, style.key)
    _put(paths, "get", f"{path}/{{id}}", {200: goal, 404: _ERROR})
    method, _, path = style.cancel.replace("{}", ACTION.name).partition(" ")
    done = None if style.cancelled == 204 else {"type": "object"}
    _put(paths, method.lower(), path, {style.cancelled: done, 404: _ERROR, 409: _ERROR, 504: _ERROR})
    topic = _merged(_wrapped(style.topic_at, {"type": "string"}), _wrapped(style.type_at, {"type": "string"}))
    _put(paths, "get", style.topics, {200: _wrapped(style.topics_at, {"type": "array", "items": topic})})
    return {"openapi": "3.1.0", "info": {"title": "Gateway", "version": "1"}, "paths": paths}


_ERROR = {"type": "object", "properties": {"detail": {"type": "string"}}, "required": ["detail"]}
_REFUSED = {400: _ERROR, 413: _ERROR, 415: _ERROR, 422: _ERROR}
_UNREACHED = {503: _ERROR, 504: _ERROR}


def _put(paths: Any, method: str, path: str, responses: dict[int, Any], body: Any = None, key: str = "") -> None:
    operation: dict[str, Any] = {"operationId": method + path.replace("/", "_").replace("{", "").replace("}", "")}
    operation["responses"] = {
        str(status): {"description": "a response"} | ({"content": _json(schema)} if schema else {})
        for status, schema in responses.items()
    }
    if body is not None:
        operation["requestBody"] = {"required": True, "content": _json(body)}
    if key:
        operation["parameters"] = [{"name": key, "in": "header", "schema": {"type": "string"}}]
        operation["responses"].setdefault("409", {"description": "it is being performed", "content": _json(_ERROR)})
    if "{id}" in path:
        operation["parameters"] = [{"name": "id", "in": "path", "required": True, "schema": {"type": "string"}}]
    paths.setdefault(path, {})[method] = operation


def _json(schema: dict[str, Any]) -> dict[str, Any]:
    return {"application/json": {"schema": schema}}


def _wrapped(pointer: str, schema: dict[str, Any]) -> dict[str, Any]:
    for name in reversed(pointer.split("/")[1:]):
        schema = {"type": "object", "properties": {name: schema}, "required": [name]}
    return schema


def _merged(*schemas: dict[str, Any]) -> dict[str, Any]:
    first, *others = schemas
    for other in others:
        properties = dict(first["properties"])
        for name, schema in other["properties"].items():
            properties[name] = _merged(properties[name], schema) if name in properties else schema
        first = {"type": "object", "properties": properties, "required": list(properties)}
    return first


def _toml(value: Any) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{json.dumps(key)} = {_toml(item)}" for key, item in value.items()) + " }"
    return json.dumps(value)


if __name__ == "__main__":
    chosen, domain, folder = STYLES[sys.argv[1]], int(sys.argv[2]), Path(sys.argv[3])
    described = openapi(chosen)
    ends = {"reads": READS, "publishes": PUBLISHES, "services": SERVICES}
    surface: dict[str, Any] = {kind: [asdict(end) for end in found] for kind, found in ends.items()}
    surface |= {"action": asdict(ACTION), "deadline_s": DEADLINE_S, "openapi": described, "topics": chosen.topics}
    (folder / "surface.json").write_text(json.dumps(surface), encoding="utf-8")
    (folder / "openapi.json").write_text(json.dumps(described), encoding="utf-8")
    (folder / "ros.toml").write_text(ros_map(chosen, domain), encoding="utf-8")
