"""Bodies that handle goals, plans or deliveries wrongly."""

import math
import struct
import threading
import time
from typing import Any

from proof.table1.independent_robots.body import TICK_S, Body, Goal, yaw_of

_SOON_S = 0.002
_AGAIN_S = 1.0
_MANY = 8


class _SameIdOtherPose(Body):
    """Takes another pose under the active goal's id for the same goal."""

    def send(self, id_: str | None, target: dict[str, Any], frame: str) -> tuple[Goal, bool]:
        """Accept another pose under the active goal's id as the same goal."""
        with self._lock:
            self._advance()
            if self.goal is not None and id_ == self.goal.id:
                return self.goal, False
            return super().send(id_, target, frame)


class _IdInLowerCase(Body):
    """Writes ids in lower case."""

    def send(self, id_: str | None, target: dict[str, Any], frame: str) -> tuple[Goal, bool]:
        """Accept a goal, and convert its id to lower case."""
        return super().send(id_.lower() if id_ else id_, target, frame)


class _IdUsedUp(Body):
    """Takes a goal whose id has ended before for a repetition."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self._used: set[str] = set()

    def send(self, id_: str | None, target: dict[str, Any], frame: str) -> tuple[Goal, bool]:
        """Accept a goal; one whose id was used before does not count as new."""
        goal, new = super().send(id_, target, frame)
        new = new and goal.id not in self._used
        self._used.add(goal.id)
        return goal, new


class _OdometryTakenForMap(Body):
    """A body that drives to a pose in the odometry's frame as if the pose were in the map's frame."""

    def send(self, id_: str | None, target: dict[str, Any], frame: str) -> tuple[Goal, bool]:
        """Accept a goal, and ignore its frame."""
        goal, new = super().send(id_, target, frame)
        goal.x, goal.y = target["position"]["x"], target["position"]["y"]
        goal.yaw = yaw_of(target["orientation"])
        return goal, new


class _Coasts(Body):
    """Drives on for a while after its goal was cancelled."""

    def cancel(self) -> bool:
        """Cancel the goal, and keep driving for a while."""
        had = super().cancel()
        if had:
            self._command, self._until = (0.1, 0.0), self._tick + round(2.5 / TICK_S)
        return had


class _Resumes(Body):
    """A body that resumes the replaced goal when the goal in its place is cancelled."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self._displaced: Goal | None = None

    def send(self, id_: str | None, target: dict[str, Any], frame: str) -> tuple[Goal, bool]:
        """Accept a goal, and remember the goal that it replaces."""
        if self.goal is not None and self.goal.id != id_:
            self._displaced = self.goal
        return super().send(id_, target, frame)

    def cancel(self) -> bool:
        """Cancel the goal, and resume the replaced goal."""
        had = super().cancel()
        self.goal, self._displaced = self._displaced, None
        return had


class _ResumesOnArrival(_Resumes):
    """A body that resumes the replaced goal when the goal in its place is reached."""

    def cancel(self) -> bool:
        """Cancel the goal, and forget the replaced goal."""
        self._displaced = None
        return super().cancel()

    def _aim(self) -> tuple[float, float]:
        driven = self.goal is not None
        aim = super()._aim()
        if driven and self.goal is None:
            self.goal, self._displaced = self._displaced, None
        return aim


class _HeadingIgnored(Body):
    """A body that ends a goal at its position, whatever its heading."""

    def send(self, id_: str | None, target: dict[str, Any], frame: str) -> tuple[Goal, bool]:
        """Accept a goal, and take the way's direction for its heading."""
        goal, new = super().send(id_, target, frame)
        goal.yaw = math.atan2(goal.y - self._state.y, goal.x - self._state.x)
        return goal, new


