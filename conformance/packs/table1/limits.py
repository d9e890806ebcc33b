"""What a robot can do, and how exactly: what its statement declares, and what it is judged by.

A figure is declared when the statement names it, whatever its value. What is not declared has a figure to drive the
robot by all the same (contract.md, the statement): the reference robot's limits halved, so that a slower one can
follow.
"""

from typing import Annotated

import msgspec
from msgspec import Meta

from conformance.contract.toml_file import Finite, NotNegative, Positive


class Noise(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How far the odometry of a robot at rest is off: the greatest figures that a statement may declare.

    Attributes:
        position_m: m; heading_rad: rad; linear_m_s: m/s; angular_rad_s: rad/s.
    """

    position_m: Annotated[float, Meta(ge=0, le=0.05)] = 0.0
    heading_rad: Annotated[float, Meta(ge=0, le=0.05)] = 0.0
    linear_m_s: Annotated[float, Meta(ge=0, le=0.05)] = 0.0
    angular_rad_s: Annotated[float, Meta(ge=0, le=0.1)] = 0.0


class Limits(msgspec.Struct, frozen=True, kw_only=True):
    """What judging uses; each default is the figure for what is not declared.

    Attributes:
        linear_m_s: greatest speed, m/s.
        angular_rad_s: greatest turning rate, rad/s.
        settle_s: time within which a commanded velocity is reached, s.
        hold_s: time for which a velocity holds unless renewed, s; None: not declared, not judged.
        tolerance: relative tolerance of a reached velocity; tolerance_linear_m_s: the absolute one of its linear part,
            m/s; tolerance_angular_rad_s: of its angular part, rad/s.
        noise: of the odometry.
        odometry_hz: how often there is a new odometry, Hz; None: not declared, and seen by its stamps.
        time_scale: by how much the robot's clock is faster than the one on the wall.
        clock_offset_s: by how much the robot's clock is ahead of its ``Date`` header, s.
        goal_m: how far from a goal's position the robot may end the goal, m; goal_rad: from its heading, rad.
        goal_s: how long a hindered robot may make no progress towards a goal, s.
        plan_step_m: the greatest distance between two successive poses of a plan, m.
        linear_declared: whether ``linear_m_s`` is the robot's, so that what lies beyond it can be judged;
            likewise angular_declared.
    """

    linear_m_s: float = 0.35
    angular_rad_s: float = 1.25
    settle_s: float = 2.0
    hold_s: float | None = None
    tolerance: float = 0.05
    tolerance_linear_m_s: float = 0.02
    tolerance_angular_rad_s: float = 0.02
    noise: Noise = Noise()
    odometry_hz: float | None = None
    time_scale: float = 1.0
    clock_offset_s: float = 0.0
    goal_m: float = 0.25  # Nav2's own defaults
    goal_rad: float = 0.25
    goal_s: float = 30.0
    plan_step_m: float = 1.0
    linear_declared: bool
    angular_declared: bool

    @property
    def arrival(self) -> tuple[float, float]:
        """How far from a goal the odometry may show a robot that has arrived: m, and rad.

        The declared tolerances, a twentieth and 0.01 for rounding, and what the noise leaves of a median of samples.
        """
        noise = self.noise
        return 1.05 * self.goal_m + 0.01 + 2 * noise.position_m, 1.05 * self.goal_rad + 0.01 + 2 * noise.heading_rad

    @property
    def figures(self) -> dict[str, float]:
        """The limits by name, as a result shows them."""
        figures = {"linear_m_s": self.linear_m_s, "angular_rad_s": self.angular_rad_s, "settle_s": self.settle_s}
        return figures if self.hold_s is None else figures | {"hold_s": self.hold_s}

    @property
    def tolerances(self) -> dict[str, float]:
        """The tolerances by name, as a result shows them, and the noise where there is any."""
        noise = {f"noise_{name}": figure for name, figure in msgspec.structs.asdict(self.noise).items() if figure}
        linear, angular = self.tolerance_linear_m_s, self.tolerance_angular_rad_s
        absolute = {"tolerance_linear_m_s": linear, "tolerance_angular_rad_s": angular}
        same = {"tolerance_abs": linear} if linear == angular else {}
        goal = {"goal_m": self.goal_m, "goal_rad": self.goal_rad}
        return {"tolerance": self.tolerance, **same, **absolute, **goal, **noise}


class DeclaredLimits(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The table ``[limits]`` of a statement: fields as in Limits; None: not declared.

    ``tolerance_abs`` is one figure for both absolute tolerances, where they are not named themselves.

    The bounds are the contract's (contract.md#statement): by a wider tolerance a robot would be judged by nothing.
    """

    linear_m_s: NotNegative | None = None
    angular_rad_s: NotNegative | None = None
    settle_s: Annotated[float, Meta(ge=0, le=5)] | None = None
    hold_s: Annotated[float, Meta(ge=0.2, le=10)] | None = None
    tolerance: Annotated[float, Meta(ge=0, le=0.25)] | None = None
    tolerance_abs: Annotated[float, Meta(ge=0, le=0.1)] | None = None
    tolerance_linear_m_s: Annotated[float, Meta(ge=0, le=0.1)] | None = None
    tolerance_angular_rad_s: Annotated[float, Meta(ge=0, le=0.2)] | None = None
    noise: Noise | None = None
    odometry_hz: Positive | None = None
    time_scale: Positive | None = None
    clock_offset_s: Finite | None = None
    goal_m: Annotated[float, Meta(ge=0.01, le=0.5)] | None = None
    goal_rad: Annotated[float, Meta(ge=0.01, le=0.5)] | None = None
    goal_s: Annotated[float, Meta(ge=1, le=120)] | None = None
    plan_step_m: Annotated[float, Meta(ge=0.01, le=10)] | None = None

    def resolved(self) -> Limits:
        """What the robot is judged by."""
        declared = {name: figure for name, figure in msgspec.structs.asdict(self).items() if figure is not None}
        both = declared.pop("tolerance_abs", None)
        if both is not None:
            declared = {"tolerance_linear_m_s": both, "tolerance_angular_rad_s": both} | declared
        return Limits(
            **declared, linear_declared="linear_m_s" in declared, angular_declared="angular_rad_s" in declared
        )
