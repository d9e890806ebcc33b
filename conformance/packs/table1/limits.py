"""A robot's abilities and accuracy: declared values of its statement, and figures for judging it.

A figure is declared when the statement names it, whatever its value. What is not declared has a figure to drive the
robot by all the same (contract.md, the statement): the reference robot's limits halved, so that a slower one can
follow.
"""

import math
from typing import Annotated, Any, Final

import msgspec
from msgspec import Meta

from conformance.contract.toml_file import Finite, NotNegative
from conformance.measures.samples import FARTHEST

#: One limit for both directions, or the least and the greatest velocity, m/s or rad/s. It has no bounds of its own:
#: msgspec 0.22 reads them from the wrong place in a union with a tuple, and crashes.
Range = float | tuple[float, float]
#: A limit must be at least this multiple of tolerance plus noise. Otherwise a robot at rest could pass for one that
#: drives, and nothing that depends on reaching a velocity is judged (contract.md#judging-by-windows).
RESOLVED: Final = 4.0


# Indexes into Velocity.
_AHEAD, _ASIDE, _ANGULAR, _ABOUT = 0, 1, 3, 5
_PAIRS: Final = {
    "linear_m_s": ("linear_least_m_s", "linear_greatest_m_s"),
    "angular_rad_s": ("angular_least_rad_s", "angular_greatest_rad_s"),
}
_FURTHER: Final = (
    *(name for pair in _PAIRS.values() for name in pair),
    "lateral_m_s",
    "navigation_linear_m_s",
    "navigation_angular_rad_s",
)


def _range(limit: float, least: float | None = None, greatest: float | None = None) -> tuple[float, float]:
    return -limit if least is None else least, limit if greatest is None else greatest


