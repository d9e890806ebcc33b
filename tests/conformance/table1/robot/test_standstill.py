import time

import pytest
from toy_body import interface_of
from toy_messages import STILL, ZERO, goal

from conformance.api.rest.interface import RestInterface
from conformance.packs.table1.robot.standstill import Standstill
from conformance.packs.table1.robot.standstill_trace import stays
from conformance.scenarios.rule import NotTested, Outcome
from conformance.verdict.evidence import Case

_CANCEL, _REFUSED = "safety/cancel", "safety/refused-keeps"
_WATCH_S = 0.3
_LATER_S = 0.15


class Body:
    """A robot that drives, or has a goal, from a moment on; it stops when it is told to."""

    def __init__(self) -> None:
        self.drives_at = self.goal_at = float("inf")
        self.told: list[str] = []

    def drive(self) -> None:
        self.drives_at = time.monotonic() + _LATER_S

    def answer(self, method: str, path: str, _sent: bytes) -> tuple[int, object]:
        now = time.monotonic()
        if method != "GET":
            self.told.append(method)
            self.drives_at = self.goal_at = float("inf")
            return 204, None
        linear = ZERO | {"x": 0.3 if now > self.drives_at else 0.0}
        if path.endswith("/goal/"):
            return (200, goal("again")) if now > self.goal_at else (404, None)
        if path.endswith("/linear/"):
            return 200, linear
        if path.endswith("/velocity/"):
            return 200, STILL | {"linear": linear}
        return 503, None


@pytest.fixture
def body() -> Body:
    return Body()


@pytest.fixture
def api(body: Body):
    with interface_of(body, linear_m_s=0.7, angular_rad_s=2.5, settle_s=0.3) as api:
        yield api


@pytest.fixture
def standstill(api: RestInterface) -> Standstill:
    return Standstill(api)


class Trial:
    """An attempt that must leave the robot at rest; it can be repeated."""

    def __init__(self, requirement: str, act=lambda: None) -> None:
        self.requirement, self.act = requirement, act
        self.repeated_at: list[float] = []

    def attempt(self, standstill: Standstill, *, goal: bool = False) -> None:
        self.act()
        standstill.attempted(self.requirement, "a trial", self.repeat, seconds=_WATCH_S, goal=goal)

    def repeat(self) -> list[Case]:
        self.repeated_at.append(time.monotonic())
        self.act()
        return []


def _counts(standstill: Standstill) -> dict[str, int]:
    return {id_: len(list(stays(standstill.watched, id_))) for id_ in (_CANCEL, _REFUSED)}


def _is_failure(outcome: Outcome) -> bool:
    return isinstance(outcome, Case) and not outcome.holds


def _failures(standstill: Standstill) -> set[str]:
    return {id_ for id_ in (_CANCEL, _REFUSED) if any(map(_is_failure, stays(standstill.watched, id_)))}


def test_nothing_is_judged_where_nothing_was_tried(body, standstill):
    assert not standstill.lasts
    standstill.watch()
    assert (_counts(standstill), body.told) == ({_CANCEL: 0, _REFUSED: 0}, [])


def test_a_robot_that_stays_is_watched_as_long_as_the_last_trial_needs(body, standstill):
    trials = [Trial(_CANCEL), Trial(_REFUSED)]
    for trial in trials:
        trial.attempt(standstill, goal=True)
    begun = time.monotonic()
    assert standstill.lasts
    standstill.watch()
    assert time.monotonic() - begun > 0.9 * _WATCH_S
    assert (_counts(standstill), _failures(standstill)) == ({_CANCEL: 1, _REFUSED: 1}, set())
    assert [trial.repeated_at for trial in trials] == [[], []]
    standstill.watch()
    assert _counts(standstill) == {_CANCEL: 1, _REFUSED: 1}
    # Neither a command nor a cancellation, which would hide what was tried.
    assert body.told == []


def test_of_what_was_tried_the_one_that_moves_the_robot_is_found(body, standstill):
    innocent, guilty = Trial(_CANCEL), Trial(_REFUSED, body.drive)
    innocent.attempt(standstill)
    guilty.attempt(standstill)
    standstill.watch()
    assert _failures(standstill) == {_REFUSED}
    assert len(innocent.repeated_at) == len(guilty.repeated_at) == 1


def test_one_push_is_one_failure(body, standstill):
    trials = [Trial(_CANCEL), Trial(_REFUSED)]
    for trial in trials:
        trial.attempt(standstill)
    body.drive()
    standstill.watch()
    assert _failures(standstill) == {_CANCEL}
    assert [type(one) for one in stays(standstill.watched, _REFUSED)] == [Case, NotTested]
    assert all(len(trial.repeated_at) == 1 for trial in trials)


@pytest.mark.parametrize("counts", [True, False])
def test_a_goal_that_comes_back_counts_where_one_was_cancelled(body, standstill, counts):
    Trial(_CANCEL).attempt(standstill, goal=counts)
    body.goal_at = time.monotonic() + _LATER_S
    standstill.watch()
    assert _failures(standstill) == ({_CANCEL} if counts else set())


@pytest.mark.parametrize("what", ["drives_at", "goal_at"])
def test_a_robot_that_moves_or_has_a_goal_is_not_left_as_it_is(body, standstill, what):
    Trial(_CANCEL).attempt(standstill)
    setattr(body, what, 0.0)
    assert not standstill.lasts


def test_what_moved_while_something_else_was_read_is_found(body, standstill):
    Trial(_REFUSED).attempt(standstill)
    body.drives_at = 0.0
    standstill.look()
    body.drives_at = float("inf")
    standstill.look()
    standstill.watch()
    assert _failures(standstill) == {_REFUSED}


def test_nobody_looks_when_what_was_tried_would_have_shown(body, api, standstill):
    standstill.look()
    standstill.attempted(_REFUSED, "a trial", list, seconds=0.0)
    body.drives_at = 0.0
    standstill.look()
    assert api.client.connection.sent == 0
