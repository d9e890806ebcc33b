"""Messages and exchanges of no real robot, for tests of what is judged by them."""

from typing import Any, Final

from conformance.transport.exchange import Exchange, Request, Response

ZERO: Final = dict.fromkeys("xyz", 0.0)
STILL: Final = {"linear": ZERO, "angular": ZERO}


def exchange(status: int = 200, body: bytes = b"", method: str = "GET") -> Exchange:
    return Exchange(Request(method, "http://robot/"), Response(status, (), body, 1.0))


def header(frame_id: str = "map", at_s: float = 1.0) -> dict[str, Any]:
    return {"stamp": {"sec": int(at_s), "nanosec": int(at_s % 1 * 1e9)}, "frame_id": frame_id}


def pose(x: float = 0.0, **orientation: float) -> dict[str, Any]:
    return {"position": ZERO | {"x": x}, "orientation": ZERO | {"w": 1.0} | orientation}


def odometry(at_s: float = 1.0, twist: Any = STILL, x: float = 0.0, **orientation: float) -> dict[str, Any]:
    return {
        "header": header("odom", at_s), "child_frame_id": "base_link",
        "pose": {"pose": pose(x, **orientation), "covariance": [0.0] * 36},
        "twist": {"twist": twist, "covariance": [0.0] * 36},
    }  # fmt: skip


def goal(id_: str, at_s: float = 1.0, x: float = 0.0, shown_s: float | None = None) -> dict[str, Any]:
    """Return an active goal that was put at a time, and is shown with a header of this time or of another."""
    return {
        "header": header(at_s=at_s if shown_s is None else shown_s),
        "goal_id": {"stamp": header(at_s=at_s)["stamp"], "id": id_},
        "goal": {"target_pose": {"header": header(), "pose": pose(x)}},
        "status": {"code": 2, "text": ""},
    }
