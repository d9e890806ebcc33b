"""REST as elaborate as the contract lets it be: its resources, its unusual notation of values, its own descriptions.

Values are written in three formats, each in a valid but unusual notation.
"""

import json
import time
from email.message import Message
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape, quoteattr

import yaml
from lxml import etree

from proof.table1.independent_robots.body import Body, Goal, stamp
from proof.table1.independent_robots.plain import reading, rest, soap
from proof.table1.independent_robots.plain.reading import RefusedError, choose
from proof.table1.independent_robots.plain.server import Answer
from proof.table1.independent_robots.plain.soap import SOAP, TNS, FaultError

_ROOTS = {"Sensors": "sensor_list", "NavigationServices": "services", "Deliveries": "history"}
SENSORS = [
    {"name": "front laser", "topic": "/front/scan", "type": "sensor_msgs/msg/LaserScan"},
    {"name": "odometry", "topic": "/odom", "type": "nav_msgs/msg/Odometry"},
    {"name": "battery", "topic": "/battery", "type": "sensor_msgs/msg/BatteryState"},
]
SERVICES = [
    {"name": "compute_path_to_pose", "type": "nav2_msgs/action/ComputePathToPose"},
    {"name": "navigate_to_pose", "type": "nav2_msgs/action/NavigateToPose"},
]
_ACTIVE_S = 0.5
_DESCRIPTIONS = {"/openapi.json", "/application.wadl"}


def as_json(value: Any) -> bytes:
    """Return JSON: indented, keys in reverse order, characters escaped, floats with an exponent."""
    return _json(value, "\n").encode()


def _json(value: Any, indent: str) -> str:
    if isinstance(value, dict):
        inner = f",{indent}\t".join(
            f"{json.dumps(key)} : {_json(part, indent + chr(9))}" for key, part in reversed(value.items())
        )
        return f"{{{indent}\t{inner}{indent}}}"
    if isinstance(value, list):
        return "[ " + " , ".join(_json(part, indent + "\t") for part in value) + " ]"
    if isinstance(value, float):
        # 17 significant digits give every double back.
        return f"{value:.16E}"
    return json.dumps(value)


def as_xml(root: str, value: Any, *, namespace: str = "") -> bytes:
    """Return XML with comments and CDATA; items of an array are nested under its field."""
    top = etree.Element(
        f"{{{namespace}}}{root}" if namespace else _ROOTS.get(root, root), nsmap={"unused": "urn:example:unused"}
    )
    fill(top, value, namespace)
    top.insert(0, etree.Comment(" from a robot "))
    return etree.tostring(top, xml_declaration=True, encoding="UTF-8")


def fill(element: Any, value: Any, namespace: str = "", *, nested: bool = True) -> None:
    """Put a value into an lxml element; without ``nested``, array items repeat their field's element."""
    if isinstance(value, dict):
        for key, part in value.items():
            parts = part if isinstance(part, list) and not nested else [part]
            for item in parts:
                fill(
                    etree.SubElement(element, f"{{{namespace}}}{key}" if namespace else key),
                    item,
                    namespace,
                    nested=nested,
                )
    elif isinstance(value, list):
        for item in value:
            fill(etree.SubElement(element, "element"), item, namespace, nested=nested)
    elif isinstance(value, str):
        text = "".join(
            char if char in "\t\n\r" or (char >= " " and char not in "\ufffe\uffff") else "?" for char in value
        )
        # A carriage return would not survive in CDATA (XML 1.0 2.11).
        element.text = text if "\r" in text or "]]>" in text or not text else etree.CDATA(text)
    elif isinstance(value, float):
        element.text = f"\n{value:.16E} "
    else:
        element.text = f" +{value} " if isinstance(value, int) and value >= 0 else str(value)


def as_text(value: Any) -> bytes:
    """Return YAML, in flow style where it is short, with the marker that ros2 topic echo prints after each message."""
    text: str = yaml.safe_dump(value, default_flow_style=None, sort_keys=True, width=60, allow_unicode=False)
    return f"{text}---\n".encode()


