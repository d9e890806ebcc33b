"""Bring a robot to rest: before a check that needs it, and at the end of every run."""

import math
from http import HTTPStatus
from typing import Any, Final

from conformance.api.rest.interface import RestInterface
from conformance.documents.json_text import read_json
from conformance.observe.clock import WALL_CLOCK, Patience, poll
from conformance.packs.table1.robot.message_shapes import ODOMETRY, TWIST, body_of, read_as
from conformance.packs.table1.robot.robot import (
    ACCEPT_JSON,
    GOAL_PATH,
    JSON_BODY,
    POSE,
    STILL,
    VELOCITY,
    Robot,
    Velocity,
)
from conformance.packs.table1.statement import said_of
from conformance.scenarios.scenario import NotPossibleError
from conformance.transport.client import HttpClient
from conformance.transport.exchange import Exchange, NoAnswerError, Response
from conformance.transport.pace import Hangs, Pace

# How long a cancellation is repeated, s: a robot with a queue of missions starts the next one.
_CANCEL_S: Final = 3.0
_GRACE_S: Final = 1.5  # time beyond the settle time, for a loaded machine and a distant network, s
_STEP_S: Final = 0.02  # pause between two reads, s
# Pause between two readings that must both show rest, s.
_AGAIN_S: Final = 0.002
_LAST_TIMEOUT_S: Final = 0.7  # deadline of one request at the end of a run
_LAST_S: Final = 3.0  # time for all requests at the end of a run, s


def bring_to_rest(api: RestInterface) -> str:
    """Cancel the goal, command zero velocity, and wait until the robot stands still.

    Sends PUT and DELETE: only for checks that may move the robot. Never raises, whatever the robot responds.

    Returns:
        Empty when the robot is at rest (as far as it can be read), else why it is not.
    """
    if not api.run.allow_motion:
        return ""
    still = _Stiller(api.client, _slowest(api))
    limits = said_of(api.run).limits
    return still.bring(_CANCEL_S, limits.settle_s + _GRACE_S + 8 * api.run.effort.usual_ms / 1000)


def await_rest(api: RestInterface, *, settled: bool) -> None:
    """Bring a robot to rest; ``settled``: wait first for the settle time, so that earlier commands have begun.

    Raises:
        NotPossibleError: it does not come to rest.
    """
    begun_by = api.client.connection.acted_at + Robot(api).settle_s
    if settled:
        halt(api)
        WALL_CLOCK.sleep(begun_by - WALL_CLOCK.now())
    if reason := bring_to_rest(api):
        raise NotPossibleError(reason)


def halt(api: RestInterface) -> None:
    """Cancel the goal and command zero velocity, without waiting until the robot stands still.

    Used between checks that may start while the robot slows down; the others bring it to rest.
    """
    if api.run.allow_motion:
        _Stiller(api.client, _slowest(api)).halt(_CANCEL_S)


def leave_at_rest(api: RestInterface) -> str:
    """Stop the robot at the end of a run, even an interrupted one, and even if it hardly responds.

    Does nothing where no request could have moved the robot. Takes at most a few seconds; never raises.

    Returns:
        Why the robot may still move, or an empty text.
    """
    if not api.run.allow_motion:
        return ""
    try:
        # A client of its own: no checker judges its responses, and it calls an endpoint that hung before.
        timeout_s = min(_LAST_TIMEOUT_S + 3 * api.run.effort.usual_ms / 1000, api.client.connection.timeout_s)
        connection = api.client.connection.unheard(timeout_s=timeout_s, pace=Pace(math.inf), hangs=Hangs())
        client = HttpClient(api.client.base_url, connection)
        try:
            return _Stiller(client, _slowest(api)).bring(_LAST_S, _LAST_S)
        finally:
            client.close()
    except Exception as error:  # noqa: BLE001 - the run is over: what was found must be reported whatever happens here
        return str(error) or type(error).__name__


