"""Stop a device when the process that moved it has ended: ``python -I -S guard_process.py``.

Standard input has a JSON document in each line; the newest says how the device is stopped. The line ``done`` ends this
process. When standard input ends without it, the stops are sent. The suite is not imported before a device sends a
challenge of digest authentication: this starts in hundredths of a second, and takes little memory.

Over 150 lines because a device may demand TLS, a client certificate, a new login or the answer to a challenge before it
takes a stop, and because a stop that came too early, or that the device did not take, is sent again.
"""

from __future__ import annotations

import base64
import contextlib
import json
import os
import signal
import socket
import sys
import time

TYPE_CHECKING = False  # typing takes longer to import than all of the above
if TYPE_CHECKING:
    from collections.abc import Iterator
    from ssl import SSLContext
    from typing import Any

    Contexts = dict[str | None, SSLContext | None]

# Stops are sent _ROUNDS times, _BETWEEN_S apart: a request of the killed process may arrive after the first stop, and a
# device with a queue of missions may begin the next one.
_ROUNDS = 3
_BETWEEN_S = 0.4
# Statuses after which the stop is sent again, because they speak of another request or of another time (RFC 9110
# 15.5.9, 15.6, RFC 8470, 6585).
_AGAIN = frozenset({408, 425, 429})
_SERVER_ERROR = 500
_NO_RESPONSE = 599
_LONGEST_HEAD = 65_536
# Statuses that refuse the credentials of the stop (RFC 9110 15.5, RFC 4918 11.3): it is sent again after a login.
_REFUSALS = frozenset({401, 403, 407, 423, 428})
_LONGEST_LOGIN = 1 << 20
_UNAUTHORIZED = 401


@contextlib.contextmanager
def _send(request: dict[str, Any], contexts: Contexts, deadline_s: float) -> Iterator[socket.socket]:
    """Send one request over a new connection, and return the response."""
    with socket.create_connection((request["host"], request["port"]), deadline_s) as link:
        tls = contexts.get(request["tls"])
        sent = link if tls is None else tls.wrap_socket(link, server_hostname=request["host"])
        sent.settimeout(deadline_s)
        sent.sendall(base64.b64decode(request["request"]))
        yield sent


def _status(stop: dict[str, Any], contexts: Contexts, deadline_s: float) -> int:
    """Send a stop, and once more if it gets a challenge; return the status of the response, 599 without one."""
    status, head = _response(stop, contexts, deadline_s)
    if status == _UNAUTHORIZED and stop.get("digest") and _answer(stop, head):
        status, _ = _response(stop, contexts, deadline_s)
    return status


def _response(stop: dict[str, Any], contexts: Contexts, deadline_s: float) -> tuple[int, str]:
    """Send a stop; return status and beginning of the response: its whole head if a challenge may be in it."""
    end = b"\r\n\r\n" if stop.get("digest") else b"\n"
    came = b""
    try:
        with _send(stop, contexts, deadline_s) as link:
            while end not in came and len(came) < _LONGEST_HEAD:
                part = link.recv(_LONGEST_HEAD)
                if not part:
                    break
                came += part
    except OSError:
        pass  # the bytes that came until then may contain the status
    try:
        return int(came.split(None, 2)[1]), came.decode("latin-1")
    except (ValueError, IndexError):
        return _NO_RESPONSE, ""


def _answer(stop: dict[str, Any], head: str) -> bool:
    """Answer a challenge of digest authentication in a stop's headers; return whether there was one."""
    pair, sys.path[:] = stop["digest"]
    import re  # noqa: PLC0415 - they are seldom needed, and take longer than everything else here

    from conformance.transport.digest import DigestUser  # noqa: PLC0415 - as above

    user = DigestUser(pair)
    if not user.learn(re.findall(r"(?im)^(www-authenticate):(.*)$", head)):
        return False
    before, blank, body = base64.b64decode(stop["request"]).partition(b"\r\n\r\n")
    start, *fields = before.split(b"\r\n")
    field = f"Authorization: {user.answer(*start.decode('latin-1').split(' ')[:2])}".encode()
    fields = [octets for octets in fields if not octets.lower().startswith(b"authorization:")]
    stop["request"] = base64.b64encode(b"\r\n".join([start, field, *fields]) + blank + body).decode()
    return True


