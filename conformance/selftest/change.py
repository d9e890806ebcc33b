"""What may happen to an exchange between a client and the robot: the one thing that makes a mutant."""

from collections.abc import Callable
from typing import Protocol

from conformance.selftest.messages import Request, Response

Forward = Callable[[Request], Response]


class HangUpError(Exception):
    """The connection is closed without a response."""


class Change(Protocol):
    """What a proxy does to exchanges; one instance for one run, so it may remember."""

    def __call__(self, request: Request, forward: Forward) -> Response:
        """Respond to a request; ``forward`` asks the robot, as often as one likes.

        Raises:
            HangUpError: there is to be no response.
        """


class IncompleteRequest(Protocol):
    """What a mutant does with a request that was never completed."""

    def __call__(self, side: str, octets: bytes, forward: Forward) -> None:
        """Take what had come when the client went away."""


def unchanged(request: Request, forward: Forward) -> Response:
    """The change that changes nothing."""
    return forward(request)
