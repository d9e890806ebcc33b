"""Progress on a goal's way, in numbers."""

import pytest

from reference_robot.simulation.navigation import PATIENCE_S, Progress

_STEP_S = 0.02


@pytest.mark.parametrize("time_scale", [1.0, 5.0])
def test_a_way_that_gets_no_shorter_lacks_progress_after_its_patience(time_scale):
    progress, now = Progress(7.0, time_scale), 7.0
    while not progress.is_lacking(3.0, now):
        now += _STEP_S
    assert (now - 7.0) * time_scale == pytest.approx(PATIENCE_S, abs=3 * time_scale * _STEP_S)


def test_a_way_that_gets_shorter_does_not():
    progress = Progress(0.0, 1.0)
    assert not any(progress.is_lacking(100.0 - 0.001 * step, _STEP_S * step) for step in range(10_000))


def test_whoever_is_held_up_fails_at_nothing():
    progress = Progress(0.0, 30.0)
    assert not progress.is_lacking(3.0, _STEP_S)
    assert not progress.is_lacking(3.0, 5.0)
    assert not progress.is_lacking(3.0, 5.0 + _STEP_S)
