"""REST, by a table of resources."""

import json
import re
from collections.abc import Callable
from typing import Any
from urllib.parse import parse_qsl, unquote

from conformance.packs.table1.independent_robots.baroque import resources
from conformance.packs.table1.independent_robots.baroque.judging import (
    NotTakenError,
    from_json,
    from_xml,
    judged,
    number,
)
from conformance.packs.table1.independent_robots.baroque.server import Ask, Reply, problem
from conformance.packs.table1.independent_robots.baroque.writing import as_json, as_text, as_xml
from conformance.packs.table1.independent_robots.body import Body, ConflictError

_WRITERS: dict[str, Callable[[str, Any], bytes]] = {
    "application/json": lambda root, value: as_json(value),  # noqa: ARG005 - one signature for the three
    "text/plain": lambda root, value: as_text(value),  # noqa: ARG005 - one signature for the three
    "application/xml": as_xml,
}
_PATTERNS = {
    re.compile(re.sub(r"\\\{(\w+)\\\}", r"(?P<\1>[^/]*)", re.escape(path))): path for path in resources.METHODS
}
_UNACTUATED = (("linear", "y"), ("linear", "z"), ("angular", "x"), ("angular", "y"))


class Rest:
    """The REST interface of one body."""

    def __init__(self, body: Body) -> None:
        self._body = body

    def answer(self, ask: Ask) -> Reply:
        """Return the response to a request."""
        described = self._description(ask)
        if described is not None:
            return described
        found = next(
            ((pattern.fullmatch(ask.path), path) for pattern, path in _PATTERNS.items() if pattern.fullmatch(ask.path)),
            None,
        )
        xml = _wanted(ask) == "application/xml"
        if found is None:
            return problem(404, f"nothing is at {ask.path:.200}", xml=xml)
        match, path = found
        allowed = ", ".join(
            ("OPTIONS", *resources.METHODS[path], *(("HEAD",) if "GET" in resources.METHODS[path] else ()))
        )
        if ask.method == "OPTIONS":
            return Reply(200, allowed.encode(), "text/plain; charset=us-ascii", [("aLLOW", allowed)])
        method = "GET" if ask.method == "HEAD" else ask.method
        try:
            return self._act(ask, method, path, match.groupdict() if match else {})
        except NotTakenError as refused:
            reply = problem(refused.status, str(refused), xml=xml)
            if refused.status == 405:  # noqa: PLR2004 - RFC 9110 15.5.6
                reply.fields.append(("aLLOW", allowed))
            return reply

    def _description(self, ask: Ask) -> Reply | None:
        if ask.path not in {"/openapi.json", "/application.wadl"}:
            return None
        if ask.method == "OPTIONS":
            return Reply(200, b"GET", "text/plain", [("allow", "GET, HEAD, OPTIONS")])
        if ask.method not in {"GET", "HEAD"}:
            reply = problem(405, f"{ask.method:.40} is not for descriptions")
            reply.fields.append(("allow", "GET, HEAD, OPTIONS"))
            return reply
        if ask.path == "/openapi.json":
            return Reply(200, json.dumps(resources.openapi(), indent=1).encode(), "application/json")
        return Reply(200, resources.wadl(f"http://{ask.fields.get('host', 'localhost')}"), "application/xml")

    def _act(  # noqa: C901, PLR0911 - one for each resource
        self, ask: Ask, method: str, path: str, given: dict[str, str]
    ) -> Reply:
        if method not in resources.METHODS[path]:
            raise NotTakenError(405, f"{ask.method:.40} is none of {resources.METHODS[path]}")
        if method == "PUT":
            _format(ask)  # before anything is done
        body = self._body
        match (method, path):
            case ("GET", "/robot/pose/"):
                value = body.odometry()
                return _shown(ask, "Odometry", {**value, "serial_number": "B-17", "charge": 0.5})
            case ("GET", "/robot/velocity/"):
                return _shown(ask, "Twist", {**body.velocity(), "unit": "m/s"})
            case ("GET", "/robot/velocity/linear/"):
                return _shown(ask, "Vector3", body.velocity()["linear"])
            case ("GET", "/robot/sensors/"):
                return _shown(ask, "Sensors", [{**sensor, "rate": 10.0} for sensor in resources.SENSORS])
            case ("GET", "/robot/navigation/services/"):
                return _shown(ask, "NavigationServices", resources.SERVICES)
            case ("GET", "/robot/app/delivery/"):
                return _shown(ask, "Deliveries", resources.deliveries(body))
            case ("GET", "/robot/navigation/service/plan"):
                return self._plan(ask)
            case ("PUT", "/robot/velocity/" | "/robot/velocity/linear/"):
                return self._drive(ask, whole=path == "/robot/velocity/")
            case ("PUT", resources.DELIVERY_PATH):
                return self._deliver(ask, given)
        return self._goal(ask, method)

    def _drive(self, ask: Ask, *, whole: bool) -> Reply:
        value = _input(ask, "Twist" if whole else "Vector3")
        twist = value if whole else {"linear": value, "angular": dict.fromkeys("xyz", 0)}
        for part, axis in _UNACTUATED:
            name, most = f"{part}.{axis}" if whole else axis, self._body.further_axes
            if abs(twist[part][axis]) > most:
                raise NotTakenError(422, f"{name} = {twist[part][axis]} exceeds {most}: this robot has two wheels")
        v, w = float(twist["linear"]["x"]), float(twist["angular"]["z"])
        for name, given, limit in (
            ("linear.x" if whole else "x", v, self._body.build.linear_m_s),
            ("angular.z", w, self._body.build.angular_rad_s),
        ):
            if abs(given) > limit:
                raise NotTakenError(422, f"{name} = {given!r} exceeds {limit}")
        self._body.drive(v, w if whole else None)
        return _shown(ask, "Twist" if whole else "Vector3", value)

    def _goal(self, ask: Ask, method: str) -> Reply:
        if method == "DELETE":
            self._body.cancel()
            return Reply(204)
        if method == "GET":
            goal = self._body.current()
            if goal is None:
                raise NotTakenError(404, "the robot has no goal")
            return _shown(ask, "MoveBaseActionGoal", resources.goal_value(goal))
        value = _input(ask, "MoveBaseActionGoal")
        target = value["goal"]["target_pose"]
        frame, q = target["header"]["frame_id"], target["pose"]["orientation"]
        if frame not in resources.FRAMES:
            raise NotTakenError(422, f"goal.target_pose.header.frame_id = {frame!r:.200} is no frame here")
        square = sum(float(part) ** 2 for part in q.values()) if all(abs(part) < 2 for part in q.values()) else 4.0  # noqa: PLR2004 - longer than 1 in any case
        if not 0.999**2 <= square <= 1.001**2:
            raise NotTakenError(422, f"goal.target_pose.pose.orientation = {q} is not of unit length")
        try:
            goal, new = self._body.send(value.get("goal_id", {}).get("id"), target["pose"], frame)
        except ConflictError:
            raise NotTakenError(409, f"goal_id.id = {value['goal_id']['id']!r:.300} goes elsewhere already") from None
        reply = _shown(ask, "MoveBaseActionGoal", resources.goal_value(goal))
        if new:
            reply.status = 201
            reply.fields.append(("location", "/robot/navigation/action/goal/"))
        return reply

    def _plan(self, ask: Ask) -> Reply:
        given: dict[str, Any] = {}
        for name, text in parse_qsl(ask.query, keep_blank_values=True):
            if name == "frame_id":
                given[name] = text
            elif name in resources.PLAN_NUMBERS:
                given[name] = number(text, name)
        for name in ("x", "y"):
            if name not in given:
                raise NotTakenError(400, f"{name}: must be given")
        return _shown(ask, "GetPlan", resources.plan_value(self._body, given))

    def _deliver(self, ask: Ask, given: dict[str, str]) -> Reply:
        names = {"dest_x": "destination_x", "dest_y": "destination_y"}
        code = number(unquote(given.pop("code")), "code", whole=True)
        if code not in {3, 4}:
            raise NotTakenError(422, f"code = {code} is neither a courier item (3) nor a coffee (4)")
        values = {names.get(name, name): number(unquote(text), name) for name, text in given.items()}
        self._body.deliver("rest", message_code=code, **values)
        return _shown(ask, "Accepted", {"accepted": "thank you"})


