"""A path has to begin where the robot is, and one reading of its localisation may be out."""

import pytest
from toy_messages import exchange

from conformance.packs.table1.robot.geometry import Pose, middle_of
from conformance.packs.table1.robot.plan import Plan, start_of

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
