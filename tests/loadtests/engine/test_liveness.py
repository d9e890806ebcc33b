"""When a robot under load counts as dead."""

import pytest

from loadtests.statistics.overload import Liveness


@pytest.mark.parametrize("report_s", [0.0, 1.0])
def test_a_robot_is_dead_when_nothing_succeeds_for_three_seconds_though_much_is_tried(report_s):
    liveness = Liveness(report_s)
    assert liveness.dead_since(1.0, succeeded=50, failed=0) is None
    assert liveness.dead_since(2.0, succeeded=50, failed=40) is None
    assert liveness.dead_since(4.0 + report_s, succeeded=50, failed=99) is None
    assert liveness.dead_since(4.1 + report_s, succeeded=50, failed=100) == 1.0


def test_a_robot_that_is_asked_little_or_answers_again_is_not_dead():
    liveness = Liveness(0.0)
    assert liveness.dead_since(9.0, succeeded=0, failed=9) is None
    assert liveness.dead_since(11.0, succeeded=0, failed=20) is None
    assert liveness.dead_since(11.9, succeeded=1, failed=30) is None
    assert liveness.dead_since(14.0, succeeded=1, failed=60) is None


def test_looking_is_due_twice_a_second():
    liveness = Liveness(0.0)
    liveness.dead_since(1.0, 0, 0)
    assert not liveness.is_due(1.4)
    assert liveness.is_due(1.5)
