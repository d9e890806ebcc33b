"""The resources of Table 1 and the delivery, without the list of deliveries."""

import json
import re
import time
from collections.abc import Callable, Mapping
from email.message import Message
from types import MappingProxyType
from typing import Any
from urllib.parse import parse_qsl, unquote, urlsplit

import yaml

from conformance.papers_robot.statement import CONTRACT_DIR
from proof.table1.independent_robots.body import Body, BusyError, ConflictError, Goal, NoPlanError, pose, stamp, yaw_of
from proof.table1.independent_robots.plain import reading
from proof.table1.independent_robots.plain.reading import FORMATS, RefusedError, as_json, choose, element, write
from proof.table1.independent_robots.plain.server import Answer

_FRAMES = ("map", "odom")
# Time for which a goal is accepted before it is executing (action_msgs/GoalStatus), s.
_NEW_S = 0.05
SENSORS = [
    {"name": "lidar", "topic": "/scan", "type": "sensor_msgs/msg/LaserScan"},
    {"name": "imu", "topic": "/imu", "type": "sensor_msgs/msg/Imu"},
]
SERVICES = [
    {"name": "/get_plan", "type": "nav_msgs/srv/GetPlan"},
    {"name": "/navigate_to_pose", "type": "nav2_msgs/action/NavigateToPose"},
]
_DELIVERY = re.compile(
    "/robot/app/delivery/([^/]*)/depot_x/([^/]*)/depot_y/([^/]*)/dest_x/([^/]*)/dest_y/([^/]*)"
    "/source_x/([^/]*)/source_y/([^/]*)"
)
_ORDER = ("depot_x", "depot_y", "destination_x", "destination_y", "source_x", "source_y")
Handler = Callable[[Message, bytes, str], Answer]
# The path of the delivery, for routers that know parameters in braces.
DELIVERY = (
    "/robot/app/delivery/{code}/depot_x/{depot_x}/depot_y/{depot_y}/dest_x/{dest_x}/dest_y/{dest_y}"
    "/source_x/{source_x}/source_y/{source_y}"
)


