"""Several concurrent clients: their requests are sent at the same moment, each on its own connection."""

import itertools
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from typing import Final, TypeVar

from conformance.transport.client import Connection, HttpClient
from conformance.transport.exchange import BUSY, Attempt, Exchange, NoAnswer, NoAnswerError, Outgoing, Unanswered
from conformance.transport.passage import Heard

# More concurrent clients would be a load test, and exceed a small robot's sockets.
MOST_CLIENTS: Final = 8

#: A request with the interface to send it to.
Addressed = tuple[HttpClient, Outgoing]


def is_busy(attempt: Attempt) -> bool:
    """Return whether the robot was overloaded: it responded 503 or the like, or accepted no further connection."""
    return not isinstance(attempt, Exchange) or attempt.response.status in BUSY


def send_together(rounds: Sequence[Sequence[Addressed]]) -> list[list[Attempt]]:
    """Send the requests of each round concurrently, one round after another.

    The nth request of every round belongs to the nth client, which keeps its connection. Listeners are called
    afterwards, in order, except for requests that met an overloaded robot.

    Args:
        rounds: at most MOST_CLIENTS requests each.

    Returns:
        The results in the order of the requests; a refused or closed connection is a result without a response.

    Raises:
        NoAnswerError: the robot did not respond within the deadline.
    """
    clients = [_Client() for _ in range(max(map(len, rounds), default=0))]
    attempts: list[list[Attempt]] = []
    try:
        with ThreadPoolExecutor(max(1, len(clients))) as pool:
            for requests in rounds:
                for to, request in requests:
                    to.connection.take_slot((request.method, to.url(request.target)))
                    to.close()  # a server that serves few connections has more for these
                start = threading.Barrier(len(requests))
                try:
                    jobs = [
                        pool.submit(client.send, *addressed, start.wait)
                        for client, addressed in zip(clients, requests, strict=False)
                    ]
                    attempts.append([_among(job.result(), len(requests)) for job in jobs])
                except BaseException:
                    # A signal came before all threads had begun: without this, the others would wait for ever.
                    start.abort()
                    raise
                for to, request in requests:
                    to.connection.note(request.method)
                _tell(requests, attempts[-1])
    finally:
        for client in clients:
            client.close()
    return attempts


@contextmanager
def meanwhile(to: HttpClient, request: Outgoing, timeout_s: float) -> Iterator["Future[tuple[Attempt, float]]"]:
    """Send a request from a client of its own while the block runs; yield its outcome and time (time.monotonic, s).

    It is awaited at the end of the block. No listener gets it, as its time is the point.

    Args:
        to: where it is sent.
        request: the request.
        timeout_s: its deadline, s.
    """
    to.connection.take_slot((request.method, to.url(request.target)))
    with ThreadPoolExecutor(1) as pool:
        yield pool.submit(lambda: (_sent_apart(to, [request], timeout_s)[0], time.monotonic()))
    to.connection.note(request.method)


def crowd(to: HttpClient, requests: Sequence[Sequence[Outgoing]], timeout_s: float) -> list[list[Attempt]]:
    """Send the requests of many clients at the same time; each client sends its own in a row.

    No listener gets them, as a device need not serve so many.

    Args:
        to: where they are sent.
        requests: requests of each client.
        timeout_s: the deadline of each request, s.
    """
    for request in itertools.chain(*requests):
        to.connection.take_slot((request.method, to.url(request.target)))
    with ThreadPoolExecutor(len(requests)) as pool:
        return list(pool.map(lambda own: _sent_apart(to, own, timeout_s), requests))


def _sent_apart(to: HttpClient, requests: Sequence[Outgoing], timeout_s: float) -> list[Attempt]:
    """Send requests one after another from a client of their own, which has no listeners."""
    own = to.twin(to.connection.unheard(request_rate=None, resent=0))
    attempts: list[Attempt] = []
    try:
        for request in requests:
            try:
                came = own.send(
                    request.method, request.target, headers=request.headers, body=request.body, timeout_s=timeout_s
                )
                attempts.append(came)
            except NoAnswerError as none:
                attempts.append(none.unanswered)
    finally:
        own.close()
    return attempts


class _Client:
    """One of several concurrent clients, with connections of its own and without listeners."""

    def __init__(self) -> None:
        # The client whose connections are shared, and the client of this thread, by base URL.
        self._clients: dict[str, tuple[HttpClient, HttpClient]] = {}

    def send(self, shared: HttpClient, request: Outgoing, wait: Callable[[], object]) -> Attempt:
        """Wait for the other clients, then send."""
        # The limit on the rate was applied before.
        settings = shared.connection.unheard(heard=Heard.UNLESS_BUSY, request_rate=None, resent=0)
        _, own = self._clients.setdefault(shared.base_url, (shared, HttpClient(shared.base_url, settings)))
        wait()
        try:
            return own.send(request.method, request.target, headers=request.headers, body=request.body)
        except NoAnswerError as none:
            return none.unanswered

    def close(self) -> None:
        """Close the connections, and add their repeated requests to the run's count."""
        for shared, own in self._clients.values():
            own.close()
            shared.connection.resent += own.connection.resent


def _among(attempt: Attempt, clients: int) -> Attempt:
    """Return a result that says how many clients sent at the same moment, if that may be why no response came."""
    if isinstance(attempt, Exchange) or attempt.kind is not NoAnswer.TIMEOUT or clients == 1:
        return attempt
    problem = f"{attempt.problem}, while {clients} clients had a connection each"
    return Unanswered(attempt.request, problem, attempt.kind)


def _tell(requests: Sequence[Addressed], attempts: Sequence[Attempt]) -> None:
    """Call the listeners with the results.

    Raises:
        NoAnswerError: a request got no response.
    """
    for (to, _), attempt in zip(requests, attempts, strict=True):
        for listener in to.connection.listeners:
            if isinstance(attempt, Exchange) and not is_busy(attempt):
                listener.on_response(attempt)
            elif not isinstance(attempt, Exchange) and attempt.kind not in {NoAnswer.CLOSED, NoAnswer.REFUSED}:
                listener.on_no_response(attempt)
    for attempt in attempts:
        if not isinstance(attempt, Exchange) and attempt.kind not in {NoAnswer.CLOSED, NoAnswer.REFUSED}:
            raise NoAnswerError(attempt)


_Attempt = TypeVar("_Attempt", bound=Attempt)


def until_taken(connection: Connection, send: Callable[[], _Attempt]) -> Iterator[_Attempt]:
    """Send a request, again and again while the device puts it off, and yield every attempt.

    Each request that it puts off is refused, so that sending it again does nothing twice.
    """
    for tries in itertools.count(1):
        attempt = send()
        yield attempt
        endpoint = partial(connection.endpoint_of, attempt.request)
        if not isinstance(attempt, Exchange) or not connection.overload.waits(attempt.response, endpoint, tries):
            return
