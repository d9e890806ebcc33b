"""A robot of numbers and a clock of ours, for tests of what is judged of a drive, also by one who is held up."""

from types import SimpleNamespace
from typing import Any, Final

from driven_device import SimulatedClock
from toy_messages import exchange

from conformance.packs.table1.limits import DeclaredLimits
from conformance.packs.table1.robot import drive
from conformance.packs.table1.robot.drive_rules import every_outcome
from conformance.packs.table1.robot.drive_trace import Command, Turn
from conformance.packs.table1.robot.geometry import Pose
from conformance.packs.table1.robot.robot import STILL, Odometry, Velocity
from conformance.transport.exchange import Exchange
from conformance.verdict.evidence import Case

WANTED: Final = Velocity(linear_x=0.5)
SETTLE_S: Final = 1.2
SAMPLE_S: Final = 0.2
_LOOK_S = 0.02
_EXCHANGE = exchange()


class Body:
    """Reaches what it is told so long after it was told, and stops where it is not told again within its hold time.

    It has an odometry five times a second. A faulty one ``loses`` the first that it is told.
    """

    def __init__(self, clock: SimulatedClock, takes_s: float, hold_s: float, *, loses: bool = False) -> None:
        self.clock, self.takes_s, self.hold_s, self.loses = clock, takes_s, hold_s, loses
        self.told: list[float] = []

    def tell(self) -> None:
        """Take up the velocity, or go on with it."""
        if self.loses:
            self.loses = False
            return
        if self.told and self.clock.time_s > self.told[-1] + self.hold_s:
            self.told = []
        self.told.append(self.clock.time_s)

    @property
    def sampled(self) -> float:
        """When the newest odometry was taken."""
        return self.clock.time_s // SAMPLE_S * SAMPLE_S

    @property
    def velocity(self) -> Velocity:
        """What that one says."""
        moves = bool(self.told) and self.told[0] + self.takes_s <= self.sampled <= self.told[-1] + self.hold_s
        return WANTED if moves else STILL


class Drive(drive.Drive):
    """Looks for as long as it is told to, which may be longer than anybody wants."""

    def __init__(self, body: Body, looks: dict[int, float], hold_s: float, usual_s: float = 0.001) -> None:
        declared = {"settle_s": SETTLE_S, "hold_s": hold_s, "tolerance_abs": 0.02}
        limits = DeclaredLimits(**declared).resolve()
        given: dict[str, Any] = {"limits": limits, "clock": body.clock, "settle_s": 1.25 * SETTLE_S + 0.25}
        given |= {"sample_s": SAMPLE_S, "usual_s": usual_s}
        super().__init__(SimpleNamespace(**given))
        self.body, self.looks = body, looks

    @property
    def judged(self) -> dict[str, bool]:
        """Whether each requirement holds that the drive was to show."""
        found: dict[str, bool] = {}
        shown = {id_ for reach in self.trace.reaches for id_ in reach.shows} | dict(self.trace.sightings).keys()
        for id_, one in every_outcome(self.trace, self.robot.limits, way=False):
            if isinstance(one, Case) and id_ in shown:
                found[id_] = found.get(id_, True) and one.holds
        return found

    def command(self, velocity: Velocity, *, integers: bool = False) -> bool:  # noqa: ARG002 - as of a drive
        """Command the one velocity, or rest."""
        self.tell(velocity)
        return True

    def tell(self, velocity: Velocity = WANTED, *, renewal: bool = False) -> None:
        """The same, without an answer."""
        sent = self.body.clock.time_s
        if velocity == STILL:
            self.body.told = []
        else:
            self.body.tell()
        self.body.clock.time_s += self.robot.usual_s
        self.trace = self.trace.with_command(
            Command(velocity, sent, self.body.clock.time_s, _EXCHANGE, renewal=renewal)
        )

    def _renew(self) -> None:
        self.tell(renewal=True)

    def look(self) -> tuple[Velocity | None, Exchange]:
        """Take a sample, after a while."""
        clock = self.body.clock
        clock.time_s += self.looks.get(len(self.trace.turns), max(_LOOK_S, self.look_s))
        seen = self.body.velocity
        odometry = Odometry(clock.time_s, clock.time_s, self.body.sampled, Pose(0.0, 0.0, 0.0), seen, _EXCHANGE)
        self.trace = self.trace.with_look(Turn(odometry, clock.time_s, seen, _EXCHANGE, None, _EXCHANGE))
        return seen, _EXCHANGE
