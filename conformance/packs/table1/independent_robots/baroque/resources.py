"""What the robot shows: its values in the form of ROS types, with fields of its own, and its descriptions."""

import time
from typing import Any
from xml.sax.saxutils import quoteattr

from conformance.packs.table1.independent_robots.baroque.judging import NotTakenError
from conformance.packs.table1.independent_robots.body import Body, Goal, NoPlanError, pose, stamp, yaw_of

SENSORS = [
    {"name": "front laser", "topic": "/front/scan", "type": "sensor_msgs/msg/LaserScan"},
    {"name": "odometry", "topic": "/odom", "type": "nav_msgs/msg/Odometry"},
    {"name": "battery", "topic": "/battery", "type": "sensor_msgs/msg/BatteryState"},
]
SERVICES = [
    {"name": "compute_path_to_pose", "type": "nav2_msgs/action/ComputePathToPose"},
    {"name": "navigate_to_pose", "type": "nav2_msgs/action/NavigateToPose"},
]
FRAMES = ("map", "odom")
PLAN_NUMBERS = ("x", "y", "yaw", "tolerance", "start_x", "start_y", "start_yaw")
DELIVERY_PATH = (
    "/robot/app/delivery/{code}/depot_x/{depot_x}/depot_y/{depot_y}/dest_x/{dest_x}/dest_y/{dest_y}"
    "/source_x/{source_x}/source_y/{source_y}"
)
# Resources with their methods, as they are described and allowed.
METHODS = {
    "/robot/app/delivery/": ("GET",),
    DELIVERY_PATH: ("PUT",),
    "/robot/navigation/action/goal/": ("DELETE", "GET", "PUT"),
    "/robot/navigation/service/plan": ("GET",),
    "/robot/navigation/services/": ("GET",),
    "/robot/pose/": ("GET",),
    "/robot/sensors/": ("GET",),
    "/robot/velocity/": ("GET", "PUT"),
    "/robot/velocity/linear/": ("GET", "PUT"),
}
_ACTIVE_S = 0.5


def goal_value(goal: Goal, *, plain: bool = False) -> dict[str, Any]:
    """Return a goal as a MoveBaseActionGoal; unless ``plain``, with fields beyond the contract."""
    header = {"stamp": stamp(goal.stamp), "frame_id": goal.frame}
    code = 1 if time.time() - goal.stamp < 0.05 else 2  # noqa: PLR2004 - s
    status: dict[str, Any] = {"code": code, "text": "on my way"}
    return {
        "header": header,
        "goal_id": {"stamp": stamp(goal.stamp), "id": goal.id},
        "goal": {"target_pose": {"header": header, "pose": goal.pose}},
        "status": status if plain else {**status, "mood": "fine"},
    }


def plan_value(body: Body, given: dict[str, Any]) -> dict[str, Any]:
    """Return a GetPlan response.

    Raises:
        NotTakenError: the frame is unknown, or there is no plan.
    """
    frame = given.get("frame_id", "map")
    if frame not in FRAMES:
        raise NotTakenError(422, f"frame_id: {frame!r:.200} is none of {', '.join(FRAMES)}")
    if given.get("tolerance", 0.1) < 0:
        raise NotTakenError(422, f"tolerance: {given['tolerance']} is less than 0")
    there = (given["x"], given["y"], given.get("yaw", 0.0))
    start = None
    if "start_x" in given and "start_y" in given:
        start = (given["start_x"], given["start_y"], given.get("start_yaw", 0.0))
    elif "start_x" in given or "start_y" in given:
        raise NotTakenError(422, "start_x, start_y: one of them is missing")
    if frame == "odom":
        there, start = body.on_map(*there), body.on_map(*start) if start else None
    try:
        poses = body.path(start, *there)
    except NoPlanError as none:
        raise NotTakenError(422, str(none)) from None
    header = {"stamp": stamp(time.time()), "frame_id": frame}
    if frame == "odom":
        poses = [
            pose(*body.in_odom(one["position"]["x"], one["position"]["y"], yaw_of(one["orientation"]))) for one in poses
        ]
    return {"plan": {"header": header, "poses": [{"header": header, "pose": one} for one in poses]}}


def deliveries(body: Body) -> list[dict[str, Any]]:
    """Return the latest accepted deliveries, newest first."""
    return [
        {
            "request": one.request,
            "state": "active" if time.time() - one.accepted < _ACTIVE_S else "done",
            "accepted": stamp(one.accepted),
            "interface": one.interface,
        }
        for one in list(body.deliveries)
    ]


def openapi() -> dict[str, Any]:
    """Return an OpenAPI 3.0 description with the parts that the contract requires, and no schemas."""
    paths: dict[str, Any] = {}
    for path, methods in METHODS.items():
        paths[path] = {
            method.lower(): {
                "responses": {"default": {"description": "see the contract"}},
                **({"parameters": _parameters(path)} if _parameters(path) else {}),
                **(
                    {"requestBody": {"content": {"application/json": {}}}}
                    if method == "PUT" and "{" not in path
                    else {}
                ),
            }
            for method in methods
        }
    return {"openapi": "3.0.3", "info": {"title": "baroque", "version": "1"}, "servers": [{"url": "/"}], "paths": paths}


def _parameters(path: str) -> list[dict[str, Any]]:
    number, text = {"type": "number", "format": "double"}, {"type": "string"}
    if path == DELIVERY_PATH:
        names = [part[1:-1] for part in path.split("/") if part.startswith("{")]
        whole = {"type": "integer", "format": "int32"}
        return [
            {"in": "path", "name": name, "required": True, "schema": whole if name == "code" else number}
            for name in names
        ]
    if path.endswith("/plan"):
        return [
            {"in": "query", "name": name, "required": name in {"x", "y"}, "schema": number} for name in PLAN_NUMBERS
        ] + [{"in": "query", "name": "frame_id", "required": False, "schema": text}]
    return []


def wadl(base: str) -> bytes:
    """Return a WADL description whose resources are nested as Jersey nests them."""
    inner = "".join(_wadl_resource(path.removeprefix("/robot/"), methods) for path, methods in METHODS.items())
    text = (
        '<ns2:application xmlns:ns2="http://wadl.dev.java.net/2009/02" xmlns:xsd="http://www.w3.org/2001/XMLSchema">'
        f"<ns2:resources base={quoteattr(base)}><ns2:resource path='/robot'>{inner}</ns2:resource></ns2:resources>"
        "</ns2:application>"
    )
    return text.replace("<ns2:", "<").replace("</ns2:", "</").replace("xmlns:ns2=", "xmlns=").encode()


def _wadl_resource(path: str, methods: tuple[str, ...]) -> str:
    template = "".join(
        f"<param style='template' name='{one['name']}' type='xsd:{'int' if one['name'] == 'code' else 'double'}'/>"
        for one in _parameters("/robot/" + path)
        if one["in"] == "path"
    )
    query = "".join(
        f"<param style='query' name='{one['name']}' type='xsd:{one['schema']['type'].replace('number', 'double')}'"
        f"{' required=' + chr(39) + 'true' + chr(39) if one['required'] else ''}/>"
        for one in _parameters("/robot/" + path)
        if one["in"] == "query"
    )
    body = "".join(
        f"<method name='{method}'>"
        + (f"<request>{query}</request>" if query else "")
        + "<response><representation mediaType='application/json'/></response></method>"
        for method in methods
    )
    return f"<resource path='{path}'>{template}{body}</resource>"