def _slowest(api: RestInterface) -> Velocity:
    """Return the highest velocity that counts as rest, twice the noise of a sample."""
    limits = said_of(api.run).limits
    return Velocity(*(limits.rest(component, sigmas=3) for component in range(len(STILL))))


def _shows(answer: Response) -> bool:
    """Return whether a response may contain a goal."""
    text = read_json(answer.body)
    return not text.unreadable and isinstance(text.value, dict) and bool(text.value)


class _Stiller:
    """Stops one robot.

    Args:
        client: the robot's REST interface.
        slowest: the highest velocity that counts as rest.
    """

    def __init__(self, client: HttpClient, slowest: Velocity) -> None:
        self._client = client
        self._slowest = slowest
        self._silent = ""

    def bring(self, cancel_s: float, settle_s: float) -> str:
        """Cancel, stop and wait; return the reason why the robot still moves, or an empty text."""
        return self.halt(cancel_s) or self._wait(self._patience(settle_s))

    def halt(self, cancel_s: float) -> str:
        """Cancel the goal within ``cancel_s`` and command zero; return why something is still active, or nothing."""
        cancelled = self._no_goal_left(self._patience(cancel_s))
        # Send it even if the goal could not be cancelled: a robot that takes velocities meanwhile stops for a moment.
        self._ask("PUT", VELOCITY, JSON_BODY, body_of(STILL.twist))
        return "" if cancelled else f"its goal is still active after {cancel_s:g} s of cancelling it"

    def _patience(self, seconds: float) -> Patience:
        return Patience(self._client.connection.pace, seconds)

    def _no_goal_left(self, patience: Patience) -> bool:
        for _ in poll(WALL_CLOCK, 0.0, lambda: patience.over):
            cancelled = self._ask("DELETE", GOAL_PATH)
            if cancelled is not None and cancelled.response.status == HTTPStatus.NOT_FOUND:
                return True
            current = self._ask("GET", GOAL_PATH, ACCEPT_JSON)
            # No readable goal: the robot has none, lacks the resource, or gives no information. Its velocity shows
            # whether it moves.
            if current is None or not current.response.ok or not _shows(current.response):
                return True
            if cancelled is None or not cancelled.response.ok:
                WALL_CLOCK.sleep(_STEP_S)
        return False

    def _wait(self, patience: Patience) -> str:
        rested = False
        for _ in poll(WALL_CLOCK, _AGAIN_S, lambda: patience.over):
            velocity, problem = self._velocity()
            if problem:
                return problem
            rests = all(abs(one) <= most for one, most in zip(velocity, self._slowest, strict=True))
            if rests and rested:
                return ""
            if not rests:
                WALL_CLOCK.sleep(_STEP_S)
            rested = rests
        return f"it still moves: {velocity}"

    def _velocity(self) -> tuple[Velocity, str]:
        """Return the measured velocity, and why it cannot be read."""
        read = self._ask("GET", VELOCITY, ACCEPT_JSON)
        if read is not None and read.response.status == HTTPStatus.NOT_FOUND:
            return STILL, ""  # a robot without this resource: nothing shows that it moves
        twist: Any
        odometry: Any
        twist, problem = read_as(read.response, TWIST) if read else (None, self._silent)
        if problem:
            # The odometry may show motion where the velocity resource does not.
            read = self._ask("GET", POSE, ACCEPT_JSON)
            odometry, unread = read_as(read.response, ODOMETRY) if read else (None, self._silent)
            if unread:
                return STILL, f"its velocity cannot be read: {problem}"
            twist = odometry["twist"]["twist"]
        return Velocity.of(twist), ""

    def _ask(
        self, method: str, path: str, headers: tuple[tuple[str, str], ...] = (), body: bytes = b""
    ) -> Exchange | None:
        try:
            return self._client.send(method, path, headers=headers, body=body)
        except NoAnswerError as none:
            self._silent = f"no answer to {method} {path}: {none}"
            return None
