"""An interface: see who is let in, answer, and never show a traceback."""

import logging
from abc import ABC, abstractmethod
from collections.abc import Awaitable, Coroutine
from typing import Any, Final

from reference_robot.webservices.http.admission import SAFE, Admission
from reference_robot.webservices.http.authorization import Scope
from reference_robot.webservices.http.messages import Request, Response, content
from reference_robot.webservices.http.negotiation import problem_format
from reference_robot.webservices.representation.problems import Problem

_LOGGER: Final = logging.getLogger(__name__)


class Interface(ABC):
    """What answers the requests of one port; subclasses turn a request into an answer."""

    def __init__(self, admission: Admission) -> None:
        self._admission = admission

    @abstractmethod
    def answer(self, request: Request) -> Response | Awaitable[Response]:
        """Return the answer, at once or awaited; a Problem that it raises becomes the answer."""

    def admit(self, request: Request) -> None:
        """Raise a Problem for a request whose head already says that it is not answered."""
        self._admission.check(request, self)

    @abstractmethod
    def scope(self, request: Request) -> Scope:
        """Return what a token must be good for to change something by this request."""

    def needed(self, request: Request) -> Scope | None:
        """Return what a token must be good for; None where any will do."""
        if request.method in SAFE:
            return None if request.method == "OPTIONS" else Scope.READ
        return self.scope(request)

    def respond(self, request: Request) -> Response | Coroutine[Any, Any, Response]:
        """Return the answer to an admitted request: at once, unless something has to be waited for; never raises."""
        try:
            outcome = self.answer(request)
        except Exception as error:  # noqa: BLE001 - whatever went wrong, the client gets an answer
            return _failed(request, error)
        return outcome if isinstance(outcome, Response) else _awaited(request, outcome)


async def _awaited(request: Request, outcome: Awaitable[Response]) -> Response:
    try:
        return await outcome
    except Exception as error:  # noqa: BLE001 - as above
        return _failed(request, error)


def _failed(request: Request, error: Exception) -> Response:
    if isinstance(error, Problem):
        return described(error, request.headers.get(b"accept"))
    _LOGGER.error("no answer to %s %r", request.method, request.path[:200], exc_info=error)
    return described(Problem(500, "the robot failed to answer; its log says why"), None)


def described(problem: Problem, accept: bytes | None) -> Response:
    """Return a problem as an answer, in the format that the client likes better (RFC 9457 3)."""
    media_type = problem_format(accept)
    return content(problem.status, media_type, problem.written(media_type), (*problem.headers, (b"vary", b"accept")))
