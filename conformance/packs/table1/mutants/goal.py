"""Robots that mistreat a goal."""

import math
from collections.abc import Callable
from typing import Any

from conformance.mutation.changes import (
    JSON,
    Make,
    altered,
    becomes,
    guarded,
    inputs,
    instead,
    page,
    parsed,
    plain,
    problem,
    rest,
    rewritten,
    status,
    success,
    unwanted,
    values,
)
from conformance.mutation.messages import Forward, Request, Response
from conformance.mutation.mutant import of_class
from conformance.packs.table1.mutants.goal_memory import (
    Abandoned,
    Lingering,
    OnlyOnce,
    Previous,
    Resumed,
    Unreachable,
    active,
    identity,
    pose_of,
    position,
)
from conformance.packs.table1.mutants.paths import GOAL

_AT, _GET, _PUT, _DELETE = rest("", GOAL), rest("GET", GOAL), rest("PUT", GOAL), rest("DELETE", GOAL)


def _told(edit: Callable[[Any], Any]) -> Make:
    """The goal is altered on its way to the client."""
    return altered(_GET, values(edit))


def _swap(goal: Any) -> None:
    at = position(goal)
    at["x"], at["y"] = at["y"], at["x"]


def _shift(by: float) -> Callable[[Any], None]:
    def edit(goal: Any) -> None:
        position(goal)["x"] += by

    return edit


def _without_id(request: Request) -> bool:
    return _PUT(request) and "goal" in (parsed(request.body) or {}) and identity(request) is None


def _renamed(edit: Callable[[str], str]) -> Make:
    return altered(_AT, values(lambda goal: goal["goal_id"].update(id=edit(goal["goal_id"]["id"]))))


def _when_active(
    answer_: Callable[[Request], Response], *, same: bool, other_pose: bool | None = None
) -> Callable[[], Any]:
    """PUT during a goal, with the same id or another one, is answered otherwise."""

    def change(request: Request, forward: Forward) -> Response:
        if _PUT(request):
            now, given = active(forward, request), identity(request)
            if now is not None and (now["goal_id"]["id"] == given) is same:
                moved = pose_of(now) != pose_of(parsed(request.body))
                if other_pose is None or moved is other_pose:
                    return answer_(request)
        return forward(request)

    return lambda: change


def _known_frame(goal: Any) -> None:
    goal["goal"]["target_pose"]["header"]["frame_id"] = "map"


def _unit(goal: Any) -> None:
    q = goal["goal"]["target_pose"]["pose"]["orientation"]
    length = math.sqrt(sum(q[axis] ** 2 for axis in "xyzw"))
    if length:
        q.update({axis: q[axis] / length for axis in "xyzw"})
    else:
        q.update(x=0.0, y=0.0, z=0.0, w=1.0)


def _guarded(edit: Callable[[Any], None]) -> Callable[[Any], None]:
    """Leaves inputs of another shape as they are, to be refused."""

    def apply(goal: Any) -> None:
        if pose_of(goal) is not None:
            guarded(edit)(goal)

    return apply


def _off_by(least: float, most: float) -> Callable[[Request], bool]:
    """PUTs of a goal whose quaternion's length is off by so much."""

    def where(request: Request) -> bool:
        try:
            q = parsed(request.body)["goal"]["target_pose"]["pose"]["orientation"]
            return _PUT(request) and least <= abs(math.hypot(*(q[axis] for axis in "xyzw")) - 1) <= most
        except (TypeError, KeyError, OverflowError):
            return False

    return where


_mutant = of_class("rest-resources", "rest")


def _delete_conflict(request: Request, forward: Forward) -> Response:
    if _DELETE(request) and active(forward, request) is None:
        return problem(409, "there is no goal")(request)
    return forward(request)


def _beside(request: Request, forward: Forward) -> Response:
    if not _AT(request):
        return forward(request)
    if _PUT(request):
        request = request.copy()
        inputs(_guarded(_shift(0.8)))(request)
    response = forward(request)
    if success(response):
        values(_guarded(_shift(-0.8)))(response)
    return response