class _VelocityAfterGoal(Body):
    """A body that resumes the velocity from before a goal when the goal is reached."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self._before = (0.0, 0.0)

    def drive(self, v: float, w: float | None) -> float:
        """Command a velocity, and remember the command."""
        kept = super().drive(v, w)
        self._before = (v, kept)
        return kept

    def _aim(self) -> tuple[float, float]:
        driven = self.goal is not None
        aim = super()._aim()
        if driven and self.goal is None:
            self._command, self._until = self._before, self._tick + round(1 / TICK_S)
        return aim


class _VelocityForgotten(Body):
    """Takes a velocity while a goal is active, and drives on to the goal."""

    def drive(self, v: float, w: float | None) -> float:
        """Command a velocity, unless a goal is active."""
        return (w or 0.0) if self.goal is not None else super().drive(v, w)


class _StartForgotten(Body):
    """A body whose plans always begin at the robot, whatever start the request has."""

    def path(self, start: tuple[float, float, float] | None, x: float, y: float, yaw: float) -> list[dict[str, Any]]:
        """Return a path that begins at the robot."""
        return super().path(start and None, x, y, yaw)


class _GapInPlan(Body):
    """Leaves out the middle of a long plan."""

    def path(self, start: tuple[float, float, float] | None, x: float, y: float, yaw: float) -> list[dict[str, Any]]:
        """Return a path with a gap."""
        poses = super().path(start, x, y, yaw)
        return poses[: len(poses) // 3] + poses[2 * len(poses) // 3 :] if len(poses) > _MANY else poses


class _DeliveryLost(Body):
    """A body that loses a delivery that follows another one closely."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self._last = 0.0

    def deliver(self, interface: str, **request: float) -> None:
        """Store a delivery, unless another arrived a moment before."""
        lost, self._last = time.time() - self._last < _SOON_S, time.time()
        if not lost:
            super().deliver(interface, **request)


class _DeliveryTwice(Body):
    """A body that stores every tenth delivery a second time, later."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self._delivered = 0

    def deliver(self, interface: str, **request: float) -> None:
        """Store a delivery, and every tenth one once more later."""
        super().deliver(interface, **request)
        self._delivered += 1
        if self._delivered % 10 == 0:
            again = threading.Timer(_AGAIN_S, super().deliver, (interface,), request)
            again.daemon = True
            again.start()


class _DeliverySinglePrecision(Body):
    """A body that stores the coordinates of deliveries in single precision."""

    def deliver(self, interface: str, **request: float) -> None:
        """Store a delivery in single precision."""
        super().deliver(interface, **{name: _single(value) for name, value in request.items()})


def _single(value: float) -> float:
    if not isinstance(value, float):
        return value
    try:
        (single,) = struct.unpack(">f", struct.pack(">f", value))
    except OverflowError:
        return value
    return float(single)


class _CoffeeForCourier(Body):
    """A body that stores deliveries that came over SOAP with another message code."""

    def deliver(self, interface: str, **request: float) -> None:
        """Store a delivery, with another code if it came over SOAP."""
        code = 3 if interface == "soap" and request["message_code"] == 4 else request["message_code"]  # noqa: PLR2004
        super().deliver(interface, **(request | {"message_code": code}))


MISSIONS: dict[str, type[Body]] = {
    "goal-same-id-other-pose": _SameIdOtherPose,
    "goal-id-in-lower-case": _IdInLowerCase,
    "goal-id-used-up": _IdUsedUp,
    "goal-odometry-taken-for-map": _OdometryTakenForMap,
    "goal-coasts": _Coasts,
    "goal-resumed": _Resumes,
    "goal-resumed-on-arrival": _ResumesOnArrival,
    "goal-heading-ignored": _HeadingIgnored,
    "velocity-after-goal": _VelocityAfterGoal,
    "velocity-forgotten-for-goal": _VelocityForgotten,
    "plan-start-forgotten": _StartForgotten,
    "plan-gap": _GapInPlan,
    "delivery-lost": _DeliveryLost,
    "delivery-twice": _DeliveryTwice,
    "delivery-single-precision": _DeliverySinglePrecision,
    "delivery-code-swapped": _CoffeeForCourier,
}
