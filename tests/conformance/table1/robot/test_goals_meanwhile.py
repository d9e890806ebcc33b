"""What is done at once while a goal is active: in time, at another attempt, or not at all."""

from toy_body import interface_of
from toy_messages import odometry

from conformance.packs.table1.robot.goal import meanwhile
from conformance.packs.table1.robot.robot import GOAL_PATH, PLAN, Robot


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
        return (404, None) if path == GOAL_PATH else (200, odometry())


def _tried(body: _Body, *in_time: bool) -> tuple[bool, list[tuple[str, str, bool]]]:
    acts = []
    answers = iter(in_time)

    def act(goal, pose, other) -> bool:
        there = goal["goal"]["target_pose"]["pose"]
        acts.append((goal["goal_id"]["id"], other["goal_id"]["id"], there == other["goal"]["target_pose"]["pose"]))
        assert there["position"]["x"] == pose.x > 0.5
        return next(answers)

    with interface_of(body) as api:
        return meanwhile(Robot(api), "goal", act), acts


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
