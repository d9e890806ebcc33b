"""Records of sent goals and of the robot's responses, as data that rules can judge without a robot."""

from dataclasses import dataclass
from http import HTTPStatus
from typing import Any, Final

from conformance.packs.table1.robot.drive_trace import Trace
from conformance.packs.table1.robot.geometry import Pose
from conformance.packs.table1.robot.goal import CANCELLED, NEW, REPEATED
from conformance.packs.table1.robot.plan import Start
from conformance.transport.exchange import Exchange
from conformance.verdict.evidence import Case

# The statuses that conform, and what is expected, for each kind of step.
_STEPS: Final[dict[str, tuple[frozenset[int], str]]] = {
    "goal-none": (frozenset({HTTPStatus.NOT_FOUND}), "404 without an active goal"),
    "goal-get": (frozenset({HTTPStatus.OK}), "the active goal, as it was put"),
    "goal-put": (NEW, "201 or 202 for a new goal"),
    "goal-preempt": (frozenset({HTTPStatus.OK}), "the goal that was put last"),
    "goal-repeat": (REPEATED, "200, 202 or 204 for the active goal"),
    "goal-conflict": (frozenset({HTTPStatus.CONFLICT}), "409 for another pose under this id"),
    "goal-delete": (CANCELLED, "204 for DELETE, then 404 for GET"),
    "goal-delete-none-success": (CANCELLED | {HTTPStatus.NOT_FOUND}, "404 or 204"),
}


@dataclass(frozen=True)
class NoGoal:
    """GET and DELETE of the goal while the robot has none.

    Attributes:
        read, cancelled: the responses to GET and DELETE.
    """

    read: Exchange
    cancelled: Exchange


@dataclass(frozen=True)
class Put:
    """The PUT of a goal, and the goal that the robot then showed.

    Attributes:
        exchange: the PUT's request and response.
        body: the goal that was sent.
        shown: the goal that the robot showed; None if it showed none.
        read: the GET that showed it.
        differs: where it differs from the goal sent; empty if nowhere.
        ended: whether the robot was already at the target, so that the goal may have ended before the GET.
    """

    exchange: Exchange
    body: dict[str, Any]
    shown: Any
    read: Exchange
    differs: str
    ended: bool


@dataclass(frozen=True)
class Cancelled:
    """The DELETE of a goal, and the reads after it.

    Attributes:
        exchange: the DELETE's request and response.
        read: the last GET of the goal.
        gone: whether the robot had no goal in the end.
        drive: the readings while the suite waited for the robot to stand still.
        late: whether the response to the DELETE took longer than usual.
    """

    exchange: Exchange
    read: Exchange
    gone: bool
    drive: Trace
    late: bool = False


@dataclass(frozen=True)
class GoalLife:
    """The trace of the scenario goal_life: a goal is PUT, repeated, contradicted, replaced by another, and cancelled.

    Attributes:
        none: GETs and DELETEs before the first goal.
        first: the PUT of the first goal, which has all optional members.
        stamps: the first goal's stamp in two readings.
        repeated: repeated PUTs of the active goal.
        put_back: PUTs of the active goal as GET showed it.
        contradicted: PUTs of another pose under the active goal's id.
        velocity: the response to a velocity PUT while a goal was active; None if no velocity was sent.
        drive: commands and readings of that velocity, where the robot accepted it.
        linear: the response to a PUT of a linear velocity after it; None if none was sent.
        kept: velocities that were refused while a goal was active, with the goal that the robot then showed.
        second: the PUT of another goal without an id.
        now_s: the stamp of the robot's odometry after that, s; None if it could not be read.
        took_s: the time from the PUT to that reading, s.
        reused: the PUT of another pose under the first goal's id, after that goal had been replaced.
        again: the same PUT once more, after that goal had been cancelled.
        renamed: whether the robot accepted the second goal only with an id; None if it accepted it without one.
        cancelled: DELETEs of the active goal; empty if the goal had ended before.
        cancels: all DELETEs that were sent while a goal was active, also where the goal had ended when they arrived.
    """

    none: tuple[NoGoal, ...] = ()
    first: Put | None = None
    stamps: tuple[Any, ...] = ()
    repeated: tuple[Put, ...] = ()
    put_back: tuple[Put, ...] = ()
    contradicted: tuple[Put, ...] = ()
    velocity: Exchange | None = None
    drive: Trace | None = None
    linear: Exchange | None = None
    kept: tuple[Put, ...] = ()
    second: Put | None = None
    now_s: float | None = None
    took_s: float = 0.0
    reused: Put | None = None
    again: Put | None = None
    renamed: bool | None = None
    cancelled: tuple[Cancelled, ...] = ()
    cancels: tuple[Exchange, ...] = ()


