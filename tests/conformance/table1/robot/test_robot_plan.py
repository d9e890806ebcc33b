"""A path begins where the robot is, by most of several readings, and one that leaps to a pose and back is none."""

import json
from dataclasses import replace

import pytest
from toy_messages import exchange, header, pose

from conformance.packs.table1.checkers.plans import Plans, longest_leap
from conformance.packs.table1.robot.geometry import Pose, middle_of
from conformance.packs.table1.robot.plan import Plan, start_of
from conformance.packs.table1.robot.soap_services import NAMESPACE
from conformance.packs.table1.statement import Statement
from conformance.transport.exchange import Exchange, Request, Response
from conformance.verdict.evidence import CheckerListener
from conformance.verdict.run import Run

_BASE = "http://robot:7003/r2d2"
_ID, _END, _SOAP = "rest-resources/plan-continuous", "rest-resources/plan-end", "soap-subscribers/plan"


def _envelope(payload: str) -> bytes:
    """Return a SOAP message with this payload, in the contract's namespace."""
    return (
        f'<s:Envelope xmlns:s="http://schemas.xmlsoap.org/soap/envelope/" xmlns:r="{NAMESPACE}">'
        f"<s:Body>{payload}</s:Body></s:Envelope>"
    ).encode()


def _straight(step: float, count: int = 20) -> list[Pose]:
    return [Pose(step * number, 0.0, 0.0) for number in range(count)]


def _leaping(by: float, place: int = 10, step: float = 0.1) -> list[Pose]:
    poses = _straight(step)
    poses[place] = Pose(poses[place].x, by, 0.0)
    return poses


def _corner() -> list[Pose]:
    """Two long steps in different directions, on a path of short ones."""
    dense = _straight(0.05)
    far = dense[-1].x + 2.0
    return [*dense, Pose(far, 0.0, 0.0), Pose(far, 2.0, 0.0)]


@pytest.mark.parametrize("by", [1.2, -3.0])
def test_one_pose_aside_is_a_leap(by):
    assert longest_leap(tuple(_leaping(by))) == pytest.approx((by**2 + 0.01) ** 0.5)


@pytest.mark.parametrize(
    "poses",
    [_straight(0.1), _straight(3.0), _leaping(0.9), _leaping(2.0, step=0.6), _leaping(2.0)[8:13], _corner(), []],
    ids=["short steps", "long steps", "short leap", "no longer than four steps", "few poses", "corner", "nothing"],
)
def test_what_is_no_leap(poses):
    assert longest_leap(tuple(poses)) == 0


def _seen(poses: list[Pose], *, path: str = "/robot/navigation/service/plan?x=1.9&y=0.0", **answer: object) -> Run:
    run = Run(statement=Statement())
    observer = CheckerListener(run.judge, [Plans(_BASE.__add__, run.statement)])
    there = [
        {"header": header(), "pose": pose(one.x) | {"position": {"x": one.x, "y": one.y, "z": 0.0}}} for one in poses
    ]
    body = json.dumps({"plan": {"header": header(), "poses": there}}).encode()
    response = replace(Response(200, (("Content-Type", "application/json"),), body, 1.0), **answer)
    observer.on_response(Exchange(Request("GET", _BASE + path), response))
    return run


def test_every_plan_counts():
    assert _seen(_straight(0.1)).judge.counts([_ID]) == {_ID: 1}
    assert _seen(_leaping(1.5)).judge.failure_counts() == {_ID: 1}


@pytest.mark.parametrize(
    ("asked", "cases", "failures"),
    [
        ("x=1.9&y=0.0", 1, 0),
        ("x=1.9&y=0.0&tolerance=0.01", 1, 0),
        ("x=0.0&y=0.0", 1, 1),
        ("x=2.0&y=0.0&tolerance=0.05", 1, 1),
        ("x=2.0&y=0.0&tolerance=0.2", 1, 0),
        # What nobody can compare: a place that is not clear, one beyond exact numbers, no room at all.
        ("x=0.0&x=1.9&y=0.0", 0, 0),
        ("x=0.0&y=nan", 0, 0),
        ("x=1e9&y=0.0", 0, 0),
        ("x=2.0&y=0.0&tolerance=0", 0, 0),
    ],
)
def test_every_plan_ends_where_it_was_asked_to(asked, cases, failures):
    judge = _seen(_straight(0.1), path=f"/robot/navigation/service/plan?{asked}").judge
    assert judge.counts([_END]) == {_END: cases}
    assert judge.failure_counts().get(_END, 0) == failures


@pytest.mark.parametrize(
    ("start", "cases", "failures"),
    [
        ("", 0, 0),
        ("&start_x=0.2&start_y=0", 1, 0),
        ("&start_x=0.0&start_y=0.3", 1, 1),
        ("&start_x=0.3", 0, 0),  # half a position, which the robot may refuse
        ("&start_x=1e9&start_y=0", 0, 0),
    ],
)
def test_every_plan_starts_where_it_was_asked_to(start, cases, failures):
    judge = _seen(_straight(0.1), path=f"/robot/navigation/service/plan?x=1.9&y=0.0{start}").judge
    assert judge.counts(["rest-resources/plan-given-start"]) == {"rest-resources/plan-given-start": cases}
    assert judge.failure_counts().get("rest-resources/plan-start", 0) == failures


