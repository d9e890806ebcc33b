"""By how much another machine's clock may differ from ours."""

from typing import NamedTuple


class Offset(NamedTuple):
    """Bounds on the robot's clock less ours, in s."""

    low_s: float
    high_s: float

    @property
    def middle_s(self) -> float:
        """Return the middle."""
        return (self.low_s + self.high_s) / 2

    @property
    def error_s(self) -> float:
        """Return by how much the middle may be wrong."""
        return (self.high_s - self.low_s) / 2


SHARED = Offset(0.0, 0.0)