class Noise(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How far the odometry of a robot at rest is off: the greatest figures that a statement may declare.

    Attributes:
        position_m: of its position, m.
        heading_rad: of its heading, rad.
        linear_m_s: of its linear velocity, m/s.
        angular_rad_s: of its angular velocity, rad/s.
    """

    position_m: Annotated[float, Meta(ge=0, le=0.05)] = 0.0
    heading_rad: Annotated[float, Meta(ge=0, le=0.05)] = 0.0
    linear_m_s: Annotated[float, Meta(ge=0, le=0.05)] = 0.0
    angular_rad_s: Annotated[float, Meta(ge=0, le=0.1)] = 0.0


class Limits(msgspec.Struct, frozen=True, kw_only=True):
    """The figures for judging, as in DeclaredLimits; defaults replace undeclared ones.

    Attributes:
        linear_least_m_s: least linear.x, m/s, if it is not ``-linear_m_s``; linear_greatest_m_s, angular_least_rad_s,
            angular_greatest_rad_s: likewise.
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
    linear_least_m_s: float | None = None
    linear_greatest_m_s: float | None = None
    angular_least_rad_s: float | None = None
    angular_greatest_rad_s: float | None = None
    lateral_m_s: float | None = None
    navigation_linear_m_s: float | None = None
    navigation_angular_rad_s: float | None = None
    linear_declared: bool
    angular_declared: bool

    def rest(self, component: int, sigmas: float = FARTHEST, factor: float = 1.0) -> float:
        """Return how far a component of a velocity (index into Velocity) may be off rest, m/s or rad/s.

        Args:
            component: index into Velocity.
            sigmas: how many times its noise.
            factor: how many times its tolerance.
        """
        if component < _ANGULAR:
            return factor * self.tolerance_linear_m_s + sigmas * self.noise.linear_m_s
        return factor * self.tolerance_angular_rad_s + sigmas * self.noise.angular_rad_s

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
        named = {name: getattr(self, name) for name in ("linear_m_s", "angular_rad_s", "settle_s", "hold_s", *_FURTHER)}
        return {name: figure for name, figure in named.items() if figure is not None}

    def range_of(self, component: int) -> tuple[float, float]:
        """Return the least and the greatest velocity of a component (index into Velocity), m/s or rad/s."""
        if component == _AHEAD:
            return _range(self.linear_m_s, self.linear_least_m_s, self.linear_greatest_m_s)
        if component == _ABOUT:
            return _range(self.angular_rad_s, self.angular_least_rad_s, self.angular_greatest_rad_s)
        if component == _ASIDE:
            return _range(self.linear_m_s if self.lateral_m_s is None else self.lateral_m_s)
        return _range(self.linear_m_s if component < _ANGULAR else self.angular_rad_s)

    @property
    def navigation_m_s(self) -> float:
        """The greatest speed at which the robot may ever be seen, commanded or not, m/s."""
        return max(self.linear_m_s, self.lateral_m_s or 0.0, self.navigation_linear_m_s or 0.0)

    @property
    def navigation_rad_s(self) -> float:
        """The greatest turning rate at which the robot may ever be seen, commanded or not, rad/s."""
        return max(self.angular_rad_s, self.navigation_angular_rad_s or 0.0)

    @property
    def unresolved_reason(self) -> str:
        """Why nothing that depends on reaching a velocity can be judged, or an empty text."""
        for limit, unit, tolerance, noise in (
            (self.linear_m_s, "m/s", self.tolerance_linear_m_s, self.noise.linear_m_s),
            (self.angular_rad_s, "rad/s", self.tolerance_angular_rad_s, self.noise.angular_rad_s),
        ):
            if 0 < limit < RESOLVED * (tolerance + noise):
                return (
                    f"the limit of {limit:g} {unit} is less than {RESOLVED:g} times the absolute tolerance plus noise, "
                    f"{tolerance + noise:g} {unit}: a robot at rest could pass for one that drives"
                )
        return ""

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
    """A robot's abilities and accuracy as its vendor declares them; None means not declared.

    The bounds are the contract's (contract.md#statement): by a wider tolerance a robot would be judged by nothing.

    Attributes:
        linear_m_s: greatest speed of linear.x, m/s; or the least and the greatest velocity: ``[0, 0.7]`` has no reverse
            gear.
        angular_rad_s: greatest turning rate, rad/s; or the least and the greatest one.
        lateral_m_s: greatest speed of linear.y, m/s, if it is not ``linear_m_s``.
        navigation_linear_m_s: greatest speed of the robot's own navigation, m/s, if it is not ``linear_m_s``.
        navigation_angular_rad_s: its greatest turning rate, rad/s, if it is not ``angular_rad_s``.
        settle_s: time within which a commanded velocity is reached, s.
        hold_s: time for which a velocity holds unless renewed, s; undeclared: not judged.
        tolerance: relative tolerance of a reached velocity.
        tolerance_abs: absolute tolerance of both parts of a velocity, m/s and rad/s, unless named by themselves.
        tolerance_linear_m_s: absolute tolerance of its linear part, m/s.
        tolerance_angular_rad_s: absolute tolerance of its angular part, rad/s.
        noise: of the odometry.
        odometry_hz: how often there is a new odometry, Hz; undeclared: seen by its stamps.
        time_scale: by how much the robot's clock is faster than the one on the wall.
        clock_offset_s: by how much the robot's clock is ahead of its ``Date`` header, s.
        goal_m: how far from a goal's position the robot may end the goal, m.
        goal_rad: how far from a goal's heading it may end the goal, rad.
        goal_s: how long a hindered robot may make no progress towards a goal, s.
        plan_step_m: the greatest distance between two successive poses of a plan, m.
    """

    linear_m_s: Range | None = None
    angular_rad_s: Range | None = None
    lateral_m_s: NotNegative | None = None
    navigation_linear_m_s: NotNegative | None = None
    navigation_angular_rad_s: NotNegative | None = None
    settle_s: Annotated[float, Meta(ge=0, le=5)] | None = None
    hold_s: Annotated[float, Meta(ge=0.2, le=10)] | None = None
    tolerance: Annotated[float, Meta(ge=0, le=0.25)] | None = None
    tolerance_abs: Annotated[float, Meta(ge=0, le=0.1)] | None = None
    tolerance_linear_m_s: Annotated[float, Meta(ge=0, le=0.1)] | None = None
    tolerance_angular_rad_s: Annotated[float, Meta(ge=0, le=0.2)] | None = None
    noise: Noise | None = None
    odometry_hz: Annotated[float, Meta(ge=2, le=1000)] | None = None
    time_scale: Annotated[float, Meta(ge=0.1, le=25)] | None = None
    clock_offset_s: Finite | None = None
    goal_m: Annotated[float, Meta(ge=0.01, le=0.5)] | None = None
    goal_rad: Annotated[float, Meta(ge=0.01, le=0.5)] | None = None
    goal_s: Annotated[float, Meta(ge=1, le=120)] | None = None
    plan_step_m: Annotated[float, Meta(ge=0.01, le=10)] | None = None

    def __post_init__(self) -> None:
        """Check the limits that may be pairs.

        Raises:
            ValueError: A limit is negative or not finite, or a pair does not hold rest.
        """
        for name in _PAIRS:
            limit = getattr(self, name)
            if isinstance(limit, tuple) and not (-math.inf < limit[0] <= 0 <= limit[1] < math.inf and any(limit)):
                raise ValueError(f"{name} = {list(limit)} must be the least velocity, at most 0, and the greatest")
            if isinstance(limit, float) and not 0 <= limit < math.inf:
                raise ValueError(f"{name} = {limit:g} must be a number, and not negative")

    @property
    def figures(self) -> dict[str, float]:
        """The declared limits by name, each a number, without the noise."""
        named = {name: figure for name, figure in msgspec.structs.asdict(self).items() if figure is not None}
        named.pop("noise", None)
        for name, (least, greatest) in _PAIRS.items():
            pair = named.get(name)
            if isinstance(pair, tuple):
                named |= {name: max(-pair[0], pair[1]), least: pair[0], greatest: pair[1]}
        return named

    def resolve(self) -> Limits:
        """Return the figures by which the robot is judged."""
        declared: dict[str, Any] = self.figures | ({"noise": self.noise} if self.noise else {})
        both = declared.pop("tolerance_abs", None)
        if both is not None:
            declared = {"tolerance_linear_m_s": both, "tolerance_angular_rad_s": both} | declared
        return Limits(
            **declared, linear_declared="linear_m_s" in declared, angular_declared="angular_rad_s" in declared
        )