class Rest:
    """The REST interface of one body. Other robots override what they do differently.

    Attributes:
        resources: by path without parameters and by method, a function of headers, body and target that returns the
            response or raises RefusedError.
        formats: media types of responses, the usual one first.
        charsets: what formats add to their media type.
        allow: how the header Allow is written.
        redirects: whether a path without its trailing slash is redirected.
        foresees: whether a goal off the map is refused at once.
        talks: whether each PUT is answered with a body.
    """

    sensors, services, formats = SENSORS, SERVICES, FORMATS
    charsets: Mapping[str, str] = MappingProxyType({"text/plain": "; charset=utf-8"})
    allow, redirects, foresees, talks = "Allow", True, True, False

    def __init__(self, body: Body) -> None:
        self._body = body
        get, put, delete = "GET", "PUT", "DELETE"
        self.resources: dict[str, dict[str, Handler]] = {
            "/robot/pose/": {get: self._reads("Odometry", body.odometry)},
            "/robot/velocity/": {get: self._reads("Twist", body.velocity), put: self._put_velocity},
            "/robot/velocity/linear/": {
                get: self._reads("Vector3", lambda: body.velocity()["linear"]),
                put: self._put_linear,
            },
            "/robot/sensors/": {get: self._reads("Sensors", lambda: self.sensors)},
            "/robot/navigation/services/": {get: self._reads("NavigationServices", lambda: self.services)},
            "/robot/navigation/action/goal/": {get: self._get_goal, put: self._put_goal, delete: self._delete_goal},
            "/robot/navigation/service/plan": {get: self._get_plan},
            "/openapi.json": {get: self._openapi},
            "/application.wadl": {get: self._wadl},
        }

    def answer(self, method: str, target: str, headers: Message, body: bytes) -> Answer:
        """Return the response to a request; a rejected request gets a problem."""
        try:
            answer = self._answer(method, target, headers, body)
        except RefusedError as refused:
            answer = self.refuse(refused, headers)
            if refused.status == 405:  # noqa: PLR2004 - RFC 9110 15.5.6
                answer.fields[self.allow] = ", ".join(self._allowed_methods(target))
        return answer

    def _methods(self, path: str) -> dict[str, Handler] | None:
        if path in self.resources:
            return self.resources[path]
        return {"PUT": self.deliver} if _DELIVERY.fullmatch(path) else None

    def _allowed_methods(self, target: str) -> list[str]:
        methods = self._methods(urlsplit(target).path) or {}
        return [*methods, *(["HEAD"] if "GET" in methods else []), "OPTIONS"]

    def _answer(self, method: str, target: str, headers: Message, body: bytes) -> Answer:
        if target == "*":
            return Answer(204, fields={"Allow": "GET, HEAD, PUT, DELETE, OPTIONS"})
        path, _, query = target.partition("?")
        methods = self._methods(path)
        if methods is None:
            if self.redirects and path + "/" in self.resources:
                return Answer(308, fields={"Location": path + "/" + ("?" + query if query else "")})
            raise RefusedError(404, f"there is no {path[:200]!r}")
        if method == "OPTIONS":
            return self.options(", ".join(self._allowed_methods(target)))
        handler = methods.get("GET" if method == "HEAD" else method)
        if handler is None:
            raise RefusedError(405, f"there is no {method[:40]} here")
        if method == "PUT" and self.talks:
            self._format(headers)  # before anything is done
        return handler(headers, body, target)

    def options(self, allowed: str) -> Answer:
        """Return the response to OPTIONS of a resource with these methods."""
        return Answer(204, fields={self.allow: allowed})

    def refuse(self, refused: RefusedError, headers: Message) -> Answer:
        """Return the response to a request that is refused."""
        return refusal(refused, headers)

    def done_answer(self, _headers: Message, _root: str, _value: Any) -> Answer:
        """Return the response to a PUT that was carried out, with the value that it has set."""
        return Answer(204)

    def goal_answer(self, goal: Goal, headers: Message, *, new: bool) -> Answer:
        """Return the response to the PUT of a goal."""
        return self.value_answer(202, goal_value(goal), "MoveBaseActionGoal", headers) if new else Answer(204)

    def number(self, text: str, name: str, *, integer: bool = False) -> float | int:
        """Return the number that a text in a target represents."""
        return reading.number(text, name, integer=integer)

    def write(self, value: Any, root: str, format_: str) -> bytes:
        """Return a value in a format."""
        return write(value, root, format_)

    def _reads(self, root: str, value: Callable[[], Any]) -> Callable[[Message, bytes, str], Answer]:
        def read(headers: Message, _body: bytes, _target: str) -> Answer:
            return self.value_answer(200, value(), root, headers)

        return read

    def _input(self, headers: Message, body: bytes, root: str, shape: Any) -> Any:
        media_type = headers.get_content_type() if "Content-Type" in headers else ""
        charset = str(headers.get_param("charset", "utf-8") or "").lower()
        if media_type not in {"application/json", "application/xml"} or charset not in {"utf-8", "utf8", "us-ascii"}:
            raise RefusedError(415, f"Content-Type: {headers.get('Content-Type', 'none')!r} is not taken")
        if media_type == "application/json":
            return reading.fit(reading.parse_json(body), shape)
        top = reading.parse_xml(body)
        if top.name != root:
            raise RefusedError(422, f"{top.name[:200]!r} is not {root!r}")
        return reading.fit_element(top, shape, root, ordered=False)

    def _put_velocity(self, headers: Message, body: bytes, _target: str) -> Answer:
        twist = self._input(headers, body, "Twist", reading.TWIST)
        for part, axis in (("linear", "y"), ("linear", "z"), ("angular", "x"), ("angular", "y")):
            if abs(twist[part][axis]) > self._body.further_axes:
                raise RefusedError(422, f"{part}.{axis}: {twist[part][axis]!r} cannot be actuated, it must be 0")
        self._drive(twist["linear"]["x"], twist["angular"]["z"])
        return self.done_answer(headers, "Twist", twist)

    def _put_linear(self, headers: Message, body: bytes, _target: str) -> Answer:
        vector = self._input(headers, body, "Vector3", reading.VECTOR3)
        for axis in ("y", "z"):
            if abs(vector[axis]) > self._body.further_axes:
                raise RefusedError(422, f"{axis}: {vector[axis]!r} cannot be actuated, it must be 0")
        self._drive(vector["x"], None)
        return self.done_answer(headers, "Vector3", vector)

    def _drive(self, v: float, w: float | None) -> None:
        limits = self._body.build
        if abs(v) > limits.linear_m_s:
            raise RefusedError(422, f"{'x' if w is None else 'linear.x'}: {v!r} is beyond {limits.linear_m_s} m/s")
        if w is not None and abs(w) > limits.angular_rad_s:
            raise RefusedError(422, f"angular.z: {w!r} is beyond {limits.angular_rad_s} rad/s")
        try:
            self._body.drive(v, w)
        except BusyError:
            raise RefusedError(409, "a goal is active") from None

    def _get_goal(self, headers: Message, _body: bytes, _target: str) -> Answer:
        goal = self._body.current()
        if goal is None:
            raise RefusedError(404, "there is no goal")
        return self.value_answer(200, goal_value(goal), "MoveBaseActionGoal", headers)

    def _put_goal(self, headers: Message, body: bytes, _target: str) -> Answer:
        self._format(headers)  # before anything is done
        given = self._input(headers, body, "MoveBaseActionGoal", reading.GOAL)
        target = given["goal"]["target_pose"]
        where = "goal.target_pose"
        frame, q, at = target["header"]["frame_id"], target["pose"]["orientation"], target["pose"]["position"]
        if frame not in _FRAMES:
            raise RefusedError(422, f"{where}.header.frame_id: {frame!r} is no frame of this robot")
        length = sum(part * part for part in q.values()) ** 0.5
        if not abs(length - 1) <= 1e-3:  # noqa: PLR2004 - contract, fine print
            raise RefusedError(422, f"{where}.pose.orientation: {json.dumps(q)} is {length!r} long")
        if self.foresees and not self._body.knows(at["x"], at["y"]):
            raise RefusedError(422, f"{where}.pose.position: {at['x']!r}, {at['y']!r} is not on the map")
        try:
            goal, new = self._body.send(given.get("goal_id", {}).get("id"), target["pose"], frame)
        except ConflictError:
            raise RefusedError(409, f"goal_id.id: {given['goal_id']['id']!r} has another pose") from None
        return self.goal_answer(goal, headers, new=new)

    def _delete_goal(self, _headers: Message, _body: bytes, _target: str) -> Answer:
        if not self._body.cancel() and self.foresees:
            raise RefusedError(404, "there is no goal")
        return Answer(204)

    def _get_plan(self, headers: Message, _body: bytes, target: str) -> Answer:
        given: dict[str, Any] = {}
        for name, text in parse_qsl(target.partition("?")[2], keep_blank_values=True):
            kind = reading.PLAN.get(name) or reading.PLAN.get(name + "?")
            if kind:
                given[name] = text if kind == "string" else self.number(text, name)
        for name in ("x", "y"):
            if name not in given:
                raise RefusedError(422, f"{name}: missing in the query")
        return self.value_answer(200, plan_value(self._body, given), "GetPlan", headers)

    def deliver(self, headers: Message, _body: bytes, target: str) -> Answer:
        """Accept a delivery.

        Raises:
            RefusedError: the path has a text that is not a number, or an unknown code.
        """
        found = _DELIVERY.fullmatch(target.partition("?")[0])
        code, *texts = [unquote(text) for text in (found.groups() if found else ())]
        deliver(
            self._body,
            "rest",
            self.number(code, "code", integer=True),
            [self.number(text, name) for name, text in zip(_ORDER, texts, strict=True)],
        )
        return self.done_answer(headers, "Accepted", {"accepted": "thank you"})

    def _openapi(self, _headers: Message, _body: bytes, _target: str) -> Answer:
        document = yaml.safe_load((CONTRACT_DIR / "openapi.yaml").read_text(encoding="utf-8"))
        document["servers"] = [{"url": "/"}]
        return Answer(200, json.dumps(document, default=str).encode(), "application/json")

    def _wadl(self, headers: Message, _body: bytes, _target: str) -> Answer:
        wadl = (CONTRACT_DIR / "robot.wadl").read_bytes()
        host = str(headers.get("Host", "")).encode()
        return Answer(200, wadl.replace(b"127.0.0.1:7003", host), "application/vnd.sun.wadl+xml")

    def value_answer(self, status: int, value: Any, root: str, headers: Message) -> Answer:
        """Return a response with a value in the format that the client accepts.

        Raises:
            RefusedError: the client accepts none of the formats.
        """
        format_ = self._format(headers)
        media_type = format_ + self.charsets.get(format_, "")
        return Answer(status, self.write(value, root, format_), media_type, {"Vary": "Accept"})

    def _format(self, headers: Message) -> str:
        format_ = choose(accept_of(headers), self.formats)
        if format_ is None:
            raise RefusedError(406, f"Accept: {headers.get('Accept')!r} has nothing of this robot's")
        return format_