def problem(status: int, detail: str, *, xml: bool = False) -> Answer:
    """Return an error response with every member that RFC 9457 defines."""
    value = {
        "type": f"/problems/{status}",
        "title": "Nothing came of it",
        "status": status,
        "detail": detail,
        "instance": "/robot/troubles/1",
        "advice": "see the manual",
    }
    if xml:
        body, media_type = as_xml("problem", value, namespace="urn:ietf:rfc:7807"), "application/problem+xml"
    else:
        body, media_type = as_json(value), "application/problem+json; charset=utf-8"
    return Answer(status, body, media_type, {"vary": "accept"})


class Rest(rest.Rest):
    """The REST interface of one body."""

    sensors, services = SENSORS, SERVICES
    formats = ("application/json", "text/plain", "application/xml")
    charsets = dict.fromkeys(formats[1:], ";charset=UTF-8")
    allow, redirects, foresees, talks = "aLLOW", False, False, True

    def __init__(self, body: Body) -> None:
        super().__init__(body)
        self.resources["/robot/app/delivery/"] = {"GET": self._reads("Deliveries", self._deliveries)}

    def options(self, allowed: str) -> Answer:
        """Return the response to OPTIONS, with a body."""
        return Answer(200, allowed.encode(), "text/plain; charset=us-ascii", {self.allow: allowed})

    def refuse(self, refused: RefusedError, headers: Message) -> Answer:
        """Return a problem with every member."""
        xml = choose(rest.accept_of(headers), self.formats) == "application/xml"
        return problem(refused.status, str(refused), xml=xml)

    def done_answer(self, headers: Message, root: str, value: Any) -> Answer:
        """Return the value that was set."""
        return self.value_answer(200, value, root, headers)

    def goal_answer(self, goal: Goal, headers: Message, *, new: bool) -> Answer:
        """Return the goal, which is created where it is new."""
        answer = self.value_answer(201 if new else 200, rest.goal_value(goal), "MoveBaseActionGoal", headers)
        answer.fields |= {"location": "/robot/navigation/action/goal/"} if new else {}
        return answer

    def number(self, text: str, name: str, *, integer: bool = False) -> float | int:
        """Return the number that a text in a target represents; any other text is 400."""
        try:
            return reading.number(text, name, integer=integer)
        except RefusedError as refused:
            raise RefusedError(400, str(refused)) from None

    def write(self, value: Any, root: str, format_: str) -> bytes:
        """Return a value in an unusual notation, with fields of the robot's own."""
        if root == "Odometry":
            value = {**value, "serial_number": "B-17", "charge": 0.5}
        elif root == "Twist":
            value = {**value, "unit": "m/s"}
        elif root == "Sensors":
            value = [{**item, "rate": 10.0} for item in value]
        elif root == "MoveBaseActionGoal":
            value = {**value, "status": {**value["status"], "mood": "fine"}}
        if format_ == "application/xml":
            return as_xml(root, value)
        return as_json(value) if format_ == "application/json" else as_text(value)

    def _deliveries(self) -> list[dict[str, Any]]:
        """Return the latest accepted deliveries, newest first."""
        now = time.time()
        return [
            {
                "request": delivery.request,
                "state": "active" if now - delivery.accepted < _ACTIVE_S else "done",
                "accepted": stamp(delivery.accepted),
                "interface": delivery.interface,
            }
            for delivery in list(self._body.deliveries)
        ]

    @property
    def _described_methods(self) -> dict[str, list[str]]:
        """The methods of each resource that is described."""
        found = {path: [*methods] for path, methods in self.resources.items() if path not in _DESCRIPTIONS}
        return found | {rest.DELIVERY: ["PUT"]}

    def _openapi(self, _headers: Message, _body: bytes, _target: str) -> Answer:
        """Return an OpenAPI 3.0 description with the parts that the contract requires, and no schemas."""
        paths = {
            path: {
                method.lower(): {
                    "responses": {"default": {"description": "see the contract"}},
                    **({"parameters": _parameters(path)} if _parameters(path) else {}),
                    **({"requestBody": {"content": {"application/json": {}}}} if _has_body(method, path) else {}),
                }
                for method in methods
            }
            for path, methods in self._described_methods.items()
        }
        about = {"openapi": "3.0.3", "info": {"title": "baroque", "version": "1"}, "servers": [{"url": "/"}]}
        return Answer(200, json.dumps({**about, "paths": paths}, indent=1).encode(), "application/json")

    def _wadl(self, headers: Message, _body: bytes, _target: str) -> Answer:
        """Return a WADL description whose resources are nested as Jersey nests them."""
        inner = "".join(
            _wadl_resource(path.removeprefix("/robot/"), methods) for path, methods in self._described_methods.items()
        )
        base = quoteattr(f"http://{headers.get('Host', 'localhost')}")
        text = (
            '<application xmlns="http://wadl.dev.java.net/2009/02" xmlns:xsd="http://www.w3.org/2001/XMLSchema">'
            f"<resources base={base}>"
            f"<resource path='/robot'>{inner}</resource></resources></application>"
        )
        return Answer(200, text.encode(), "application/xml")


