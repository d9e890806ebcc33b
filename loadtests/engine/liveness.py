"""When a robot counts as dead: no request has succeeded for seconds, although many were sent."""

_DEAD_S = 3.0
_DEAD_REQUESTS = 10
_LOOK_S = 0.5


class Liveness:
    """Decides by the counts of a run whether the robot is dead.

    Args:
        report_s: how late the counts may be, in seconds: workers report once a second.
    """

    def __init__(self, report_s: float) -> None:
        self._silence_s = _DEAD_S + report_s
        self._looked_s = 0.0
        self._alive = (0.0, 0, 0)  # when something had last succeeded; successes and failures until then

    def is_due(self, elapsed_s: float) -> bool:
        """Return whether the next count is due; counting costs the load generator time."""
        return elapsed_s - self._looked_s >= _LOOK_S

    def dead_since(self, elapsed_s: float, succeeded: int, failed: int) -> float | None:
        """Return since when the robot has been silent, in seconds from the start; None unless that is long enough."""
        self._looked_s = elapsed_s
        since, before, failed_before = self._alive
        if succeeded > before or failed - failed_before < _DEAD_REQUESTS:
            self._alive = (elapsed_s, succeeded, failed if succeeded > before else failed_before)
            return None
        return since if elapsed_s - since > self._silence_s else None
