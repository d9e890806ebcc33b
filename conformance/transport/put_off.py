"""Requests that a device puts off, because it has too much to do at the moment: 503 or 429 with Retry-After."""

import time
from collections.abc import Callable, Iterator
from typing import Final, TypeVar

from conformance.transport.client import Connection
from conformance.transport.exchange import Attempt, Exchange
from conformance.transport.parallel import is_busy

_Attempt = TypeVar("_Attempt", bound=Attempt)
# How often a request that the device puts off is sent in all, and the longest wait that it may ask for, s.
_TRIES: Final = 6
_LONGEST_WAIT_S: Final = 10


def put_off_s(attempt: Attempt) -> int | None:
    """Return for how many seconds the device puts a request off: 503 or 429 with Retry-After in seconds; None: not."""
    if not isinstance(attempt, Exchange) or not is_busy(attempt):
        return None
    after = attempt.response.header("retry-after") or ""
    return int(after) if after.isdecimal() and after.isascii() else None


def until_taken(connection: Connection, send: Callable[[], _Attempt]) -> Iterator[_Attempt]:
    """Send a request, again and again while the device puts it off, and yield every attempt.

    Each request that it puts off is refused, so that sending it again does nothing twice. All waits of a run together
    have a bound (``Connection.patience_s``).
    """
    for _ in range(_TRIES):
        attempt = send()
        yield attempt
        after = put_off_s(attempt)
        if after is None or after > min(_LONGEST_WAIT_S, connection.patience_s):
            return
        connection.patience_s -= after
        time.sleep(after)
