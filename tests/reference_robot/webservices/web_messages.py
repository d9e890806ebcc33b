"""What tests send."""

from typing import Any

import httpx
from lxml import etree

from conformance.papers_robot.delivery import EXAMPLE, PATH_NAMES, XSD_FIELDS

ENVELOPE = '<s:Envelope xmlns:s="http://schemas.xmlsoap.org/soap/envelope/">{}<s:Body>{}</s:Body></s:Envelope>'
SOAP = "{http://schemas.xmlsoap.org/soap/envelope/}"
SOAP = "{http://schemas.xmlsoap.org/soap/envelope/}"
NAMESPACE = "http://soap.turtlebot.mybot.org/"


def delivery_path(code: object = 4, **coordinates: object) -> str:
    given = dict(zip(PATH_NAMES, EXAMPLE.values(), strict=True)) | coordinates
    return f"/robot/app/delivery/{code}" + "".join(f"/{name}/{value}" for name, value in given.items())


def delivery_envelope(operation: str = "ExecuteDeliveryRequest", header: str = "", **values: object) -> str:
    given = {name: (EXAMPLE | {"message_code": 4})[name] for name in XSD_FIELDS} | values
    fields = "".join(f"<{name}>{value}</{name}>" for name, value in given.items())
    return query_envelope(operation, f"<arg0>{fields}</arg0>", header)


def query_envelope(operation: str, content: str = "", header: str = "") -> str:
    return ENVELOPE.format(header, f'<t:{operation} xmlns:t="{NAMESPACE}">{content}</t:{operation}>')


def fault_of(answer: httpx.Response) -> str:
    """Return the local fault code of a well-formed fault."""
    assert answer.status_code == 500, answer.text
    assert answer.headers["Content-Type"].startswith("text/xml")
    root = etree.fromstring(answer.content)
    fault = root.find(f"{SOAP}Body/{SOAP}Fault")
    assert [child.tag for child in fault] == ["faultcode", "faultstring"]
    assert fault.findtext("faultstring")
    assert "Traceback" not in answer.text
    prefix, _, code = fault.findtext("faultcode").partition(":")
    assert fault.nsmap[prefix] == SOAP.strip("{}")
    return code


def twist(x: object = 0.1, z: object = 0.0) -> dict[str, Any]:
    return {"linear": {"x": x, "y": 0.0, "z": 0.0}, "angular": {"x": 0.0, "y": 0.0, "z": z}}


def goal(identity: str | None = "one", x: float = 3.0, frame_id: str = "map", **turn: float) -> dict[str, Any]:
    orientation = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0} | turn
    pose = {"position": {"x": x, "y": 4.0, "z": 0.0}, "orientation": orientation}
    sent: dict[str, Any] = {"goal": {"target_pose": {"header": {"frame_id": frame_id}, "pose": pose}}}
    return sent if identity is None else sent | {"goal_id": {"id": identity}}
