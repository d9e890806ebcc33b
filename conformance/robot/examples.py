"""The contract's examples made fit for one robot: within its limits, near where it is, in its frames."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

from conformance.robot.geometry import Pose, quaternion_of
from conformance.robot.plan import reachable
from conformance.robot.robot import Robot

if TYPE_CHECKING:
    from collections.abc import Callable

    from conformance.engine.session import Session
    from conformance.verdict.evidence import Judge

# Far enough to be on the way for a while, near enough to be inside every room; nearer where there is no room.
_FAR_M = (1.5, 0.5)
_SLOW_M_S = 0.1
# Where the robot could go when it was first asked: good for plans and deliveries, wherever it is by now.
_PLACES: WeakKeyDictionary[Judge, Pose] = WeakKeyDictionary()
_TURNS: WeakKeyDictionary[Judge, int] = WeakKeyDictionary()


def fit(session: Session, operation_id: str, value: Any) -> Any:
    """A valid value of an operation with what makes sense to this robot.

    Args:
        session: the run.
        operation_id: of the contract.
        value: its body, or its parameters by name.
    """
    fitted = _FITTED.get(operation_id)
    if session.rest is None or fitted is None or not isinstance(value, dict):
        return value
    return fitted(session, value)


def _velocity(session: Session, value: dict[str, Any]) -> dict[str, Any]:
    sign = _direction(session)
    return {part: _slow(session, part, axes, sign) for part, axes in value.items()}


def _linear(session: Session, value: dict[str, Any]) -> dict[str, Any]:
    return _slow(session, "linear", value, _direction(session))


def _slow(session: Session, part: str, axes: dict[str, float], sign: int) -> dict[str, float]:
    limits = session.statement.limits
    most = min(_SLOW_M_S, (limits.linear_m_s if part == "linear" else limits.angular_rad_s) / 2)
    actuated = session.statement.motion.actuated
    return {
        axis: sign * max(-most, min(most, float(speed))) if f"{part}.{axis}" in actuated and speed else 0.0
        for axis, speed in axes.items()
    }


def _direction(session: Session) -> int:
    """Ahead and back by turns, so that a robot does not creep up to a wall over many runs."""
    turn = _TURNS.get(session.judge, 0)
    _TURNS[session.judge] = turn + 1
    return 1 if turn % 2 == 0 else -1


def _goal(session: Session, value: dict[str, Any]) -> dict[str, Any]:
    near = _near(session)
    if near is None:
        return value
    pose = {"position": {"x": near.x, "y": near.y, "z": 0.0}, "orientation": quaternion_of(near.yaw)}
    target = {"header": {"frame_id": session.statement.motion.frame}, "pose": pose}
    return {**value, "goal": {"target_pose": target}}


def _near(session: Session) -> Pose | None:
    """A pose near the robot that it can reach; None where it knows no way to any."""
    robot = Robot(session)
    here = robot.map_pose()
    for distance in _FAR_M if here is not None else ():
        reach = distance if robot.statement.motion.arena else min(distance, robot.statement.motion.radius_m)
        found = reachable(robot, here, reach, 1) if here is not None else []
        if found:
            return found[0]
    return None


def _plan(session: Session, value: dict[str, Any]) -> dict[str, Any]:
    place = _place(session)
    return value if place is None else {**value, "x": place.x, "y": place.y, "frame_id": session.statement.motion.frame}


def _delivery(session: Session, value: dict[str, Any]) -> dict[str, Any]:
    place = _place(session)
    if place is None:
        return value
    return {**value, **{name: place.x if name.endswith("_x") else place.y for name in value if name != "code"}}


def _place(session: Session) -> Pose | None:
    if session.judge not in _PLACES:
        near = _near(session)
        if near is None:
            return None
        _PLACES[session.judge] = near
    return _PLACES[session.judge]


_FITTED: dict[str, Callable[[Session, dict[str, Any]], dict[str, Any]]] = {
    "putVelocity": _velocity,
    "putLinearVelocity": _linear,
    "putGoal": _goal,
    "getPlan": _plan,
    "putDelivery": _delivery,
}