@pytest.mark.parametrize(("frame", "failures"), [("", 0), ("&frame_id=map", 0), ("&frame_id=odom", 1)])
def test_every_plan_is_in_the_frame_that_was_asked_for(frame, failures):
    judge = _seen(_straight(0.1), path=f"/robot/navigation/service/plan?x=1.9&y=0.0{frame}").judge
    assert judge.failure_counts().get("rest-resources/plan-frame", 0) == failures


@pytest.mark.parametrize(("asked", "failures"), [("", 0), ("&yaw=0.1", 0), ("&yaw=0.3", 1), ("&yaw=nan", 0)])
def test_every_plan_ends_with_the_heading_that_was_asked_for(asked, failures):
    judge = _seen(_straight(0.1), path=f"/robot/navigation/service/plan?x=1.9&y=0.0{asked}").judge
    assert judge.failure_counts().get("rest-resources/plan-yaw", 0) == failures


@pytest.mark.parametrize(("step", "failures"), [(1.0, 0), (1.1, 1)])
def test_no_step_is_longer_than_declared(step, failures):
    assert _seen(_straight(step)).judge.failure_counts().get(_ID, 0) == failures


def test_a_pose_in_another_frame_is_found_where_none_was_asked_for():
    body = json.dumps({"plan": {"header": header(), "poses": [{"header": header("odom"), "pose": pose(1.9)}]}}).encode()
    judge = _seen([], octets=body).judge
    assert judge.failure_counts().get("rest-resources/plan-frame", 0) == 1


@pytest.mark.parametrize("x", ["1.9", "0.0"])
def test_a_plan_over_soap_ends_where_it_was_asked_to(x):
    poses = "".join(
        f"<poses><header><stamp><sec>1</sec><nanosec>0</nanosec></stamp><frame_id>map</frame_id></header><pose>"
        f"<position><x>{one.x}</x><y>0</y><z>0</z></position>"
        f"<orientation><x>0</x><y>0</y><z>0</z><w>1</w></orientation></pose></poses>"
        for one in _straight(0.1)
    )
    head = "<header><stamp><sec>1</sec><nanosec>0</nanosec></stamp><frame_id>map</frame_id></header>"
    answer = _envelope(f"<r:GetPlanResponse><return><plan>{head}{poses}</plan></return></r:GetPlanResponse>")
    asked = _envelope(f"<r:GetPlan><x>{x}</x><y>0</y></r:GetPlan>")
    request = Request("POST", "http://robot:5555/turtlesim_subscriber_ws", (("Content-Type", "text/xml"),), body=asked)
    run = Run(statement=Statement())
    observer = CheckerListener(run.judge, [Plans(_BASE.__add__, run.statement)])
    observer.on_response(Exchange(request, Response(200, (("Content-Type", "text/xml"),), answer, 1.0)))
    assert run.judge.counts([_SOAP]) == {_SOAP: 2}  # its end and its frame
    assert run.judge.failure_counts().get(_SOAP, 0) == (x != "1.9")


@pytest.mark.parametrize(
    "given",
    [{"path": "/robot/pose/"}, {"status": 422}, {"octets": b"{}"}, {"headers": (("Content-Type", "text/plain"),)}],
    ids=["another resource", "refused", "no plan", "another format"],
)
def test_what_is_no_plan_is_for_others_to_judge(given):
    assert _seen(_leaping(1.5), **given).judge.counts([_ID]) == {_ID: 0}


_HERE, _OUT = Pose(1.0, 2.0, 0.0), Pose(1.5, 2.5, 0.0)


class Localised:
    """A robot whose localisation gives these poses, one after another."""

    def __init__(self, poses: list[Pose]) -> None:
        self._poses = poses

    def map_pose(self) -> Pose:
        return self._poses.pop(0)


def path(first: Pose) -> Plan:
    return Plan(frozenset({"map"}), (first, Pose(3.0, 2.0, 0.0)))


@pytest.mark.parametrize(
    ("before", "poses", "plans", "refuted"),
    [
        (_HERE, [_HERE], [_HERE], False),
        (_OUT, [_OUT, *[_HERE] * 4], [_HERE] * 3, False),
        (_HERE, [_HERE] * 5, [_OUT, _HERE, _HERE], False),
        (_HERE, [_HERE] * 5, [_OUT] * 3, True),
        (_HERE, [_HERE] * 5, [_OUT, _HERE, _OUT], True),
    ],
)
def test_most_of_several_plans_tell(before, poses, plans, refuted):
    robot, (first, *others) = Localised(list(poses)), map(path, plans)
    start = start_of(robot, first, before, exchange(), lambda: others.pop(0))
    assert start.case.holds is not refuted


def test_the_middle_of_several_poses_is_not_moved_by_one():
    assert middle_of([_HERE, _OUT, _HERE]) == _HERE
