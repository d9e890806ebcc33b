"""Renew a velocity at a steady pace beside other requests, where a look takes too long to renew between two of them.

Over a slow link a robot with a short hold time, the safer choice, stops before the next request arrives that is sent
after the response to the last one. So the renewals do not wait for each other.
"""

import math
import threading
from dataclasses import replace
from types import TracebackType
from typing import Final, Self

from conformance.packs.table1.robot.drive_trace import Command
from conformance.packs.table1.robot.letting_go import certain_s
from conformance.packs.table1.robot.robot import ACCEPT_JSON, LINEAR, VELOCITY, Robot
from conformance.transport.exchange import NoAnswerError
from conformance.transport.parallel import MOST_CLIENTS

# Of the hold time: between two renewals. They are no closer than that, s.
_EVERY: Final = 0.25
_CLOSEST_S: Final = 0.05
# Of the usual response time: so long a renewal is taken to be under way, and longer where others keep it waiting.
_UNDER_WAY: Final = 1.5


def renewed(robot: Robot, command: Command) -> Command:
    """Send a command again as it was sent, as another resource or format could hide a fault of this one.

    Raises:
        NoAnswerError: there is no response.
    """
    request, sent = command.exchange.request, robot.clock.now()
    path = LINEAR if command.linear_only else VELOCITY
    headers = (("Content-Type", request.media_type), *ACCEPT_JSON)
    exchange = robot.rest.send("PUT", path, headers=headers, body=request.body)
    return replace(command, sent=sent, answered=robot.clock.now(), exchange=exchange, renewal=True)


class Renewing:
    """Renews a command while the context is open; every renewal has been answered when it is closed.

    Args:
        robot: the robot, which declares a hold time.
        command: the command.

    Attributes:
        commands: the renewals that were answered.
    """

    def __init__(self, robot: Robot, command: Command) -> None:
        self.commands: list[Command] = []
        self._robot, self._command = robot, command
        self._hold_s = robot.limits.hold_s or math.inf
        self._every_s = max(_CLOSEST_S, _EVERY * self._hold_s)
        number = min(MOST_CLIENTS, 1 + math.ceil(_UNDER_WAY * robot.usual_s / self._every_s))
        self._begun, self._over = robot.clock.now(), threading.Event()
        self._threads = [threading.Thread(target=self._renew, args=(one, number)) for one in range(number)]

    def __enter__(self) -> Self:
        try:
            for one in self._threads:
                one.start()
        except BaseException:
            self._over.set()  # nothing else would end those that have begun
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._over.set()
        for one in self._threads:
            one.join()
        self.commands.sort(key=lambda one: one.sent)
        connection = self._robot.rest.connection
        connection.sent += len(self.commands)
        connection.note("PUT")
        # Not while they are sent: to judge takes time, and the next one has its moment.
        for command in self.commands:
            for listener in connection.listeners:
                listener.answered(command.exchange)

    @property
    def is_crowded(self) -> bool:
        """Return whether the robot answers so many requests at once more slowly than one after another."""
        took = sorted(one.exchange.response.elapsed_ms / 1000 for one in self.commands)
        return bool(took) and took[len(took) // 2] > _UNDER_WAY * self._robot.usual_s

    def lasted(self, until: float, since: float = 0.0) -> bool:
        """Return whether each renewal certainly arrived before the hold time of those before it was over.

        Args:
            until: the time of the last reading that counts, s of the run's clock.
            since: the time of the first one; a renewal that came too late before it does not matter.
        """
        certain = self._command.sent + certain_s(self._hold_s)
        for one in sorted(self.commands, key=lambda one: one.answered):
            if one.answered > max(certain, since):
                break
            certain = max(certain, one.sent + certain_s(self._hold_s))
        return certain >= until

    def _renew(self, first: int, number: int) -> None:
        """Send every ``number``-th renewal, on a connection of its own."""
        robot, last = self._robot.apart(), self._command
        turn = 1 + first
        try:
            while not self._over.wait(max(0.0, self._begun + turn * self._every_s - robot.clock.now())):
                try:
                    self.commands.append(renewed(robot, last))
                except NoAnswerError:
                    return
                late = math.ceil((robot.clock.now() - self._begun) / self._every_s - turn)
                turn += number * max(1, math.ceil(late / number))
        finally:
            robot.rest.close()