MUTANTS = (
    _mutant(
        "goal-none-empty",
        "Without a goal, GET is 200 with null.",
        "goal-none",
        altered(_GET, page(200, b"null", JSON), status(404)),
    ),
    _mutant(
        "goal-none-no-content", "Without a goal, GET is 204.", "goal-none", altered(_GET, becomes(204), status(404))
    ),
    _mutant("goal-put-ok", "PUT of a new goal is 200.", "goal-put", altered(_PUT, becomes(200), status(201, 202))),
    _mutant("goal-get-swapped", "GET gives a goal with x and y exchanged.", "goal-get", _told(_swap)),
    _mutant(
        "goal-get-frame",
        "GET gives a goal in another frame.",
        "goal-get",
        _told(lambda goal: goal["goal"]["target_pose"]["header"].update(frame_id="odom_2")),
    ),
    _mutant("goal-resumed", "A displaced goal is driven to after the one in its place.", "goal-drives", Resumed),
    _mutant("goal-get-stale", "GET gives the goal before the active one.", "goal-preempt", Previous),
    _mutant(
        "goal-get-other-id",
        "GET gives the goal under another id.",
        "goal-get",
        _told(lambda goal: goal["goal_id"].update(id="goal-1")),
    ),
    _mutant(
        "goal-without-status",
        "The active goal has no status.",
        "goal-status",
        _told(lambda goal: goal.pop("status") and None),
    ),
    _mutant(
        "goal-status-succeeded",
        "The active goal has status 4, succeeded.",
        "goal-status",
        _told(lambda goal: goal["status"].update(code=4)),
    ),
    _mutant(
        "goal-wants-id",
        "A goal without goal_id is refused.",
        "goal-fills-in",
        instead(_without_id, problem(422, "goal_id: missing")),
    ),
    _mutant(
        "goal-empty-id",
        "A goal without goal_id gets an empty one.",
        "goal-fills-in",
        _renamed(lambda id_: "" if len(id_) >= 32 else id_),
    ),
    _mutant("goal-id-cut", "Ids are cut after 32 characters.", "goal-id", _renamed(lambda id_: id_[:32])),
    _mutant(
        "goal-id-ascii",
        "Ids come back in lower case.",
        "goal-id",
        _renamed(lambda id_: id_.lower().encode("ascii", "replace").decode()),
    ),
    _mutant(
        "goal-repeat-refused",
        "The same goal again is refused with 409.",
        "goal-repeat",
        _when_active(problem(409, "goal_id.id: there already"), same=True, other_pose=False),
    ),
    _mutant(
        "goal-repeat-created",
        "The same goal again is 201.",
        "goal-repeat",
        _when_active(plain(201), same=True, other_pose=False),
    ),
    _mutant(
        "goal-unwanted-lost",
        "A goal is answered 202 and forgotten where the client accepts no format of the answer.",
        "goal-get",
        instead(unwanted(_PUT), plain(202)),
    ),
    _mutant(
        "goal-conflict-ignored",
        "The same id with another pose is answered 200.",
        "goal-conflict",
        _when_active(plain(204), same=True, other_pose=True),
    ),
    _mutant(
        "goal-first-wins",
        "Another goal is refused with 409 while one is active.",
        "goal-preempt",
        _when_active(problem(409, "a goal is active"), same=False),
    ),
    _mutant("goal-delete-ignored", "DELETE is 204 and cancels nothing.", "goal-delete", instead(_DELETE, plain(204))),
    _mutant(
        "goal-delete-for-xml",
        "DELETE by a client that would rather have XML is 204 and cancels nothing.",
        "goal-delete",
        instead(lambda request: _DELETE(request) and "xml" in (request.field("Accept") or ""), plain(204)),
    ),
    _mutant(
        "goal-delete-conflict",
        "DELETE of a goal cancels it, and is 409.",
        "goal-delete",
        altered(_DELETE, becomes(409), success),
    ),
    _mutant(
        "goal-delete-none-fine",
        "DELETE without a goal is 204.",
        "goal-delete-none",
        altered(_DELETE, becomes(204), status(404)),
    ),
    _mutant(
        "goal-delete-none-conflict",
        "DELETE without a goal is 409.",
        "goal-delete-none-success",
        lambda: _delete_conflict,
    ),
    _mutant("goal-lingers", "A goal that has ended is still shown.", "goal-ended", Lingering),
    _mutant("goal-id-only-once", "The id of a goal that has ended is refused.", "goal-id-again", OnlyOnce),
    _mutant("goal-abandoned", "The robot gives up on its way.", "goal-drives", Abandoned),
    _mutant(
        "goal-beside",
        "The robot stops 80 cm beside the goal, and shows the goal that it was given.",
        "goal-drives",
        lambda: _beside,
    ),
    _mutant(
        "goal-unreachable-forever",
        "A goal far outside the map is accepted and stays active.",
        "goal-unreachable",
        Unreachable,
    ),
    _mutant(
        "goal-frame-ignored",
        "A goal's frame is not looked at.",
        "goal-frame",
        rewritten(_PUT, inputs(_guarded(_known_frame))),
    ),
    _mutant(
        "goal-quaternion-nearly",
        "A quaternion that is off by less than a hundredth is made a unit one.",
        "goal-quaternion",
        rewritten(_off_by(2e-3, 9.5e-3), inputs(_guarded(_unit))),
    ),
    _mutant(
        "goal-quaternion-exact",
        "A quaternion that is off by more than a rounding error is refused.",
        "goal-quaternion-taken",
        instead(_off_by(1e-5, 1.0), problem(422, "goal.target_pose.pose.orientation: no unit quaternion")),
    ),
    _mutant(
        "goal-quaternion-normalised",
        "A quaternion of another length is made a unit one.",
        "goal-quaternion",
        rewritten(_PUT, inputs(_guarded(_unit))),
    ),
)
