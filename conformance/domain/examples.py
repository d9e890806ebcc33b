"""The contract's examples made fit for one robot: within its limits, near where it is, in its frames."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

from conformance.domain.geometry import Pose, quaternion_of
from conformance.domain.goals import choose_goals
from conformance.domain.robot import Robot

if TYPE_CHECKING:
    from collections.abc import Callable

    from conformance.session import Session
    from conformance.verdict.judge import Judge

# Far enough to be on the way for a while, near enough to be inside every room.
_FAR_M = 1.5
_SLOW_M_S = 0.1
# Where the robot could go when it was first asked: good for plans and deliveries, wherever it is by now.
_PLACES: WeakKeyDictionary[Judge, Pose] = WeakKeyDictionary()


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
    return {part: _slow(session, part, axes) for part, axes in value.items()}


def _linear(session: Session, value: dict[str, Any]) -> dict[str, Any]:
    return _slow(session, "linear", value)


def _slow(session: Session, part: str, axes: dict[str, float]) -> dict[str, float]:
    limits = session.statement.limits
    most = min(_SLOW_M_S, (limits.linear_m_s if part == "linear" else limits.angular_rad_s) / 2)
    actuated = session.statement.motion.actuated
    return {
        axis: max(-most, min(most, float(speed))) if f"{part}.{axis}" in actuated else 0.0
        for axis, speed in axes.items()
    }


def _goal(session: Session, value: dict[str, Any]) -> dict[str, Any]:
    (near,) = choose_goals(Robot(session), _FAR_M, 1)
    pose = {"position": {"x": near.x, "y": near.y, "z": 0.0}, "orientation": quaternion_of(near.yaw)}
    target = {"header": {"frame_id": session.statement.motion.frame}, "pose": pose}
    return {**value, "goal": {"target_pose": target}}


def _plan(session: Session, value: dict[str, Any]) -> dict[str, Any]:
    place = _place(session)
    return {**value, "x": place.x, "y": place.y, "frame_id": session.statement.motion.frame}


def _delivery(session: Session, value: dict[str, Any]) -> dict[str, Any]:
    place = _place(session)
    there = {name: place.x if name.endswith("_x") else place.y for name in value if name != "code"}
    return {**value, **there}


def _place(session: Session) -> Pose:
    if session.judge not in _PLACES:
        (_PLACES[session.judge],) = choose_goals(Robot(session), _FAR_M, 1)
    return _PLACES[session.judge]


_FITTED: dict[str, Callable[[Session, dict[str, Any]], dict[str, Any]]] = {
    "putVelocity": _velocity,
    "putLinearVelocity": _linear,
    "putGoal": _goal,
    "getPlan": _plan,
    "putDelivery": _delivery,
}