def _log_in(told: dict[str, Any], contexts: Contexts) -> None:
    """Log in, and replace the token in the stops; if the login gives none, leave the stops as they are."""
    import http.client  # noqa: PLC0415 - it is seldom needed, and takes longer than everything else here
    from urllib.parse import quote  # noqa: PLC0415

    login = told["login"]
    try:
        with _send(login, contexts, told["deadline_s"]) as link, http.client.HTTPResponse(link) as response:
            response.begin()
            token = json.loads(response.read(_LONGEST_LOGIN))
        for part in login["token"].split("/")[1:]:
            name = part.replace("~1", "/").replace("~0", "~")
            token = token[int(name) if isinstance(token, list) else name]
    except (OSError, ValueError, LookupError, TypeError, http.client.HTTPException):
        return
    if not isinstance(token, str) or not token.isprintable():
        return
    sent = quote(token, safe="") if login["is_quoted"] else token
    for stop in told["stops"]:
        request = base64.b64decode(stop["request"]).replace(login["sent"].encode(), sent.encode())
        stop["request"] = base64.b64encode(request).decode()
    login["sent"] = sent


def _stop(told: dict[str, Any], contexts: Contexts) -> None:
    """Send each stop several times; repeat a refused one until the time is over."""
    until = time.monotonic() + told["for_s"]
    passes = 0
    waiting = told["stops"]
    while passes < _ROUNDS or (waiting and time.monotonic() < until):
        stops = told["stops"] if passes < _ROUNDS else waiting
        statuses = [_status(stop, contexts, told["deadline_s"]) for stop in stops]
        if told.get("login") and not _REFUSALS.isdisjoint(statuses) and time.monotonic() < until:
            _log_in(told, contexts)
            statuses = [_status(stop, contexts, told["deadline_s"]) for stop in stops]
        waiting = [
            stop
            for stop, status in zip(stops, statuses, strict=True)
            if status >= _SERVER_ERROR or status in _AGAIN or (told.get("login") and status in _REFUSALS)
        ]
        passes += 1
        time.sleep(_BETWEEN_S)


def _context(files: str | None) -> SSLContext | None:
    """Return a TLS context of the files of authorities and a client certificate; None if the device speaks no TLS."""
    if files is None:
        return None
    import ssl  # noqa: PLC0415 - it takes longer than everything else here

    authorities, *certificate = json.loads(files)
    context = ssl.create_default_context(cafile=authorities)
    context.set_alpn_protocols(["http/1.1"])
    if certificate:
        name, key, passphrase = certificate
        with open(passphrase or os.devnull, encoding="utf-8") as file:  # noqa: PTH123 - pathlib takes long to import
            context.load_cert_chain(name, key, file.read().strip())
    return context


def main() -> None:
    """Read how the device is stopped until the other process has ended or is done."""
    # Ignore signals that end all processes of a terminal or a job: the guard must outlive the run.
    for number in signal.valid_signals() - {signal.SIGCHLD} if os.name == "posix" else {signal.SIGINT}:
        try:
            signal.signal(number, signal.SIG_IGN)
        except OSError:  # SIGKILL and SIGSTOP cannot be ignored
            continue
    told: dict[str, Any] | None = None
    contexts: Contexts = {}
    for line in sys.stdin.buffer:
        if line == b"done\n":
            return
        if line.endswith(b"\n"):  # a line that is cut short is incomplete JSON
            told = json.loads(line)
            # Read the TLS files now, because they may be gone when the stop is sent.
            files = {item["tls"] for item in (*told["stops"], told.get("login")) if item}
            contexts = {file: contexts.get(file) or _context(file) for file in files}
    if told is not None:
        _stop(told, contexts)


main()
