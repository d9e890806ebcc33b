"""What tests send."""

from typing import Any

ENVELOPE = '<s:Envelope xmlns:s="http://schemas.xmlsoap.org/soap/envelope/">{}<s:Body>{}</s:Body></s:Envelope>'
NAMESPACE = "http://soap.turtlebot.mybot.org/"


def delivery_path(code: object = 4, **coordinates: object) -> str:
    given = {
        "depot_x": 68.269,
        "depot_y": 38.718,
        "dest_x": 60.633,
        "dest_y": 37.51,
        "source_x": 76.02,
        "source_y": 41.35,
    } | coordinates
    return f"/robot/app/delivery/{code}" + "".join(f"/{name}/{value}" for name, value in given.items())


def delivery_envelope(operation: str = "ExecuteDeliveryRequest", header: str = "", **values: object) -> str:
    given = {
        "depot_x": 68.269,
        "depot_y": 38.718,
        "destination_x": 60.633,
        "destination_y": 37.51,
        "message_code": 4,
        "source_x": 76.02,
        "source_y": 41.35,
    } | values
    fields = "".join(f"<{name}>{value}</{name}>" for name, value in given.items())
    body = f'<t:{operation} xmlns:t="{NAMESPACE}"><arg0>{fields}</arg0></t:{operation}>'
    return ENVELOPE.format(header, body)


def query_envelope(operation: str, content: str = "") -> str:
    return ENVELOPE.format("", f'<t:{operation} xmlns:t="{NAMESPACE}">{content}</t:{operation}>')


def twist(x: object = 0.1, z: object = 0.0) -> dict[str, Any]:
    return {"linear": {"x": x, "y": 0.0, "z": 0.0}, "angular": {"x": 0.0, "y": 0.0, "z": z}}


def goal(identity: str | None = "one", x: float = 3.0, frame_id: str = "map", w: float = 1.0) -> dict[str, Any]:
    pose = {"position": {"x": x, "y": 4.0, "z": 0.0}, "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": w}}
    sent: dict[str, Any] = {"goal": {"target_pose": {"header": {"frame_id": frame_id}, "pose": pose}}}
    return sent if identity is None else sent | {"goal_id": {"id": identity}}
