"""The statement's tables on the paper's robot: its limits, where it may be driven, its ROS side."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Literal

import msgspec

from conformance.contract.classes import Prerequisite
from conformance.contract.pack import Contract
from conformance.contract.toml_file import Finite, NotNegative, Text
from conformance.packs.table1.limits import DeclaredLimits, Limits
from conformance.papers_robot.statement import RobotStatement, Ros
from conformance.statement import statement as generic

if TYPE_CHECKING:
    from pathlib import Path

    from conformance.verdict.run import Run

Component = Literal["linear.x", "linear.y", "linear.z", "angular.x", "angular.y", "angular.z"]


class Motion(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Where a robot may be driven.

    Attributes:
        arena: (x_min, y_min, x_max, y_max) in the frame of goals, m; None means stay near where the robot is.
        frame: frame of goals and plans.
        radius_m: how far from where it is a goal may be, when there is no arena.
        goals: poses (x, y, yaw) that can be reached; empty means found by asking for plans.
        odom_to_map: (x, y, yaw) of the odometry frame in the frame of goals.
        actuated: the velocity components that the robot can actuate.
        turns_on_the_spot: whether it can turn without driving; if not, ``min_radius_m`` must be declared.
        min_radius_m: radius of the narrowest circle that it can drive, m.
        wheel_separation_m: distance of the wheels whose speed linear.x limits, so that a robot drives slower while it
            turns, m; 0 means either limit can be reached whatever the other part is; None if not declared.
    """

    arena: tuple[Finite, Finite, Finite, Finite] | None = None
    frame: Text = "map"
    radius_m: NotNegative = 1.0
    goals: tuple[tuple[Finite, Finite, Finite], ...] = ()
    odom_to_map: tuple[Finite, Finite, Finite] = (0.0, 0.0, 0.0)
    actuated: tuple[Component, ...] = ("linear.x", "angular.z")
    turns_on_the_spot: bool = True
    min_radius_m: Annotated[float, msgspec.Meta(ge=0.01, le=10)] | None = None
    wheel_separation_m: Annotated[float, msgspec.Meta(ge=0, le=10)] | None = None

    def __post_init__(self) -> None:
        """Check that a radius is declared where, and only where, the robot cannot turn on the spot.

        Raises:
            ValueError: One is declared without the other.
        """
        if self.turns_on_the_spot != (self.min_radius_m is None):
            raise ValueError("turns_on_the_spot = false and min_radius_m must be declared together")


class Statement(RobotStatement, frozen=True):
    """A statement on the paper's robot.

    Attributes:
        declared: the limits that it names.
    """

    declared: DeclaredLimits = DeclaredLimits()
    motion: Motion = Motion()

    @property
    def limits(self) -> Limits:
        """Return the figures by which the robot is judged, declared or default."""
        return self.declared.resolve()

    @property
    def figures(self) -> dict[str, dict[str, float]]:
        """The figures in result.json: the declared ones, and the limits and tolerances for judging."""
        motion = self.motion
        shape = {"min_radius_m": motion.min_radius_m, "wheel_separation_m": motion.wheel_separation_m}
        declared = self.declared.figures | {name: figure for name, figure in shape.items() if figure is not None}
        noise = msgspec.structs.asdict(self.declared.noise) if self.declared.noise else {}
        declared |= {f"noise_{name}": figure for name, figure in noise.items() if figure}
        return {"declared": declared, "limits": self.limits.figures, "tolerances": self.limits.tolerances}

    @property
    def why_not_tested(self) -> dict[str, str]:
        """Why requirements that need a figure are not tested, by the prerequisite that the statement lacks."""
        limits = self.limits
        kinds = {name.partition(".")[0] for name in self.motion.actuated}
        declared = {"linear": limits.linear_declared, "angular": limits.angular_declared}
        there = {
            Prerequisite.HOLD: limits.hold_s is not None,
            Prerequisite.LIMITS: all(declared[kind] for kind in kinds),
        }
        words = {Prerequisite.HOLD: "hold time", Prerequisite.LIMITS: "limits of speed and turning rate"}
        lacking: dict[str, str] = {
            need: f"not tested: the statement declares no {words[need]}" for need, known in there.items() if not known
        }
        unresolved = limits.unresolved_reason
        return lacking | ({Prerequisite.RESOLVED: f"not tested: {unresolved}"} if unresolved else {})


class StatementFile(generic.StatementFile, frozen=True, forbid_unknown_fields=True):
    """The tables of a statement on the paper's robot, as they are written."""

    limits: DeclaredLimits = DeclaredLimits()
    motion: Motion = Motion()
    ros: Ros = Ros()

    def read(self, contract: Contract, path: Path) -> Statement:
        """Return the statement that a file makes.

        Raises:
            StatementError: it claims what the contract does not have.
        """
        common: dict[str, Any] = self.common(contract, path)
        return Statement(**common, declared=self.limits, motion=self.motion, ros=self.ros)


def said_of(run: Run) -> Statement:
    """Return the run's statement with the paper robot's tables.

    Raises:
        TypeError: the run judges another kind of device.
    """
    if not isinstance(run.statement, Statement):
        raise TypeError("the run's statement is not on the paper's robot")
    return run.statement
