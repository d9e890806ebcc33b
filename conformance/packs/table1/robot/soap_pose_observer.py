"""Judge every pose of a run that is read over SOAP, whichever check requests it."""

from typing import Any, Final

from conformance.api.rest.interface import RestInterface
from conformance.documents.representation import projected
from conformance.packs.table1.robot.agreement import stamp_of
from conformance.packs.table1.robot.message_shapes import ODOMETRY, read_as
from conformance.packs.table1.robot.robot import POSE
from conformance.packs.table1.robot.state_over_soap import answered, contradiction
from conformance.transport.exchange import Exchange, Listener

# Whoever answers may have a sample that another one of the robot's processes has not yet, s.
_BACK_S: Final = 1.0
# Once, a clock may have been put back.
_SEVERAL: Final = 2


class SoapPoseObserver(Listener):
    """Listens to all exchanges of one run and judges the poses over SOAP.

    Their stamps do not run backwards, and a message between two equal ones over REST with its stamp is the same
    message.

    Args:
        api: the robot's REST interface.
    """

    def __init__(self, api: RestInterface) -> None:
        self._judge = api.run.judge
        self._url = api.client.url(POSE)
        self._last: tuple[float, float] = (0.0, 0.0)
        self._last_received_s = 0.0
        self._backwards = 0
        self._before: Any = None
        self._between: list[tuple[Any, Exchange]] = []

    def answered(self, exchange: Exchange) -> None:
        """Take one exchange of the run; only poses count."""
        request, response = exchange.request, exchange.response
        if request.method == "GET" and request.url == self._url and response.media_type == "application/json":
            self._over_rest(exchange)
        elif request.method == "POST" and response.ok and b"GetPoseResponse" in response.body:
            value, problem = answered(exchange, ODOMETRY)
            if not problem and not ODOMETRY.problem(value):
                self._in_order(value, exchange)
                self._between.append((value, exchange))

    def _over_rest(self, exchange: Exchange) -> None:
        value, problem = read_as(exchange.response, ODOMETRY)
        if problem:
            return
        after, between, self._between = projected(value, ODOMETRY.schema), self._between, []
        for message, one in between if self._before is not None else ():
            found = contradiction(message, self._before, after)
            self._judge.check(
                "equivalence/pose",
                not found,
                one,
                f"the message with this stamp, as GET {POSE} gives it just before and after",
                found=found,
                cause="another message",
            )
        self._before = after

    def _in_order(self, message: Any, exchange: Exchange) -> None:
        response, stamp = exchange.response, stamp_of(message)
        if response.received_s - response.elapsed_ms / 1000 >= self._last_received_s:
            back_s = self._last[0] - stamp[0] + (self._last[1] - stamp[1]) / 1e9
            self._backwards += back_s > _BACK_S
            self._judge.check(
                "equivalence/pose",
                back_s <= _BACK_S or self._backwards < _SEVERAL,
                exchange,
                "stamps that do not run backwards, as in REST's responses",
                found=f"a stamp {back_s:.3f} s earlier than in the previous response; {self._backwards} times so far",
                cause="stamp",
            )
        self._last = stamp
        self._last_received_s = max(self._last_received_s, response.received_s)
