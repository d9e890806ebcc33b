"""A stretch of a plan: who calls what in it, and when."""

from dataclasses import dataclass

GAP_S = 0.010
_NS = 1_000_000_000


@dataclass(frozen=True, slots=True)
class Segment:
    """A stretch of time in which one client calls one interface.

    Attributes:
        start_ns, end_ns: offsets from the run's start.
        phase: `warmup`, `duel`, `aa`, `against` (the comparison's blocks of the other robot) or `step`.
        label: in phase `aa` the name that the interface goes by, `a` or `b`.
        pair: neighbours that are compared with one another share a number.
        rate: arrivals per second over all workers; 0 in the closed model.
        robot: 0, or 1 for the robot that it is compared with.
        gap: whether it begins with a gap in which no request starts.
    """

    start_ns: int
    end_ns: int
    phase: str
    interface: str
    client: str
    label: str
    pair: int
    rate: float
    robot: int = 0
    gap: bool = True

    @property
    def opens_ns(self) -> int:
        """Return the offset at which its requests may start: after the quiet gap, if it has one."""
        return self.start_ns + self.gap * min(int(GAP_S * _NS), (self.end_ns - self.start_ns) // 8)

    @property
    def active_s(self) -> float:
        """Return for how long its requests may start."""
        return (self.end_ns - self.opens_ns) / _NS
