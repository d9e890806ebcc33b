"""The base class of the REST and SOAP interfaces: access check, response, and errors without tracebacks."""

import asyncio
import logging
from abc import ABC, abstractmethod
from collections.abc import Awaitable, Callable, Coroutine
from functools import partial
from typing import Any, Final

from reference_robot.webservices.http.access import SAFE, Admission, Scope
from reference_robot.webservices.http.messages import Request, Response, content, problem_format
from reference_robot.webservices.representation.problems import Problem

_LOGGER: Final = logging.getLogger(__name__)


class Interface(ABC):
    """An interface that answers the requests to one port; subclasses implement ``answer`` and ``scope``.

    Attributes:
        lag: How much later each request is answered, s.
    """

    lag = 0.0

    def __init__(self, admission: Admission) -> None:
        self._admission = admission

    @property
    def is_guarded(self) -> bool:
        """Whether requests need a token."""
        return self._admission.is_guarded

    @abstractmethod
    def answer(self, request: Request) -> Response | Awaitable[Response]:
        """Return the response or an awaitable of it; a raised Problem becomes the response."""

    def admit(self, request: Request) -> None:
        """Raise a Problem if the head of a request fails the access check."""
        self._admission.check(request, self.scope_for)

    @abstractmethod
    def scope(self, request: Request) -> Scope:
        """Return the token scope that a request which changes something needs."""

    def scope_for(self, request: Request) -> Scope | None:
        """Return the token scope that a request needs; None if any valid token is sufficient."""
        if request.method in SAFE:
            return None if request.method == "OPTIONS" else Scope.READ
        return self.scope(request)

    def respond(self, request: Request) -> Response | Coroutine[Any, Any, Response]:
        """Return the response to an admitted request, or a coroutine if ROS must be waited for; never raises."""
        if self.lag:
            return self._later(request)
        return self._respond(request)

    async def _later(self, request: Request) -> Response:
        await asyncio.sleep(self.lag)
        outcome = self._respond(request)
        return outcome if isinstance(outcome, Response) else await outcome

    def _respond(self, request: Request) -> Response | Coroutine[Any, Any, Response]:
        try:
            outcome = self.answer(request)
        except Exception as error:  # noqa: BLE001 - after any error the client gets a response
            return _error_response(request, error)
        return outcome if isinstance(outcome, Response) else await_response(outcome, partial(_error_response, request))


async def await_response(outcome: Awaitable[Response], failed: Callable[[Exception], Response]) -> Response:
    """Return the awaited response, or the response that ``failed`` returns for an error."""
    try:
        return await outcome
    except Exception as error:  # noqa: BLE001 - after any error the client gets a response
        return failed(error)


def _error_response(request: Request, error: Exception) -> Response:
    if isinstance(error, Problem):
        return problem_response(error, request.headers.get(b"accept"))
    _LOGGER.error("cannot respond to %s %r", request.method, request.path[:200], exc_info=error)
    return problem_response(Problem(500, "an internal error of the robot; the robot's log has the details"), None)


def problem_response(problem: Problem, accept: bytes | None) -> Response:
    """Return a problem as a response, in the format that the client prefers (RFC 9457 3)."""
    media_type = problem_format(accept)
    return content(problem.status, media_type, problem.serialize(media_type), (*problem.headers, (b"vary", b"accept")))
