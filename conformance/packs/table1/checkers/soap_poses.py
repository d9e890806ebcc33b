"""Judge every pose of a run that is read over SOAP, whichever check requests it."""

from collections.abc import Callable, Iterator
from typing import Any, Final

from conformance.documents.representation import projected
from conformance.packs.table1.robot.agreement import stamp_of
from conformance.packs.table1.robot.message_shapes import ODOMETRY, read_as
from conformance.packs.table1.robot.robot import POSE
from conformance.packs.table1.robot.state_over_soap import contradiction, value_in
from conformance.transport.exchange import Attempt, Exchange
from conformance.verdict.evidence import Case, case

# How far one of the robot's processes may lag behind another, s.
_BACK_S: Final = 1.0
# How often a clock must go back: a single time, somebody may have set it.
_SEVERAL: Final = 2


class SoapPoses:
    """Judges the poses over SOAP in all exchanges of one run.

    Their stamps do not run backwards, and a message between two equal ones over REST with its stamp is the same
    message.

    Args:
        url: returns the URL of a path.
    """

    def __init__(self, url: Callable[[str], str]) -> None:
        self._url = url(POSE)
        self._last: tuple[float, float] = (0.0, 0.0)
        self._last_received_s = 0.0
        self._backwards = 0
        self._before: Any = None
        self._between: list[tuple[Any, Exchange]] = []

    def __call__(self, attempt: Attempt) -> Iterator[Case]:
        """Take one exchange of the run; only poses count."""
        if not isinstance(attempt, Exchange):
            return
        request, response = attempt.request, attempt.response
        if request.method == "GET" and request.url == self._url and response.media_type == "application/json":
            yield from self._over_rest(attempt)
        elif request.method == "POST" and response.ok and b"GetPoseResponse" in response.body:
            value, problem = value_in(attempt, ODOMETRY)
            if not problem and not ODOMETRY.problem(value):
                yield from self._in_order(value, attempt)
                self._between.append((value, attempt))

    def _over_rest(self, exchange: Exchange) -> Iterator[Case]:
        value, problem = read_as(exchange.response, ODOMETRY)
        if problem:
            return
        after, between, self._between = projected(value, ODOMETRY.schema), self._between, []
        for message, one in between if self._before is not None else ():
            found = contradiction(message, self._before, after)
            yield case(
                "equivalence/pose",
                not found,
                one,
                f"the message with this stamp, as GET {POSE} gives it just before and after",
                found=found,
                cause="another message",
            )
        self._before = after

    def _in_order(self, message: Any, exchange: Exchange) -> Iterator[Case]:
        response, stamp = exchange.response, stamp_of(message)
        if response.received_s - response.elapsed_ms / 1000 >= self._last_received_s:
            back_s = self._last[0] - stamp[0] + (self._last[1] - stamp[1]) / 1e9
            self._backwards += back_s > _BACK_S
            yield case(
                "equivalence/pose",
                back_s <= _BACK_S or self._backwards < _SEVERAL,
                exchange,
                "stamps that do not run backwards, as in REST's responses",
                found=f"a stamp {back_s:.3f} s earlier than in the previous response; {self._backwards} times so far",
                cause="stamp",
            )
        self._last = stamp
        self._last_received_s = max(self._last_received_s, response.received_s)
