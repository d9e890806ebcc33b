"""The ASGI side of an interface: time it, ask for the token, answer, and never show a traceback."""

import logging
from abc import ABC, abstractmethod
from collections.abc import Awaitable
from time import perf_counter
from typing import Any, Final

from reference_robot.webservices.http.authorization import Authorization
from reference_robot.webservices.http.messages import (
    ClientVanishedError,
    Message,
    Receive,
    Request,
    Response,
    Send,
    content,
)
from reference_robot.webservices.http.negotiation import problem_format
from reference_robot.webservices.representation.problems import Problem

_LOGGER: Final = logging.getLogger(__name__)


class Interface(ABC):
    """An ASGI application whose subclasses turn a request into an answer.

    Every answer carries ``Server-Timing: app;dur=MS``: the time from the complete head of the request to the answer,
    in milliseconds (W3C Server Timing), by which a load test tells the robot's part from the network's.
    """

    def __init__(self, authorization: Authorization) -> None:
        self._authorization = authorization

    @abstractmethod
    def answer(self, request: Request) -> Response | Awaitable[Response]:
        """Return the answer, at once or awaited; a Problem that it raises becomes the answer."""

    def never_waits(self, _scope: Message) -> bool:
        """Tell whether this request is answered without waiting for anything: its content, ROS, another task."""
        return False

    async def __call__(self, scope: Message, receive: Receive, send: Send) -> None:
        """Serve one request (ASGI 3)."""
        started = perf_counter()
        try:
            request = Request(scope, receive)
            self._authorization.check(request.headers)
            outcome: Any = self.answer(request)
            response: Response = outcome if outcome.__class__ is Response else await outcome
        except Problem as problem:
            response = described(problem, dict(scope["headers"]).get(b"accept"))
        except ClientVanishedError:
            return
        except Exception:
            _LOGGER.exception("no answer to %s %s", scope["method"], scope["path"])
            response = described(Problem(500, "the robot failed to answer; its log says why"), None)
        timing = b"app;dur=%.3f" % ((perf_counter() - started) * 1000)
        await send(
            {
                "type": "http.response.start",
                "status": response.status,
                "headers": [*response.headers, (b"server-timing", timing)],
            }
        )
        await send({"type": "http.response.body", "body": response.body})


def described(problem: Problem, accept: bytes | None) -> Response:
    """Return a problem as an answer, in the format that the client likes better (RFC 9457 3)."""
    media_type = problem_format(accept)
    return content(problem.status, media_type, problem.written(media_type), (*problem.headers, (b"vary", b"accept")))
