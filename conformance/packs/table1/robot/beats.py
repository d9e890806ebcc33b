"""Read the robot's state between the checks of a run, a little each time, for checkers of every reading.

A fault that comes only after a certain kind of request is found only if somebody reads the state after each kind.
"""

import random
from itertools import cycle
from typing import Final

from conformance.api.interfaces import Interfaces
from conformance.api.rest.calls import XML
from conformance.api.rest.interface import RestInterface
from conformance.contract.classes import Interface
from conformance.observe.clock import WALL_CLOCK
from conformance.packs.table1.plugin import Device
from conformance.packs.table1.robot.geometry import Pose, pose_of
from conformance.packs.table1.robot.message_shapes import ODOMETRY, read_as
from conformance.packs.table1.robot.plan import query
from conformance.packs.table1.robot.robot import (
    ACCEPT_JSON,
    DELIVERIES,
    GOAL_PATH,
    LINEAR,
    PLAN,
    POSE,
    SENSORS,
    SERVICES,
    VELOCITY,
)
from conformance.packs.table1.robot.soap_services import ask
from conformance.packs.table1.statement import said_of

# At quick effort, one beat after this many checks.
_EVERY: Final = 2
# An odd reading is repeated after this time, s, because one interface may lag.
_AGAIN_S: Final = 0.3
# Distance from the robot's first place to the goals of plans, m.
_AWAY_M: Final = 0.5
#: By beat: what it reads, as JSON or XML paths and SOAP operations.
_BEATS: Final = (
    (GOAL_PATH, "GetGoal", GOAL_PATH),
    (GOAL_PATH, f"{XML} {GOAL_PATH}", GOAL_PATH),
    (VELOCITY, "GetVelocity", VELOCITY),
    (VELOCITY, f"{XML} {VELOCITY}", VELOCITY, LINEAR),
    (POSE, "GetPose", POSE),
    (POSE, f"{XML} {POSE}", POSE),
    (POSE, PLAN, POSE),
    (POSE, "GetPlan", POSE),
    (f"{PLAN}?start",),
    (SENSORS, "GetSensors", SENSORS),
    (SERVICES, "GetNavigationServices", SERVICES),
    (f"{XML} {DELIVERIES}", DELIVERIES),
)
_GONE: Final = frozenset({403, 404, 405, 501})


class Beats:
    """Reads the state after each check, in an order that follows from the run's seed.

    Args:
        api: the robot's REST interface.
        interfaces: all of them.
    """

    def __init__(self, api: RestInterface, interfaces: Interfaces) -> None:
        run = api.run
        self._rest, self._run = api.client, run
        self._doubting = api.device.doubting if isinstance(api.device, Device) else ()
        self._soap = interfaces.soap.subscribers
        if "soap-subscribers" not in run.claims or Interface.SUBSCRIBERS in run.unreachable:
            self._soap = None
        beats = [beat for beat in _BEATS if all(map(self._is_claimed, beat))]
        random.Random(f"{run.seed}/beats").shuffle(beats)  # noqa: S311 - no secret
        self._beats = cycle(beats)
        self._count, self._sent = 0, api.client.connection.sent
        self._gone: set[str] = set()
        frame = said_of(run).motion.frame
        self._frame: dict[str, str] = {} if frame == "map" else {"frame_id": frame}
        # Goals of plans, and starts of some, in the frame of goals.
        self._places: tuple[Pose, Pose] | None = None

    def _is_claimed(self, what: str) -> bool:
        if what.startswith("Get"):
            return self._soap is not None
        path = what.removeprefix(f"{XML} ").partition("?")[0]
        claimed = {"rest-resources", "rest-delivery" if path == DELIVERIES else "rest-resources"}
        claimed |= {"rest-formats"} if what.startswith(XML) else set()
        return claimed <= set(self._run.claims)

    def beat(self) -> None:
        """Read a little, if a request was sent since the last time; more if the last reading was odd.

        Raises:
            NoAnswerError: no HTTP response came.
        """
        connection, effort = self._rest.connection, self._run.effort
        if connection.sent == self._sent or connection.request_rate or effort.slow:
            return
        self._count += 1
        if effort.name != "quick" or self._count % _EVERY == 0:
            beat, acted = next(self._beats, ()), connection.acted_at
            self._read(beat)
            if any(one.suspects for one in self._doubting):
                WALL_CLOCK.sleep(_AGAIN_S)
                self._read((*beat, VELOCITY))
            connection.acted_at = acted  # a beat only reads, so nobody has to wait for its effects
        self._sent = connection.sent

    def _read(self, beat: tuple[str, ...]) -> None:
        for what in beat:
            if what not in self._gone and self._send(what) in _GONE and what.split(" ")[-1] != GOAL_PATH:
                self._gone.add(what)

    def _send(self, what: str) -> int:
        """Send one request; return the status of its response, or 0."""
        there = None if self._places is None else {"x": self._places[0].x, "y": self._places[0].y}
        if what.startswith("Get"):
            if self._soap is not None and (what != "GetPlan" or there):
                parameters: dict[str, float | str] = {**there, **self._frame} if what == "GetPlan" and there else {}
                ask(self._soap, what, **parameters)
            return 0
        path, fields = what.removeprefix(f"{XML} "), (("Accept", XML),) if what.startswith(XML) else ACCEPT_JSON
        if path.startswith(PLAN):
            if self._places is None or there is None:
                return 0
            start = self._places[1]
            given = {"start_x": start.x, "start_y": start.y} if path != PLAN else {}
            path = query(**there, **given, **self._frame)
        if self._rest.refusal("GET", path):
            return 0
        exchange = self._rest.send("GET", path, headers=fields)
        if path == POSE and self._places is None:
            message, problem = read_as(exchange.response, ODOMETRY)
            if not problem:
                here = pose_of(message["pose"]["pose"]).seen_from(Pose(*said_of(self._run).motion.odom_to_map))
                self._places = here.ahead(_AWAY_M), here
        return exchange.response.status
