"""Stop a device when the process that moved it has ended: ``python -I -S guard_process.py``.

Standard input has a JSON document in each line; the newest says how the device is stopped. The line ``done`` ends this
process. When standard input ends without it, the stops are sent. The suite is not imported: this starts in hundredths
of a second, and takes little memory.
"""

from __future__ import annotations

import base64
import json
import os
import signal
import socket
import sys
import time

TYPE_CHECKING = False  # typing takes longer to import than all of the above
if TYPE_CHECKING:
    from ssl import SSLContext
    from typing import Any

# Each stop is sent several times: what the other process sent last may arrive after the first one, and a device with a
# queue of missions begins the next one.
_ROUNDS = 3
_BETWEEN_S = 0.4
# Not for this request, or not now: it is sent again (RFC 9110 15.5.9, RFC 8470 5.2, RFC 6585 4; 15.6).
_AGAIN = frozenset({408, 425, 429})
_SERVER_ERROR = 500
_LONGEST_STATUS_LINE = 4096


def _is_delivered(stop: dict[str, Any], contexts: dict[str | None, SSLContext | None], deadline_s: float) -> bool:
    """Send one request over a new connection; return whether the device took it."""
    try:
        with socket.create_connection((stop["host"], stop["port"]), deadline_s) as link:
            tls = contexts.get(stop["tls"])
            sent = link if tls is None else tls.wrap_socket(link, server_hostname=stop["host"])
            sent.settimeout(deadline_s)
            sent.sendall(base64.b64decode(stop["request"]))
            came = b""
            while b"\n" not in came and len(came) < _LONGEST_STATUS_LINE:
                part = sent.recv(_LONGEST_STATUS_LINE)
                if not part:
                    break
                came += part
        status = int(came.split(None, 2)[1])
    except (OSError, ValueError, IndexError):
        return False
    return status < _SERVER_ERROR and status not in _AGAIN


def _stop(told: dict[str, Any], contexts: dict[str | None, SSLContext | None]) -> None:
    """Send each stop several times, and those that the device does not take until the time is over."""
    until = time.monotonic() + told["for_s"]
    passes = 0
    waiting = told["stops"]
    while passes < _ROUNDS or (waiting and time.monotonic() < until):
        stops = told["stops"] if passes < _ROUNDS else waiting
        waiting = [stop for stop in stops if not _is_delivered(stop, contexts, told["deadline_s"])]
        passes += 1
        time.sleep(_BETWEEN_S)


def _context(files: str | None) -> SSLContext | None:
    """Return a TLS context of certificate authorities, client certificate and key; None: the device speaks no TLS."""
    if files is None:
        return None
    import ssl  # noqa: PLC0415 - it takes longer than everything else here

    authorities, certificate, key = json.loads(files)
    context = ssl.create_default_context(cafile=authorities)
    context.set_alpn_protocols(["http/1.1"])
    if certificate:
        context.load_cert_chain(certificate, key)
    return context


def main() -> None:
    """Read how the device is stopped until the other process has ended or is done."""
    # What ends all processes of a terminal or a job does not end this one.
    for number in signal.valid_signals() - {signal.SIGCHLD} if os.name == "posix" else {signal.SIGINT}:
        try:
            signal.signal(number, signal.SIG_IGN)
        except OSError:  # SIGKILL, SIGSTOP
            continue
    told: dict[str, Any] | None = None
    contexts: dict[str | None, SSLContext | None] = {}
    for line in sys.stdin.buffer:
        if line == b"done\n":
            return
        if line.endswith(b"\n"):  # a line that is cut short was never told
            told = json.loads(line)
            # Now, as the files may be gone when it counts.
            contexts = {stop["tls"]: contexts.get(stop["tls"]) or _context(stop["tls"]) for stop in told["stops"]}
    if told is not None:
        _stop(told, contexts)


main()