@dataclass(frozen=True)
class GoalReached:
    """The trace of a goal that the robot had to drive to.

    Attributes:
        put: the PUT's request and response.
        there: the target, in the frame of goals.
        here: the robot's last pose.
        way_m: distance driven, m; has_to_m: least distance that counts as driving, m.
        left_m: distance left to the target, m; reached_m: distance that counts as reached, m.
        off_rad: difference left to the target's heading, rad; reached_rad: difference that counts as reached, rad, or
            None if the robot cannot turn.
        drive: all readings on the way.
        read: the last GET of the goal.
        ended: whether the robot had no goal any more.
        other: whether another client's goal became active on the way, or after it.
        undecided: whether the robot still made progress when the time was over, or another client's goal ended it.
        turned: a drive after the goal that shows whether the robot resumes a velocity from before it; or None.
        start: where a plan begins after the goal; or None.
        start_over_soap: the same for a plan over SOAP.
        over_soap: the last GetGoal after the goal had ended, and whether it shows a goal; or None.
        again: the PUT of the same goal, or of one that only turns, after it had ended; or None.
        turned_off: the last GET of the goal that only turns, and by how much the heading is off at its end, rad; or
            None.
    """

    put: Exchange
    there: Pose | None = None
    here: Pose | None = None
    way_m: float = 0.0
    has_to_m: float = 0.0
    left_m: float = 0.0
    reached_m: float = 0.0
    off_rad: float = 0.0
    reached_rad: float | None = None
    drive: Trace | None = None
    read: Exchange | None = None
    ended: bool = False
    other: bool = False
    undecided: bool = False
    turned: Trace | None = None
    start: Start | None = None
    start_over_soap: Start | None = None
    over_soap: tuple[Exchange, bool] | None = None
    again: Exchange | None = None
    turned_off: tuple[Exchange, float] | None = None

    @property
    def is_near(self) -> bool:
        """Return whether the robot's last pose is within the tolerances of the target."""
        return self.left_m < self.reached_m and (self.reached_rad is None or abs(self.off_rad) < self.reached_rad)


@dataclass(frozen=True)
class SpecialGoal:
    """The PUT of a goal that is special in one respect.

    Attributes:
        special: that respect, as a noun phrase: "a quaternion of length 2".
        exchange: the PUT's request and response.
    """

    special: str
    exchange: Exchange


@dataclass(frozen=True)
class FarGoal:
    """The PUT of a goal outside every map.

    Attributes:
        exchange: the PUT's request and response.
        read: the last GET of the goal; None if the robot rejected it, so there was no GET.
        waited_s: the time the robot had to end the goal, s.
    """

    exchange: Exchange
    read: Exchange | None
    waited_s: float


@dataclass(frozen=True)
class RefusedGoals:
    """The trace of goals that a robot must reject, and of two that are just valid.

    Attributes:
        not_unit: goals with a quaternion whose length is not 1.
        unit: valid goals, whose quaternion's length is 1 within the tolerance.
        unknown_frames: goals in frames that the robot does not know.
        far: goals outside every map.
    """

    not_unit: tuple[SpecialGoal, ...] = ()
    unit: tuple[SpecialGoal, ...] = ()
    unknown_frames: tuple[SpecialGoal, ...] = ()
    far: tuple[FarGoal, ...] = ()


@dataclass(frozen=True)
class GoalStep:
    """One request of a random walk through the lives of goals.

    Attributes:
        kind: what is done, as the name of the requirement on the response.
        exchange: the request and its response.
        differs: where a goal that the robot shows now differs from the one that it must show; empty if nowhere.
        ended: whether the goal may have ended before the request.
    """

    kind: str
    exchange: Exchange
    differs: str = ""
    ended: bool = False

    @property
    def case(self) -> Case:
        """Return the step as a judged case."""
        statuses, expected = _STEPS[self.kind]
        status = self.exchange.response.status
        holds = not self.differs and (status in statuses or (self.ended and status == HTTPStatus.NOT_FOUND))
        return Case(holds, self.exchange, expected, self.differs)


@dataclass(frozen=True)
class GoalRead:
    """A GET of the goal.

    Attributes:
        exchange: the GET's request and response.
        differs: how the goal differs from each goal that was PUT; empty when it equals one of them.
    """

    exchange: Exchange
    differs: str


@dataclass(frozen=True)
class ConcurrentGoal:
    """Several clients' simultaneous PUTs of one new goal.

    Attributes:
        puts: the PUTs that the robot did not answer with 429 or 503.
        read: the goal afterwards; None when it may have ended before it could be read.
        cancelled: the GETs after the goal was cancelled, up to the first that shows the goal again.
    """

    puts: tuple[Exchange, ...]
    read: GoalRead | None
    cancelled: tuple[GoalRead, ...] = ()
