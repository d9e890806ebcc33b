"""HTTP to a robot with one deadline for a whole exchange, however slowly its octets drip.

httpcore is used rather than a higher client because it sends what it is given (target, fields and their order) and
parses answers strictly with h11, which makes it the judge of framing as well. What httpx cost instead: docs/design.md.
"""

import contextlib
import ssl
import threading
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import httpcore

from conformance.transport.pace import time_for, time_to_arrive

# An answer longer than this is no answer to any request of the contract.
MAX_ANSWER = 32 * 1024 * 1024
# Octets that are handed to the network at once.
_PIECE = 256 * 1024
# A request of no more octets than this leaves in one piece.
_AT_ONCE = 16 * 1024
_clock = threading.local()


def set_deadline(seconds: float, octets: int = 0) -> None:
    """Give the exchange that this thread starts now ``seconds`` until its last octet, and more for each that comes.

    And for the ``octets`` of content that go out: as long as they do. When they have gone, or none does for so many
    seconds, there is nothing to give more time for.
    """
    _clock.at = time.monotonic() + seconds + time_for(octets)
    _clock.seconds, _clock.unsent, _clock.octets, _clock.connects = seconds, octets, octets, False


def has_connected() -> bool:
    """Whether the exchange that this thread started last had to open a connection, or tried to."""
    return bool(getattr(_clock, "connects", False))


def _left(timeout: float | None, error: type[Exception]) -> float:
    left = float(getattr(_clock, "at", float("inf"))) - time.monotonic()
    if left <= 0:
        raise error("the deadline has passed")
    return min(left, timeout) if timeout is not None else left


class _DeadlineStream(httpcore.NetworkStream):
    """A stream whose every wait ends at the exchange's deadline.

    httpcore writes a request's head and its content apart. Where both are short they are held until the answer is read,
    and leave as one segment, as from other clients: half the system calls, and a robot is woken once.
    """

    def __init__(self, stream: httpcore.NetworkStream) -> None:
        self._stream = stream
        self._held = b""

    def read(self, max_bytes: int, timeout: float | None = None) -> bytes:
        # A server that does not take a whole request may have answered it all the same (as httpcore has it).
        with contextlib.suppress(httpcore.WriteError):
            self._release()
        octets = self._stream.read(max_bytes, _left(timeout, httpcore.ReadTimeout))
        _clock.at = float(getattr(_clock, "at", float("inf"))) + time_for(len(octets))
        return octets

    def write(self, buffer: bytes, timeout: float | None = None) -> None:
        if len(self._held) + len(buffer) <= _AT_ONCE:
            self._held += buffer
            return
        self._release(timeout)
        self._send(buffer, timeout)

    def _release(self, timeout: float | None = None) -> None:
        held, self._held = self._held, b""
        if held:
            self._send(held, timeout)

    def _send(self, buffer: bytes, timeout: float | None) -> None:
        for start in range(0, len(buffer), _PIECE):
            self._stream.write(buffer[start : start + _PIECE], _left(timeout, httpcore.WriteTimeout))
        _clock.unsent = getattr(_clock, "unsent", 0) - len(buffer)
        if _clock.unsent <= 0 and getattr(_clock, "octets", 0):
            _clock.at = min(_clock.at, time.monotonic() + _clock.seconds + time_to_arrive(_clock.octets))

    def close(self) -> None:
        self._stream.close()

    def start_tls(
        self, ssl_context: ssl.SSLContext, server_hostname: str | None = None, timeout: float | None = None
    ) -> httpcore.NetworkStream:
        left = _left(timeout, httpcore.ConnectTimeout)
        return _DeadlineStream(self._stream.start_tls(ssl_context, server_hostname, left))

    def get_extra_info(self, info: str) -> Any:
        return self._stream.get_extra_info(info)


class DeadlineBackend(httpcore.NetworkBackend):
    """httpcore's own network access, under the exchange's deadline."""

    def __init__(self) -> None:
        self._backend = httpcore.SyncBackend()

    def connect_tcp(
        self,
        host: str,
        port: int,
        timeout: float | None = None,
        local_address: str | None = None,
        socket_options: Iterable[Any] | None = None,
    ) -> httpcore.NetworkStream:
        """See httpcore.NetworkBackend."""
        _clock.connects = True
        left = _left(timeout, httpcore.ConnectTimeout)
        return _DeadlineStream(self._backend.connect_tcp(host, port, left, local_address, socket_options))


def tls_context(ca_file: Path | None) -> ssl.SSLContext:
    """A context that trusts the system's authorities, or only those in ``ca_file``.

    Raises:
        OSError: the file cannot be read, or (ssl.SSLError) holds no certificate.
    """
    return ssl.create_default_context(cafile=str(ca_file) if ca_file else None)
