"""The turns of HTTP connections: a client with many requests at once does not keep the robot from others.

The parser does not stop between the requests of one segment, and a segment may hold more than a thousand. So only the
first request is parsed at once. The rest waits in the port's queue, and reading pauses meanwhile.
"""

from abc import abstractmethod
from typing import Final

from reference_robot.webservices.http.answering import AnsweringConnection
from reference_robot.webservices.http.messages import BODY_LIMIT
from reference_robot.webservices.http.port import Port
from reference_robot.webservices.http.reading import full
from reference_robot.webservices.representation.problems import Problem

DRAINED: Final = 16 * BODY_LIMIT  # bytes that are dropped after a refusal, before the connection is closed
_HEAD_END: Final = b"\r\n\r\n"
_AT_ONCE: Final = 4  # postponed requests of one client that are parsed in its turn


class PacedConnection(AnsweringConnection):
    """A connection that takes turns with others; a subclass parses the requests."""

    __slots__ = ("_dropped", "_postponed")

    def __init__(self, port: Port) -> None:
        super().__init__(port)
        self._postponed = b""
        self._dropped = 0  # bytes that came after a refusal

    @abstractmethod
    def _take(self, data: bytes) -> None:
        """Parse received bytes."""

    @abstractmethod
    def _refuse(self, problem: Problem) -> None:
        """Answer bytes that are not a valid request with an error, and read nothing more."""

    def eof_received(self) -> bool:
        """Return whether the connection stays open for pending responses."""
        return super().eof_received() or (bool(self._postponed) and self._transport.can_write_eof())

    def data_received(self, data: bytes) -> None:
        """Take received bytes; postpone those after the first request."""
        if self._leaving:
            self._dropped += len(data)
            if self._dropped > DRAINED:
                self.give_way()
            return
        if self._postponed:
            self._postpone(self._postponed + data)
        elif data.count(_HEAD_END) > 1:
            self._take_some(data, 1)
        else:
            self._take(data)

    def _take_some(self, data: bytes, most: int) -> None:
        """Feed the first requests of many; other clients get their turn before the rest.

        Reading pauses meanwhile, so that a client cannot occupy the robot with many requests in one segment.
        """
        end = 0
        for _ in range(most):
            end = data.find(_HEAD_END, end) + len(_HEAD_END)
            if end < len(_HEAD_END):
                end = len(data)
                break
        self._take(data[:end])
        if end < len(data) and not self._leaving:
            self._postpone(data[end:])
            self._port.postpone(self._take_postponed)

    def _postpone(self, data: bytes) -> None:
        self._hold(len(data) - len(self._postponed))
        self._postponed = data
        if self._port.is_full_for(len(data)):
            self._refuse(full())
        else:
            self._transport.pause_reading()

    def _take_postponed(self) -> None:
        data, self._postponed = self._postponed, b""
        if self._leaving:
            return
        self._hold(-len(data))
        self._take_some(data, _AT_ONCE)
        if self._postponed or self._leaving:
            return
        if self._reading:
            self._transport.resume_reading()
        self._advance()