def _input(ask: Ask, root: str) -> Any:
    media_type, _, parameters = ask.fields.get("content-type", "").partition(";")
    charset = re.search(r"charset\s*=\s*\"?([\w-]+)", parameters, re.IGNORECASE)
    if charset and charset[1].lower() not in {"utf-8", "us-ascii", "ascii"}:
        raise NotTakenError(415, f"charset {charset[1]} is not read here")
    schema = {"Twist": "TwistInput", "Vector3": "Vector3Input", "MoveBaseActionGoal": "GoalInput"}[root]
    match media_type.strip().lower():
        case "application/json":
            return judged(from_json(ask.body), schema)
        case "application/xml":
            return judged(from_xml(ask.body, root, schema), schema)
    raise NotTakenError(415, f"{media_type or 'nothing'!r:.100} is no media type that is read here")


def _wanted(ask: Ask) -> str | None:
    """Return the format for a response: the first one of those with the highest quality (RFC 9110 12.5.1), or None."""
    accept = ask.fields.get("accept", "").strip()
    if not accept:
        return "application/json"
    rated = {}
    for writer in _WRITERS:
        weights = []
        for item in accept.split(","):
            range_, *rest = [part.strip().lower() for part in item.split(";")]
            major = writer.partition("/")[0]
            if range_ in {writer, f"{major}/*", "*/*"}:
                q = next((text[2:] for text in rest if text.startswith("q=")), "1")
                weights.append(
                    (("*/*", f"{major}/*", writer).index(range_), float(q) if re.fullmatch(r"[01](\.\d*)?", q) else 0.0)
                )
        rated[writer] = max(weights)[1] if weights else 0.0
    best = max(rated.values())
    return next(writer for writer, weight in rated.items() if weight == best) if best else None


def _format(ask: Ask) -> str:
    """Return the format for a response.

    Raises:
        NotTakenError: the client accepts none of the formats.
    """
    format_ = _wanted(ask)
    if format_ is None:
        raise NotTakenError(406, f"nothing here is {ask.fields['accept']:.200}")
    return format_


def _shown(ask: Ask, root: str, value: Any) -> Reply:
    format_ = _format(ask)
    charset = ";charset=UTF-8" if format_ != "application/json" else ""
    return Reply(200, _WRITERS[format_](root, value), format_ + charset, [("vary", "accept")])
