"""Judge every plan of a run, whichever check requests it: no path may jump aside to one pose and back.

The allowed step length depends on the request, so that other checks judge it.
"""

import itertools
from statistics import median
from typing import Final

from conformance.api.rest.interface import RestInterface
from conformance.packs.table1.robot.geometry import Pose
from conformance.packs.table1.robot.message_shapes import GET_PLAN, read_as
from conformance.packs.table1.robot.plan import plan_of
from conformance.packs.table1.robot.robot import PLAN
from conformance.transport.exchange import Exchange, Listener

# Shorter than this, m, or than so many of the path's own steps, is no leap.
_LEAP_M: Final = 1.0
_STEPS: Final = 4.0
# Whoever leaps aside and back is about where it was: of the leap.
_BACK: Final = 0.5
# Of fewer poses nobody knows the usual step.
_FEWEST: Final = 6


class PlanObserver(Listener):
    """Listens to all exchanges of one run and judges the plans in them.

    Args:
        api: the robot's REST interface.
    """

    def __init__(self, api: RestInterface) -> None:
        self._judge = api.run.judge
        self._url = api.client.url(f"{PLAN}?")

    def answered(self, exchange: Exchange) -> None:
        """Judge one exchange if it is a plan."""
        response = exchange.response
        if (
            exchange.request.method != "GET"
            or response.media_type != "application/json"
            or not exchange.request.url.startswith(self._url)
        ):
            return
        value, problem = read_as(response, GET_PLAN)
        if problem:
            return  # which others judge
        leap = longest_leap(plan_of(value).poses)
        self._judge.check(
            "rest-resources/plan-continuous",
            not leap,
            exchange,
            "a path that does not leap aside and back",
            found=f"a leap of {leap:.3f} m",
            cause="leaps",
        )


def longest_leap(poses: tuple[Pose, ...]) -> float:
    """Return how far a path jumps aside to one of its poses and back again, m; 0 where it does not."""
    if len(poses) < _FEWEST:
        return 0.0
    steps = [one.distance(two) for one, two in itertools.pairwise(poses)]
    least = max(_LEAP_M, _STEPS * median(steps))
    leaps = [
        min(there, back)
        for (there, back), before, after in zip(itertools.pairwise(steps), poses, poses[2:], strict=False)
        if min(there, back) > least and before.distance(after) < _BACK * min(there, back)
    ]
    return max(leaps, default=0.0)
