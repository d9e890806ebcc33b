"""Whether a velocity is reached in time, also where whoever looks is held up: a robot of numbers, a clock of ours."""

from types import SimpleNamespace

import pytest

from conformance.contract.limits import DeclaredLimits
from conformance.robot import drive
from conformance.robot.drive_trace import Command, Turn
from conformance.robot.geometry import Pose
from conformance.robot.robot import STILL, Odometry, Velocity
from conformance.transport.exchange import Exchange, Request, Response

_WANTED = Velocity(linear_x=0.5)
_CONVERGES = "rest-resources/velocity-converges"
_SETTLE_S = 1.2
_LOOK_S = 0.02
_SAMPLE_S = 0.2
_EXCHANGE = Exchange(Request("GET", "http://robot/"), Response(200, (), b"", 1.0))


class _Clock:
    def __init__(self) -> None:
        self.now = 100.0

    def monotonic(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += seconds


class _Body:
    """Reaches what it is told so long after it was told, and stops where it is not told again within its hold time.

    It has an odometry five times a second.
    """

    def __init__(self, clock: _Clock, takes_s: float, hold_s: float) -> None:
        self.clock, self.takes_s, self.hold_s = clock, takes_s, hold_s
        self.told: list[float] = []

    def tell(self) -> None:
        """Take up the velocity, or go on with it."""
        if self.told and self.clock.now > self.told[-1] + self.hold_s:
            self.told = []
        self.told.append(self.clock.now)

    @property
    def sampled(self) -> float:
        """When the newest odometry was taken."""
        return self.clock.now // _SAMPLE_S * _SAMPLE_S

    @property
    def velocity(self) -> Velocity:
        """What that one says."""
        moves = bool(self.told) and self.told[0] + self.takes_s <= self.sampled <= self.told[-1] + self.hold_s
        return _WANTED if moves else STILL


class _Drive(drive.Drive):
    """Looks for as long as it is told to, which may be longer than anybody wants."""

    def __init__(self, body: _Body, looks: dict[int, float], hold_s: float, usual_s: float = 0.001) -> None:
        declared = {"settle_s": _SETTLE_S, "hold_s": hold_s, "tolerance_abs": 0.02}
        limits = DeclaredLimits(**declared).resolved()
        self.judged: list[bool] = []
        self.skipped: list[str] = []
        judge = SimpleNamespace(check=self._take, skip=lambda id_, _: self.skipped.append(id_))
        given = {"limits": limits, "judge": judge, "settle_s": 1.25 * _SETTLE_S + 0.25, "sample_s": 0.2}
        given["usual_s"] = usual_s
        super().__init__(SimpleNamespace(**given))
        self.body, self.looks = body, looks

    def _take(self, _requirement: str, holds: bool, *_: object, **__: object) -> bool:  # noqa: FBT001 - as of a judge
        self.judged.append(holds)
        return holds

    def tell(self, *, renewal: bool = False) -> None:
        """Command the velocity."""
        sent = self.body.clock.now
        self.body.tell()
        self.trace = self.trace.commanded(Command(_WANTED, sent, sent + 0.01, _EXCHANGE, renewal=renewal))

    def _renew(self) -> None:
        self.tell(renewal=True)

    def look(self) -> tuple[Velocity | None, Exchange]:
        """Take a sample, after a while."""
        clock = self.body.clock
        clock.now += self.looks.get(len(self.trace.turns), _LOOK_S)
        seen = self.body.velocity
        odometry = Odometry(clock.now, clock.now, self.body.sampled, Pose(0.0, 0.0, 0.0), seen, _EXCHANGE)
        self.trace = self.trace.looked(Turn(odometry, clock.now, seen, _EXCHANGE, None, _EXCHANGE))
        return seen, _EXCHANGE


def _judged(
    monkeypatch: pytest.MonkeyPatch, takes_s: float, looks: dict[int, float] | None = None, hold_s: float = 10.0
) -> bool:
    """Whether a robot that takes so long is said to have reached the velocity."""
    clock = _Clock()
    monkeypatch.setattr(drive, "time", clock)
    driven = _Drive(_Body(clock, takes_s, hold_s), looks or {}, hold_s)
    driven.tell()
    driven.reach(_WANTED, _CONVERGES)
    (holds,) = driven.judged
    return holds


@pytest.mark.parametrize("takes_s", [0.5 * _SETTLE_S, _SETTLE_S - _SAMPLE_S, _SETTLE_S])
def test_a_velocity_is_reached_in_its_settle_time_and_seen_with_the_next_odometry(monkeypatch, takes_s):
    assert _judged(monkeypatch, takes_s)


@pytest.mark.parametrize("late_s", [0.6, 0.7, 0.8, 1.2, 3.0])
def test_samples_from_within_the_settle_time_say_nothing_of_a_robot_that_was_looked_at_too_late(monkeypatch, late_s):
    # Fifty looks while it still had time, then nothing until after the end.
    assert _judged(monkeypatch, _SETTLE_S, {50: late_s})


def test_a_velocity_that_ended_because_it_was_renewed_too_late_has_its_settle_time_again(monkeypatch):
    assert _judged(monkeypatch, _SETTLE_S, {5: 1.6}, hold_s=1.0)


@pytest.mark.parametrize("looks", [{}, {50: 0.6}, {5: 1.6}, dict.fromkeys(range(100), 0.7)])
@pytest.mark.parametrize("hold_s", [1.0, 10.0])
def test_a_robot_that_takes_twice_its_settle_time_is_refuted(monkeypatch, looks, hold_s):
    assert not _judged(monkeypatch, 3 * _SETTLE_S, looks, hold_s)


def test_rest_that_no_velocity_brings_about_is_waited_for_as_long(monkeypatch):
    # A goal was cancelled: there is no command to be renewed.
    clock = _Clock()
    monkeypatch.setattr(drive, "time", clock)
    body = _Body(clock, 0.0, 10.0)
    body.tell()
    driven = _Drive(body, {}, 1.0)
    driven.reach(STILL, "safety/cancel", since=clock.now)
    assert driven.judged == [False]
    assert driven.trace.commands == ()


@pytest.mark.parametrize(("usual_s", "judged"), [(0.3, [False]), (0.4, [])])
def test_what_ends_before_it_can_be_read_is_not_held_against_the_robot(monkeypatch, usual_s, judged):
    clock = _Clock()
    monkeypatch.setattr(drive, "time", clock)
    driven = _Drive(_Body(clock, 20 * _SETTLE_S, 1.0), dict.fromkeys(range(100), 3 * usual_s), 1.0, usual_s)
    driven.tell()
    assert not driven.reach(_WANTED, _CONVERGES)
    assert driven.judged == judged
    assert driven.skipped == ([] if judged else [_CONVERGES])