def _has_body(method: str, path: str) -> bool:
    return method == "PUT" and "{" not in path


def _parameters(path: str) -> list[dict[str, Any]]:
    number, text = {"type": "number", "format": "double"}, {"type": "string"}
    if "{" in path:
        names = [part[1:-1] for part in path.split("/") if part.startswith("{")]
        whole = {"type": "integer", "format": "int32"}
        return [
            {"in": "path", "name": name, "required": True, "schema": whole if name == "code" else number}
            for name in names
        ]
    if not path.endswith("/plan"):
        return []
    return [
        {
            "in": "query",
            "name": name.rstrip("?"),
            "required": not name.endswith("?"),
            "schema": text if kind == "string" else number,
        }
        for name, kind in reading.PLAN.items()
    ]


def _wadl_resource(path: str, methods: list[str]) -> str:
    types = {"integer": "int", "number": "double", "string": "string"}
    said = {
        where: "".join(
            f"<param style='{style}' name='{parameter['name']}' type='xsd:{types[parameter['schema']['type']]}'"
            f"{' required=' + chr(39) + 'true' + chr(39) if where == 'query' and parameter['required'] else ''}/>"
            for parameter in _parameters("/robot/" + path)
            if parameter["in"] == where
        )
        for where, style in (("path", "template"), ("query", "query"))
    }
    body = "".join(
        f"<method name='{method}'>"
        + (f"<request>{said['query']}</request>" if said["query"] else "")
        + "<response><representation mediaType='application/json'/></response></method>"
        for method in methods
    )
    return f"<resource path='{path}'>{said['path']}{body}</resource>"


class Soap(soap.Soap):
    """The SOAP interface of one body."""

    sensors, services = SENSORS, SERVICES
    folder, files = Path(__file__).parent, {"wsdl": "wsdl", "xsd=1": "xsd"}

    def malformed_answer(self, problem: str) -> Answer:
        """Return a fault for content that is no XML."""
        return self.fault("Client", problem)

    def no_goal(self) -> list[Any]:
        """Return a fault which says that there is no goal.

        Raises:
            FaultError: always.
        """
        raise FaultError("Client", "the robot has no goal")

    def response(self, operation: str, values: list[Any]) -> str:
        """Return the response element, whose children are in no namespace although it has a default one."""
        content = "".join(_without_namespace("return", value) for value in values)
        return f'<{operation}Response xmlns="{TNS}"><!-- answered -->{content}</{operation}Response>'

    def envelop(self, status: int, content: str) -> Answer:
        """Return a SOAP message."""
        text = f'<!-- baroque --><Envelope xmlns="{SOAP}"><Body>\n {content}\n </Body></Envelope>'
        return Answer(status, text.encode(), 'text/xml; charset="UTF-8"')

    def fault(self, code: str, text: str) -> Answer:
        """Return a fault with a detail of its own."""
        said = escape("".join(char if char.isprintable() else " " for char in text))
        return self.envelop(
            500,
            f'<Fault><faultcode xmlns="" xmlns:code="{SOAP}">\n code:{code} </faultcode>'
            f'<faultstring xmlns="" xml:lang="en">{said}</faultstring>'
            f'<detail xmlns=""><advice xmlns="urn:example:baroque">see the manual</advice></detail></Fault>',
        )


def _without_namespace(name: str, value: Any) -> str:
    element = etree.Element(name)
    fill(element, value, nested=False)
    return etree.tostring(element, encoding="unicode").replace(f"<{name}", f'<{name} xmlns=""', 1)