def refusal(refused: RefusedError, headers: Message) -> Answer:
    """Return a problem, as XML if the client prefers XML."""
    document, fields = {"status": refused.status, "detail": str(refused)}, {"Vary": "Accept"}
    if choose(accept_of(headers)) == "application/xml":
        document["detail"] = _printable(str(refused))
        xml = element("problem", document).replace("<problem>", '<problem xmlns="urn:ietf:rfc:7807">', 1)
        return Answer(refused.status, xml.encode(), "application/problem+xml", fields)
    return Answer(refused.status, as_json(document), "application/problem+json", fields)


def deliver(body: Body, interface: str, code: float, values: list[float]) -> None:
    """Accept a delivery.

    Raises:
        RefusedError: there is no such code.
    """
    if code not in {3, 4}:
        raise RefusedError(422, f"code: {code!r} is neither 3 nor 4")
    body.deliver(interface, message_code=code, **dict(zip(_ORDER, values, strict=True)))


def goal_value(goal: Goal) -> dict[str, Any]:
    """Return a goal as a MoveBaseActionGoal."""
    since, header = stamp(goal.stamp), {"stamp": stamp(goal.stamp), "frame_id": goal.frame}
    return {
        "header": header,
        "goal_id": {"stamp": since, "id": goal.id},
        "goal": {"target_pose": {"header": header, "pose": goal.pose}},
        "status": {"code": 1 if time.time() - goal.stamp < _NEW_S else 2, "text": ""},
    }


