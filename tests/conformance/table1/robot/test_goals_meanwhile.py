"""What is done at once while a goal is active: in time, at another attempt, or not at all."""

from contextlib import contextmanager

from toy_body import serving

from conformance.api.rest.interface import RestInterface
from conformance.packs.table1.robot.goals import meanwhile
from conformance.packs.table1.robot.robot import GOAL_PATH, PLAN, Robot
from conformance.packs.table1.statement import Statement
from conformance.transport.client import Connection, HttpClient
from conformance.verdict.run import Run

_ODOMETRY = {
    "header": {"stamp": {"sec": 1, "nanosec": 0}, "frame_id": "odom"},
    "child_frame_id": "base_link",
    "pose": {
        "pose": {"position": dict.fromkeys("xyz", 0.0), "orientation": {**dict.fromkeys("xyz", 0.0), "w": 1.0}},
        "covariance": [0.0] * 36,
    },
    "twist": {"twist": {part: dict.fromkeys("xyz", 0.0) for part in ("linear", "angular")}, "covariance": [0.0] * 36},
}


class _Body:
    """A robot that takes goals, or does not, and has no plans, or says that there is none."""

    def __init__(self, *, takes: bool = True, plan: int = 503) -> None:
        self.takes, self.plan = takes, plan
        self.asked: list[str] = []

    def answer(self, method: str, path: str, _sent: bytes) -> tuple[int, object]:
        if path.startswith(PLAN):
            return self.plan, None
        if method == "PUT":
            self.asked.append(path)
            return (202 if self.takes else 422), None
        return (404, None) if path == GOAL_PATH else (200, _ODOMETRY)


@contextmanager
def _robot(body: _Body):
    with serving(body) as url:
        client = HttpClient(url, Connection())
        yield Robot(RestInterface(Run(statement=Statement(), allow_motion=True), client))
        client.close()


def _tried(body: _Body, *in_time: bool) -> tuple[bool, list[tuple[str, str, bool]]]:
    acts = []
    answers = iter(in_time)

    def act(goal, pose, other) -> bool:
        there = goal["goal"]["target_pose"]["pose"]
        acts.append((goal["goal_id"]["id"], other["goal_id"]["id"], there == other["goal"]["target_pose"]["pose"]))
        assert there["position"]["x"] == pose.x > 0.5
        return next(answers)

    with _robot(body) as robot:
        return meanwhile(robot, "goal", act), acts


def test_what_is_done_in_time_is_done_once():
    body = _Body()
    assert _tried(body, True) == (True, [("goal 0", "goal 0", False)])
    assert body.asked == [GOAL_PATH]


def test_what_is_late_is_done_anew_under_another_id():
    done, acts = _tried(_Body(), False, True)
    assert done
    assert [id_ for id_, _, _ in acts] == ["goal 0", "goal 1"]


def test_it_is_not_tried_for_ever():
    done, acts = _tried(_Body(), False, False, False)
    assert not done
    assert len(acts) == 3


def test_a_goal_that_is_refused_and_one_that_no_plan_leads_to_are_for_others_to_judge():
    assert _tried(_Body(takes=False)) == (False, [])
    body = _Body(plan=422)
    assert _tried(body) == (False, [])
    assert body.asked == []
