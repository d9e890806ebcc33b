"""Bodies that do otherwise than they were asked to with goals, plans and deliveries."""

import struct
import threading
import time
from typing import Any

from conformance.packs.table1.independent_robots.body import TICK_S, Body, Goal, yaw_of

_SOON_S = 0.002
_AGAIN_S = 1.0
_MANY = 8


class _SameIdOtherPose(Body):
    """Takes another pose under the active goal's id for the same goal."""

    def send(self, id_: str | None, target: dict[str, Any], frame: str) -> tuple[Goal, bool]:
        """See Body."""
        with self._lock:
            self._advance()
            if self.goal is not None and id_ == self.goal.id:
                return self.goal, False
            return super().send(id_, target, frame)


class _IdInLowerCase(Body):
    """Writes ids in lower case."""

    def send(self, id_: str | None, target: dict[str, Any], frame: str) -> tuple[Goal, bool]:
        """See Body."""
        return super().send(id_.lower() if id_ else id_, target, frame)


class _IdUsedUp(Body):
    """Takes a goal whose id has ended before for a repetition."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self._used: set[str] = set()

    def send(self, id_: str | None, target: dict[str, Any], frame: str) -> tuple[Goal, bool]:
        """See Body."""
        goal, new = super().send(id_, target, frame)
        new = new and goal.id not in self._used
        self._used.add(goal.id)
        return goal, new


class _OdometryTakenForMap(Body):
    """Drives to a pose in the odometry's frame as if it were the map's."""

    def send(self, id_: str | None, target: dict[str, Any], frame: str) -> tuple[Goal, bool]:
        """See Body."""
        goal, new = super().send(id_, target, frame)
        goal.x, goal.y = target["position"]["x"], target["position"]["y"]
        goal.yaw = yaw_of(target["orientation"])
        return goal, new


class _Coasts(Body):
    """Drives on for a while after its goal was cancelled."""

    def cancel(self) -> bool:
        """See Body."""
        had = super().cancel()
        if had:
            self._command, self._until = (0.1, 0.0), self._tick + round(2.5 / TICK_S)
        return had


class _Resumes(Body):
    """Takes up the goal that was displaced when the one in its place is cancelled."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self._displaced: Goal | None = None

    def send(self, id_: str | None, target: dict[str, Any], frame: str) -> tuple[Goal, bool]:
        """See Body."""
        if self.goal is not None and self.goal.id != id_:
            self._displaced = self.goal
        return super().send(id_, target, frame)

    def cancel(self) -> bool:
        """See Body."""
        had = super().cancel()
        self.goal, self._displaced = self._displaced, None
        return had


class _ResumesOnArrival(_Resumes):
    """Takes it up when the one in its place is reached."""

    def cancel(self) -> bool:
        """See Body."""
        self._displaced = None
        return super().cancel()

    def _aim(self) -> tuple[float, float]:
        driven = self.goal is not None
        aim = super()._aim()
        if driven and self.goal is None:
            self.goal, self._displaced = self._displaced, None
        return aim


class _VelocityAfterGoal(Body):
    """Takes the velocity from before a goal up again when it has arrived."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self._before = (0.0, 0.0)

    def drive(self, v: float, w: float | None) -> float:
        """See Body."""
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
        """See Body."""
        return (w or 0.0) if self.goal is not None else super().drive(v, w)


class _StartForgotten(Body):
    """Plans from where it is, wherever it was asked to."""

    def path(self, start: tuple[float, float, float] | None, x: float, y: float, yaw: float) -> list[dict[str, Any]]:
        """See Body."""
        return super().path(start and None, x, y, yaw)


class _GapInPlan(Body):
    """Leaves out the middle of a long plan."""

    def path(self, start: tuple[float, float, float] | None, x: float, y: float, yaw: float) -> list[dict[str, Any]]:
        """See Body."""
        poses = super().path(start, x, y, yaw)
        return poses[: len(poses) // 3] + poses[2 * len(poses) // 3 :] if len(poses) > _MANY else poses


class _DeliveryLost(Body):
    """Loses a delivery that comes close upon another one."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self._last = 0.0

    def deliver(self, interface: str, **request: float) -> None:
        """See Body."""
        lost, self._last = time.time() - self._last < _SOON_S, time.time()
        if not lost:
            super().deliver(interface, **request)


class _DeliveryTwice(Body):
    """Delivers one in ten once more, later."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self._delivered = 0

    def deliver(self, interface: str, **request: float) -> None:
        """See Body."""
        super().deliver(interface, **request)
        self._delivered += 1
        if self._delivered % 10 == 0:
            again = threading.Timer(_AGAIN_S, super().deliver, (interface,), request)
            again.daemon = True
            again.start()


class _DeliverySinglePrecision(Body):
    """Keeps four octets of a number."""

    def deliver(self, interface: str, **request: float) -> None:
        """See Body."""
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
    """Takes the code of a delivery that came over SOAP for another one."""

    def deliver(self, interface: str, **request: float) -> None:
        """See Body."""
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
    "velocity-after-goal": _VelocityAfterGoal,
    "velocity-forgotten-for-goal": _VelocityForgotten,
    "plan-start-forgotten": _StartForgotten,
    "plan-gap": _GapInPlan,
    "delivery-lost": _DeliveryLost,
    "delivery-twice": _DeliveryTwice,
    "delivery-single-precision": _DeliverySinglePrecision,
    "delivery-code-swapped": _CoffeeForCourier,
}