def plan_value(body: Body, given: dict[str, Any]) -> dict[str, Any]:
    """Return a GetPlan response.

    Raises:
        RefusedError: the frame is unknown, or there is no plan.
    """
    frame = given.get("frame_id", "map")
    if frame not in _FRAMES:
        raise RefusedError(422, f"frame_id: {frame!r} is no frame of this robot")
    if given.get("tolerance", 0.1) < 0:
        raise RefusedError(422, f"tolerance: {given['tolerance']!r} is negative")
    start, end = None, (given["x"], given["y"], given.get("yaw", 0.0))
    if "start_x" in given or "start_y" in given:
        now = body.odometry()["pose"]["pose"]
        now = (now["position"]["x"], now["position"]["y"], yaw_of(now["orientation"]))
        now = now if frame == "odom" else body.on_map(*now)
        start = given.get("start_x", now[0]), given.get("start_y", now[1]), given.get("start_yaw", 0.0)
    if frame == "odom":
        start, end = start and body.on_map(*start), body.on_map(*end)
    try:
        poses = body.path(start, *end)
    except NoPlanError as none:
        raise RefusedError(422, str(none)) from None
    if frame == "odom":
        there = [(one["position"]["x"], one["position"]["y"], yaw_of(one["orientation"])) for one in poses]
        poses = [pose(*body.in_odom(*one)) for one in there]
    header = {"stamp": body.odometry()["header"]["stamp"], "frame_id": frame}
    return {"plan": {"header": header, "poses": [{"header": header, "pose": one} for one in poses]}}


def accept_of(headers: Message) -> str | None:
    """Return the client's Accept; None if there is none."""
    fields = headers.get_all("Accept")
    return None if fields is None else ", ".join(fields)


def _printable(text: str) -> str:
    return "".join(char if char.isprintable() else "?" for char in text)
