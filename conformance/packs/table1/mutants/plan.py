"""Mutants that return wrong plans."""

from typing import Any

from conformance.mutation.changes import problem, rest
from conformance.mutation.fields import field
from conformance.mutation.table import Table
from conformance.packs.table1.mutants.paths import PLAN
from conformance.packs.table1.mutants.pose import turned

MUTANTS = Table()
_mutant = MUTANTS.of_class("rest-resources", "rest")

_EMPTY = b'{"plan":{"header":{"stamp":{"sec":1,"nanosec":0},"frame_id":"map"},"poses":[]}}'
_GET, _POSES = rest("GET", PLAN), "plan.poses"


def _moved(pose: Any, x: float, y: float) -> Any:
    at = pose["pose"]["position"]
    return {**pose, "pose": {**pose["pose"], "position": {**at, "x": at["x"] + x, "y": at["y"] + y}}}


def _detour(poses: list[Any]) -> list[Any]:
    middle = len(poses) // 2
    return [*poses[:middle], _moved(poses[middle], 25.0, -25.0), *poses[middle:]]


def _aside(value: Any) -> None:
    path = value["plan"]
    if path["header"]["frame_id"] == "odom":
        path["poses"] = [_moved(pose, 1.5, -1.0) for pose in path["poses"]]


def _no_start(given: dict[str, str]) -> None:
    for name in ("start_x", "start_y", "start_yaw"):
        given.pop(name, None)


def _quarter(given: dict[str, str]) -> None:
    given.setdefault("yaw", "1.5707963")


def _frame(value: Any) -> None:
    for pose in value["plan"]["poses"][1:]:
        pose["header"]["frame_id"] = "base_link"


_mutant("plan-heading-ignored", "plan-yaw", "The last pose of a plan has a heading that is 1 rad off.").json(
    _GET, field("plan.poses.-1.pose.orientation", turned(lambda yaw: yaw + 1.0))
)
_mutant("plan-without-stamps", "plan-type", "Poses of a plan have no header.").json(
    _GET, field(_POSES, lambda poses: [{"pose": one["pose"]} for one in poses])
)
_mutant("plan-bare", "plan-type", "The response is the path itself, without the object around it.").json(
    _GET, lambda value: value["plan"]
)
_mutant("plan-from-elsewhere", "plan-start", "A plan begins 60 cm from the robot.").json(
    _GET, field(_POSES, lambda poses: [_moved(poses[0], -0.36, 0.48), *poses])
)
_mutant("plan-falls-short", "plan-end", "A plan ends 50 cm before the requested pose.").json(
    _GET, field(_POSES, lambda poses: [*poses[:-1], _moved(poses[-1], 0.3, 0.4)])
)
_mutant("plan-no-exponents", "plan-numbers", "The robot refuses a query with an exponent such as e+00.").instead(
    lambda request: _GET(request) and "e%2B" in request.query, problem(422, "x: no number")
)
