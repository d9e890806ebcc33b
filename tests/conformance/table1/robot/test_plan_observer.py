"""A path that leaps to one pose and back is none, whoever asked for it; long steps are for others to judge."""

import json
from dataclasses import replace

import pytest
from toy_messages import header, pose

from conformance.api.rest.interface import RestInterface
from conformance.packs.table1.robot.geometry import Pose
from conformance.packs.table1.robot.plan_observer import PlanObserver, longest_leap
from conformance.packs.table1.statement import Statement
from conformance.transport.client import Connection, HttpClient
from conformance.transport.exchange import Exchange, Request, Response
from conformance.verdict.run import Run

_BASE = "http://robot:7003/r2d2"
_ID = "rest-resources/plan-continuous"


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


def _seen(poses: list[Pose], *, path: str = "/robot/navigation/service/plan?x=1.0&y=2.0", **answer: object) -> Run:
    run = Run(statement=Statement())
    observer = PlanObserver(RestInterface(run, HttpClient(_BASE + "/", Connection())))
    there = [
        {"header": header(), "pose": pose(one.x) | {"position": {"x": one.x, "y": one.y, "z": 0.0}}} for one in poses
    ]
    body = json.dumps({"plan": {"header": header(), "poses": there}}).encode()
    response = replace(Response(200, (("Content-Type", "application/json"),), body, 1.0), **answer)
    observer.answered(Exchange(Request("GET", _BASE + path), response))
    return run


def test_every_plan_counts():
    assert _seen(_straight(0.1)).judge.counts([_ID]) == {_ID: 1}
    assert _seen(_leaping(1.5)).judge.refuted() == {_ID: 1}


@pytest.mark.parametrize(
    "given",
    [{"path": "/robot/pose/"}, {"status": 422}, {"body": b"{}"}, {"headers": (("Content-Type", "text/plain"),)}],
    ids=["another resource", "refused", "no plan", "another format"],
)
def test_what_is_no_plan_is_for_others_to_judge(given):
    assert _seen(_leaping(1.5), **given).judge.counts([_ID]) == {_ID: 0}
