"""The shapes of the ROS messages in the contract, and what is wrong with a value that has another one.

A shape is written as the JSON that it describes: a dict of the fields that have to be there (a robot may add others),
a leaf for a number or a text, Items for a list.
"""

from __future__ import annotations

import json
import math
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from conformance.transport.exchange import Response

_SHOWN: Final = 60


@dataclass(frozen=True)
class Leaf:
    """A value without parts.

    Attributes:
        expected: what it is, in a few words.
        fits: whether a value is one.
    """

    expected: str
    fits: Callable[[Any], bool]


@dataclass(frozen=True)
class Items:
    """A list of values of one shape; ``at_least`` and ``at_most`` bound its length."""

    shape: Shape
    at_least: int = 0
    at_most: int | None = None


Shape = Leaf | Items | dict[str, Any]


def is_number(value: Any) -> bool:
    """Whether a JSON value is a number that a double can hold; an integer counts as a float."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    try:
        return math.isfinite(float(value))
    except OverflowError:
        return False


def _whole(low: int, high: int) -> Leaf:
    def fits(value: Any) -> bool:
        # 3.0 is an integer in JSON Schema 2020-12 as well.
        return is_number(value) and value == int(value) and low <= value <= high

    return Leaf(f"an integer from {low} to {high}", fits)


def _named(pattern: str, expected: str) -> Leaf:
    return Leaf(expected, lambda value: isinstance(value, str) and re.fullmatch(pattern, value) is not None)


NUMBER: Final = Leaf("a finite number", is_number)
TEXT: Final = Leaf("a string", lambda value: isinstance(value, str))
NAME: Final = Leaf("a string that is not empty", lambda value: isinstance(value, str) and value != "")
MESSAGE_TYPE: Final = _named(r"[A-Za-z]\w*/msg/[A-Za-z]\w*", "a type named in full, as sensor_msgs/msg/LaserScan")
SERVICE_TYPE: Final = _named(r"[A-Za-z]\w*/(srv|action)/[A-Za-z]\w*", "a type named in full, as nav_msgs/srv/GetPlan")
TIME: Final[Shape] = {"sec": _whole(-(2**31), 2**31 - 1), "nanosec": _whole(0, 2**32 - 1)}
HEADER: Final[Shape] = {"stamp": TIME, "frame_id": TEXT}
VECTOR3: Final[Shape] = dict.fromkeys("xyz", NUMBER)
QUATERNION: Final[Shape] = dict.fromkeys("xyzw", NUMBER)
TWIST: Final[Shape] = {"linear": VECTOR3, "angular": VECTOR3}
POSE: Final[Shape] = {"position": VECTOR3, "orientation": QUATERNION}
POSE_STAMPED: Final[Shape] = {"header": HEADER, "pose": POSE}
_COVARIANCE: Final = Items(NUMBER, 36, 36)
ODOMETRY: Final[Shape] = {
    "header": HEADER,
    "child_frame_id": TEXT,
    "pose": {"pose": POSE, "covariance": _COVARIANCE},
    "twist": {"twist": TWIST, "covariance": _COVARIANCE},
}
GET_PLAN: Final[Shape] = {"plan": {"header": HEADER, "poses": Items(POSE_STAMPED, 1)}}
GOAL: Final[Shape] = {
    "header": HEADER,
    "goal_id": {"stamp": TIME, "id": NAME},
    "goal": {"target_pose": POSE_STAMPED},
}
STATUS: Final[Shape] = {"code": _whole(1, 6), "text": TEXT}
SENSORS: Final[Shape] = Items({"name": NAME, "topic": NAME, "type": NAME})
SERVICES: Final[Shape] = Items({"name": NAME, "type": NAME})
REQUEST: Final[Shape] = {
    "message_code": _whole(3, 4),
    **dict.fromkeys(("depot_x", "depot_y", "destination_x", "destination_y", "source_x", "source_y"), NUMBER),
}
DELIVERIES: Final[Shape] = Items(
    {
        "request": REQUEST,
        "state": _named("queued|active|done|failed|dropped", "queued, active, done, failed or dropped"),
        "accepted": TIME,
        "interface": _named("rest|soap", "rest or soap"),
    }
)


def fault_in(value: Any, shape: Shape, where: str = "") -> str:
    """What is wrong with a value, by the first offending field; empty where it has the shape."""
    if isinstance(shape, Leaf):
        return "" if shape.fits(value) else f"{where or 'the value'} is {shown(value)}, not {shape.expected}"
    if isinstance(shape, Items):
        return _fault_in_items(value, shape, where)
    if not isinstance(value, dict):
        return f"{where or 'the value'} is {shown(value)}, not an object"
    for name, part in shape.items():
        path = f"{where}.{name}" if where else name
        if name not in value:
            return f"{path} is missing"
        problem = fault_in(value[name], part, path)
        if problem:
            return problem
    return ""


def _fault_in_items(value: Any, shape: Items, where: str) -> str:
    if not isinstance(value, list):
        return f"{where or 'the value'} is {shown(value)}, not a list"
    if len(value) < shape.at_least or (shape.at_most is not None and len(value) > shape.at_most):
        return f"{where or 'the list'} has {len(value)} items"
    for index, item in enumerate(value):
        problem = fault_in(item, shape.shape, f"{where}[{index}]")
        if problem:
            return problem
    return ""


def shown(value: Any) -> str:
    """A value as JSON writes it, cut where it is long."""
    try:
        text = json.dumps(value)
    except (ValueError, RecursionError):
        text = type(value).__name__
    return text if len(text) <= _SHOWN else text[:_SHOWN] + "..."


def _refuse_constant(name: str) -> float:
    raise ValueError(f"{name} is no JSON")


def read_json(response: Response | None) -> tuple[Any, str]:
    """The JSON in an answer's body, and why there is none.

    Returns:
        (value, ""), or (None, what is wrong) where the body is no JSON in UTF-8.
    """
    if response is None:
        return None, "no answer"
    try:
        # A byte order mark is the affair of another requirement (http/json-encoding).
        return json.loads(response.body.decode("utf-8-sig"), parse_constant=_refuse_constant), ""
    except (ValueError, RecursionError) as error:
        return None, f"the body is no JSON: {error}"


def read_as(response: Response | None, shape: Shape, status: int = 200) -> tuple[Any, str]:
    """The value of a shape in an answer with a status.

    Returns:
        (value, ""), or (None, what is wrong with the answer).
    """
    if response is None or response.status != status:
        return None, f"status {response.status}" if response else "no answer"
    value, problem = read_json(response)
    problem = problem or fault_in(value, shape)
    return (None, problem) if problem else (value, "")


def body_of(value: Mapping[str, Any]) -> bytes:
    """A JSON body."""
    return json.dumps(value).encode()


def pruned(value: Any, shape: Shape) -> Any:
    """A value that has a shape, without the further fields that a robot may add."""
    if isinstance(shape, Items):
        return [pruned(item, shape.shape) for item in value]
    if isinstance(shape, dict):
        return {name: pruned(value[name], part) for name, part in shape.items() if name in value}
    return value
