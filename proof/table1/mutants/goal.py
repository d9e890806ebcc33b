"""Mutants that mishandle a navigation goal."""

import math
from collections.abc import Callable
from typing import Any

from proof.mutation.changes import Make, altered, guarded, inputs, parsed, problem, rest, status, success, values
from proof.mutation.fields import field
from proof.mutation.messages import Forward, Request, Response
from proof.mutation.table import Table
from proof.table1.mutants.goal_memory import active, identity, pose_of
from proof.table1.mutants.paths import GOAL

MUTANTS = Table()
_mutant = MUTANTS.of_class("rest-resources", "rest")

_AT, _GET, _PUT, _DELETE = rest("", GOAL), rest("GET", GOAL), rest("PUT", GOAL), rest("DELETE", GOAL)
_X, _Y, _FRAME = (f"goal.target_pose.{place}" for place in ("pose.position.x", "pose.position.y", "header.frame_id"))


def _without_id(request: Request) -> bool:
    return _PUT(request) and "goal" in (parsed(request.body) or {}) and identity(request) is None


def _rename(edit: Callable[[str], str]) -> Make:
    return altered(_AT, values(field("goal_id.id", edit)))


def _when_active(
    answer_: Callable[[Request], Response], *, same: bool, other_pose: bool | None = None
) -> Callable[[], Any]:
    """Return a change that answers PUT itself while a goal with the same or another id and pose is active."""

    def change(request: Request, forward: Forward) -> Response:
        if _PUT(request):
            now, given = active(forward, request), identity(request)
            if now is not None and (now["goal_id"]["id"] == given) is same:
                moved = pose_of(now) != pose_of(parsed(request.body))
                if other_pose is None or moved is other_pose:
                    return answer_(request)
        return forward(request)

    return lambda: change


def _unit(goal: Any) -> None:
    q = goal["goal"]["target_pose"]["pose"]["orientation"]
    length = math.sqrt(sum(q[axis] ** 2 for axis in "xyzw"))
    if length:
        q.update({axis: q[axis] / length for axis in "xyzw"})
    else:
        q.update(x=0.0, y=0.0, z=0.0, w=1.0)


def _guard(edit: Callable[[Any], None]) -> Callable[[Any], None]:
    """Return an edit that leaves invalid goals unchanged, so that the robot refuses them."""

    def apply(goal: Any) -> None:
        if pose_of(goal) is not None:
            guarded(edit)(goal)

    return apply


def _off_by(least: float, most: float) -> Callable[[Request], bool]:
    """Return a condition for goals whose quaternion's length differs from 1 by ``least`` to ``most``."""

    def where(request: Request) -> bool:
        try:
            q = parsed(request.body)["goal"]["target_pose"]["pose"]["orientation"]
            return _PUT(request) and least <= abs(math.hypot(*(q[axis] for axis in "xyzw")) - 1) <= most
        except (TypeError, KeyError, OverflowError):
            return False

    return where


@_mutant("goal-delete-none-conflict", "goal-delete-none-success", "DELETE without a goal returns 409.")
def _delete_conflict(request: Request, forward: Forward) -> Response:
    if _DELETE(request) and active(forward, request) is None:
        return problem(409, "there is no goal")(request)
    return forward(request)


def _driven_to(sent: Callable[[Any], Any], shown: Callable[[Any], Any]) -> Make:
    """Return a change that drives to another goal: ``sent`` edits a PUT, and ``shown`` undoes that in responses."""

    def change(request: Request, forward: Forward) -> Response:
        if not _AT(request):
            return forward(request)
        if _PUT(request):
            request = request.copy()
            inputs(_guard(sent))(request)
        response = forward(request)
        if success(response):
            values(_guard(shown))(response)
        return response

    return lambda: change


def _turn(by: float) -> Callable[[Any], None]:
    """Return an edit that turns a goal's pose by an angle, rad."""

    def edit(goal: Any) -> None:
        q = goal["goal"]["target_pose"]["pose"]["orientation"]
        cos, sin = math.cos(by / 2), math.sin(by / 2)
        x, y, z, w = (q[axis] for axis in "xyzw")
        q.update(x=cos * x - sin * y, y=cos * y + sin * x, z=cos * z + sin * w, w=cos * w - sin * z)

    return edit


_mutant("goal-outcome-always-success", "goal-outcome", "A cancelled goal is reported as succeeded.").json(
    _GET, lambda told: told.get("last_goal", {"status": {}})["status"].update(code=4), status(404)
)
_mutant("goal-put-rounded", "goal-put", "The response to a goal's PUT rounds its position to 0.1 m.").json(
    _PUT, _guard(field(_X, lambda x: round(x, 1)))
)
_mutant("goal-empty-id", "goal-fills-in", "A goal that is sent without goal_id gets an empty one.").made(
    _rename(lambda id_: "" if len(id_) >= 32 else id_)
)
_mutant("goal-id-cut", "goal-id", "Goal ids are truncated to 32 characters.").made(_rename(lambda id_: id_[:32]))
_mutant("goal-id-ascii", "goal-id", "Goal ids are returned in lower case.").made(
    _rename(lambda id_: id_.lower().encode("ascii", "replace").decode())
)
