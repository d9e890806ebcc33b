"""Adapt the contract's example values to one robot: its limits, its position and its frames."""

from collections.abc import Callable
from typing import Any

from conformance.api.rest.interface import RestInterface
from conformance.packs.table1.robot.geometry import Pose, quaternion_of
from conformance.packs.table1.robot.plan import ask, reachable
from conformance.packs.table1.robot.robot import Robot, Velocity, drivable
from conformance.packs.table1.statement import Statement

# Far enough to be under way for a while, near enough for every room; the second where room is short.
_FAR_M = (1.5, 0.5)
_SLOW_M_S = 0.1
# Offset that gives coordinates many digits, m: whole numbers would not show that a robot rounds.
_ASIDE_M = 0.0137


class Examples:
    """Returns values within one robot's limits, near its position and in its frames."""

    def __init__(self, statement: Statement) -> None:
        self._statement = statement
        # The first place that the robot could reach, for plans and deliveries from anywhere.
        self._first_place: Pose | None = None
        self._turns = 0
        self._fitted: dict[str, Callable[[RestInterface, dict[str, Any]], dict[str, Any]]] = {
            "putVelocity": self._velocity,
            "putLinearVelocity": self._linear,
            "putGoal": self._goal,
            "getPlan": self._plan,
            "putDelivery": self._delivery,
        }

    def fit(self, api: RestInterface, operation_id: str, value: Any) -> Any:
        """Return an example value adapted to the robot.

        For goals, plans and deliveries this requests up to 24 plans from the robot.
        """
        fitted = self._fitted.get(operation_id)
        return value if fitted is None or not isinstance(value, dict) else fitted(api, value)

    def _velocity(self, _: RestInterface, value: dict[str, Any]) -> dict[str, Any]:
        sign = self._direction()
        slow = {part: self._slow(part, axes, sign) for part, axes in value.items()}
        return Velocity(*drivable(self._statement.limits, self._statement.motion, Velocity.of(slow))).twist

    def _linear(self, _: RestInterface, value: dict[str, Any]) -> dict[str, Any]:
        slow = {"linear": self._slow("linear", value, self._direction()), "angular": dict.fromkeys("xyz", 0.0)}
        return Velocity(*drivable(self._statement.limits, self._statement.motion, Velocity.of(slow))).linear

    def _slow(self, part: str, axes: dict[str, float], sign: int) -> dict[str, float]:
        limits = self._statement.limits
        # Half of the lower limit of the two directions, if there are two.
        ranges = [limits.range_of(index) for index in ((0, 1, 2) if part == "linear" else (3, 4, 5))]
        most = min(_SLOW_M_S, *(min(filter(None, map(abs, each)), default=0.0) / 2 for each in ranges))
        actuated = self._statement.motion.actuated
        return {
            axis: sign * max(-most, min(most, float(speed))) if f"{part}.{axis}" in actuated and speed else 0.0
            for axis, speed in axes.items()
        }

    def _direction(self) -> int:
        """Return 1 and -1 in turn, so that the robot does not drift towards a wall over many runs."""
        self._turns += 1
        return 1 if self._turns % 2 else -1

    def _goal(self, api: RestInterface, value: dict[str, Any]) -> dict[str, Any]:
        near = self._near(api)
        if near is None:
            return value
        pose = {"position": {"x": near.x, "y": near.y, "z": 0.0}, "orientation": quaternion_of(near.yaw)}
        target = {"header": {"frame_id": self._statement.motion.frame}, "pose": pose}
        return {**value, "goal": {"target_pose": target}}

    def _near(self, api: RestInterface) -> Pose | None:
        """Return a pose near the robot to which it has a plan, or None."""
        robot = Robot(api)
        here = robot.map_pose()
        for distance in _FAR_M if here is not None else ():
            reach = distance if robot.statement.motion.arena else min(distance, robot.statement.motion.radius_m)
            found = reachable(robot, here, reach, 1) if here is not None else []
            if found:
                return found[0]
        return None

    def _plan(self, api: RestInterface, value: dict[str, Any]) -> dict[str, Any]:
        place = self._place(api)
        if place is None:
            return value
        return {**value, "x": place.x, "y": place.y, "frame_id": self._statement.motion.frame}

    def _delivery(self, api: RestInterface, value: dict[str, Any]) -> dict[str, Any]:
        place = self._place(api)
        if place is None:
            return value
        return {**value, **{name: place.x if name.endswith("_x") else place.y for name in value if name != "code"}}

    def _place(self, api: RestInterface) -> Pose | None:
        near = self._first_place or self._near(api)
        if self._first_place is None and near is not None:
            robot, aside = Robot(api), near.ahead(_ASIDE_M, 1.0)
            if robot.in_arena(aside) and ask(robot, aside)[1] is not None:
                near = Pose(aside.x, aside.y, near.yaw)
        self._first_place = near
        return near
