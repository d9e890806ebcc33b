"""The connections of one client to its server: one that is idle is used again, else another one is opened."""

import ssl

import httpcore

from conformance.transport.deadlines import DeadlineBackend

# Idle connections that are kept, and for how long, s: servers close them after five at the earliest.
_KEPT = 2
_EXPIRY_S = 3.0


class Connections:
    """What httpcore's pool does for many origins and threads, in a tenth of its time: a client has one of each.

    Args:
        scheme, host, port: of the server.
        ssl_context: for https.
    """

    def __init__(self, scheme: bytes, host: bytes, port: int, ssl_context: ssl.SSLContext | None) -> None:
        self._origin = httpcore.Origin(scheme, host, port)
        self._ssl_context = ssl_context
        self._idle: list[httpcore.HTTPConnection] = []

    def new(self) -> httpcore.HTTPConnection:
        """One of its own, which is opened by the first request on it."""
        return httpcore.HTTPConnection(
            self._origin, self._ssl_context, keepalive_expiry=_EXPIRY_S, network_backend=DeadlineBackend()
        )

    def take(self) -> httpcore.HTTPConnection:
        """An idle one that the server has not closed, else a new one; nobody else gets it meanwhile."""
        while self._idle:
            connection = self._idle.pop()
            if not connection.has_expired():
                return connection
            connection.close()
        return self.new()

    def give_back(self, connection: httpcore.HTTPConnection, *, keep: bool = True) -> None:
        """The exchange is over: keep its connection, where another one can follow on it."""
        if keep and connection.is_idle() and len(self._idle) < _KEPT:
            self._idle.append(connection)
        else:
            connection.close()

    def close(self) -> None:
        """Close those that are idle."""
        while self._idle:
            self._idle.pop().close()
