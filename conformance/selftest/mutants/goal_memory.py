"""What goals look like to a proxy, and robots that remember the wrong thing of them."""

from __future__ import annotations

import json
import math
import threading
from typing import TYPE_CHECKING, Any

from conformance.selftest.mutants.changes import GOAL, parsed, plain, problem, rest, success
from conformance.selftest.wire import Answer

if TYPE_CHECKING:
    from collections.abc import Callable

    from conformance.selftest.wire import Ask

    Forward = Callable[[Ask], Answer]

_GET, _PUT, _DELETE = rest("GET", GOAL), rest("PUT", GOAL), rest("DELETE", GOAL)


def position(goal: Any) -> Any:
    """The position in a MoveBaseActionGoal."""
    return goal["goal"]["target_pose"]["pose"]["position"]


def identity(ask: Ask) -> str | None:
    """The id in a PUT goal."""
    value = parsed(ask.body)
    try:
        return str(value["goal_id"]["id"])
    except (TypeError, KeyError):
        return None


def active(forward: Forward, ask: Ask) -> Any:
    """The robot's goal, or None."""
    answer = forward(
        ask.copy(method="GET", target=GOAL, body=b"", fields=[("Host", "robot"), ("Accept", "application/json")])
    )
    return parsed(answer.body) if answer.status == 200 else None


def pose_of(goal: Any) -> Any:
    """The pose in a MoveBaseActionGoal, in floats; None where there is none."""
    try:
        pose = goal["goal"]["target_pose"]["pose"]
        return {part: {axis: float(pose[part][axis]) for axis in pose[part]} for part in ("position", "orientation")}
    except (TypeError, KeyError, ValueError):
        return None


class Lingering:
    """GET goes on showing a goal that has ended by itself."""

    def __init__(self) -> None:
        self._last: Answer | None = None

    def __call__(self, ask: Ask, forward: Forward) -> Answer:
        """See proxy.Change."""
        answer = forward(ask)
        if _DELETE(ask):
            self._last = None
        if _GET(ask):
            if answer.status == 200:
                self._last = answer.copy()
            elif self._last is not None and answer.status == 404:
                return self._last.copy()
        return answer


class Previous:
    """GET shows the goal before the active one."""

    def __init__(self) -> None:
        self._seen: list[Any] = []

    def __call__(self, ask: Ask, forward: Forward) -> Answer:
        """See proxy.Change."""
        answer = forward(ask)
        value = parsed(answer.body)
        if _GET(ask) and answer.status == 200 and isinstance(value, dict):
            if not self._seen or self._seen[-1]["goal_id"] != value["goal_id"]:
                self._seen.append(value)
            if len(self._seen) > 1:
                answer.body = json.dumps(self._seen[-2]).encode()
        return answer


class OnlyOnce:
    """An id that was used before is refused for ever."""

    def __init__(self) -> None:
        self._used: set[str] = set()

    def __call__(self, ask: Ask, forward: Forward) -> Answer:
        """See proxy.Change."""
        id_ = identity(ask) if _PUT(ask) else None
        if id_ is not None and id_ in self._used and active(forward, ask) is None:
            return problem(409, f"goal_id.id: {id_!r} was used before")(ask)
        answer = forward(ask)
        if id_ is not None and success(answer):
            self._used.add(id_)
        return answer


class Abandoned:
    """The robot gives a goal up on its way."""

    def __call__(self, ask: Ask, forward: Forward) -> Answer:
        """See proxy.Change."""
        answer = forward(ask)
        if _PUT(ask) and answer.status in {201, 202}:
            later = ask.copy(method="DELETE", body=b"", fields=[("Host", "robot"), ("Connection", "close")])
            threading.Timer(0.4, _quietly, (forward, later)).start()
        return answer


def _quietly(forward: Forward, ask: Ask) -> None:
    try:
        forward(ask)
    except Exception:  # noqa: BLE001 - the run may be over
        return


class Unreachable:
    """A goal far away is accepted, and is active for ever."""

    def __init__(self) -> None:
        self._goal: Any = None

    def __call__(self, ask: Ask, forward: Forward) -> Answer:
        """See proxy.Change."""
        if ask.path != GOAL or ask.side != "rest":
            return forward(ask)
        if _PUT(ask):
            value = parsed(ask.body)
            pose = pose_of(value)
            far = pose is not None and max(abs(pose["position"][axis]) for axis in "xy") > 90
            self._goal = None
            if far and math.isfinite(sum(pose["position"].values())):
                header = {"stamp": {"sec": 1, "nanosec": 0}, "frame_id": "map"}
                status_ = {"code": 2, "text": "on my way"}
                self._goal = {
                    "header": header,
                    "goal_id": {"stamp": header["stamp"], "id": identity(ask) or "far"},
                    "goal": value["goal"],
                    "status": status_,
                }
                value["goal"]["target_pose"]["header"].setdefault("stamp", header["stamp"])
                return _said(202, self._goal, ask)
        if _DELETE(ask) and self._goal is not None:
            self._goal = None
            return plain(204)(ask)
        if _GET(ask) and self._goal is not None:
            return _said(200, self._goal, ask)
        return forward(ask)


def _said(status_: int, value: Any, ask: Ask) -> Answer:
    return Answer(
        status_,
        [("Content-Type", "application/json"), ("Vary", "Accept")],
        json.dumps(value).encode(),
        asked=ask.method,
    )
