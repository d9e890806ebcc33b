"""Cold and warm: measure how long a request takes after a pause, and directly after another request.

An idle robot loses its caches, and its processor its clock rate; a figure from an even stream of requests lies between
cold and warm. Here one connection of one series at a time is idle for a tenth of a second, sends one request, and then
sends others without a pause. The load generator is idle as well: that cost is in the cold figure of both interfaces.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import gevent
import numpy as np

from loadtests.clients.failures import CallError
from loadtests.clients.robot import Robot
from loadtests.clients.wire import Connection, now_ns
from loadtests.schedule.plan import SeriesName
from loadtests.statistics.histogram import Histogram

PAUSE_S = 0.1
_BEHIND = 10  # requests right behind one another, after the one that follows the pause
_FEWEST, _MOST = 6, 50
#: Share of the duel's time that the pauses may take.
_SHARE = 0.2


@dataclass
class Paused:
    """A series' service times after a pause, and directly after another request.

    Attributes:
        spacing_s: the least time between two requests, where the rate is limited.
        failed: requests without a good response.
    """

    spacing_s: float
    cold: Histogram = field(default_factory=Histogram)
    warm: Histogram = field(default_factory=Histogram)
    failed: int = 0


def after_pauses(
    robot: Robot,
    names: list[SeriesName],
    seed: int,
    duration_s: float,
    ceiling: float | None,
    stopped: Callable[[], bool],
) -> dict[SeriesName, Paused]:
    """Measure the wire series after pauses and without, alternately; empty where the run is too short for that.

    `ceiling` is the highest rate allowed, in requests per second.
    """
    names = [name for name in names if name[2] == "wire" and name[1] in {"rest", "soap"}]
    turns = min(_MOST, int(_SHARE * duration_s / (PAUSE_S * 1.1) / max(1, len(names))))
    if turns < _FEWEST:
        return {}
    spacing = 1 / ceiling if ceiling else 0.0
    found = {name: Paused(spacing) for name in names}
    connections = {name: robot.http(name[1], name[0]) for name in names}
    rng = np.random.default_rng([seed, 8])
    try:
        for turn in range(turns):
            for index in rng.permutation(len(names)).tolist():
                if stopped():
                    return found
                name = names[index]
                _one_turn(robot, name, connections[name], seed + turn, found[name], first=turn == 0)
    finally:
        for connection in connections.values():
            connection.close()
    return found


def _one_turn(
    robot: Robot, name: SeriesName, connection: Connection, turn: int, paused: Paused, *, first: bool
) -> None:
    """Pause, then send several requests without a pause; the first turn only opens the connection."""
    requests = robot.requests(name[1], name[0], turn)
    gevent.sleep(max(PAUSE_S, paused.spacing_s))
    for number in range(_BEHIND + 1):
        request = requests[number % len(requests)]
        start = now_ns()
        try:
            answer = connection.call(request)
            took = np.array([now_ns() - start])
            answer.require_good(request.expects)
        except CallError:
            paused.failed += 1
            return
        if not first:
            (paused.warm if number else paused.cold).record(took)
        if paused.spacing_s:
            gevent.sleep(max(0.0, paused.spacing_s - (now_ns() - start) / 1e9))
