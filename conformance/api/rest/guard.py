"""Keep a process that stops the device when this one is killed: no handler runs after ``kill -9``."""

import base64
import contextlib
import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Final

from conformance.api.rest.interface import RestInterface
from conformance.api.rest.stops import stop_once
from conformance.transport.client import Draft, draft_requests
from conformance.transport.credentials import Kind
from conformance.transport.exchange import SAFE_METHODS

_PROGRAM: Final = Path(__file__).with_name("guard_process.py")
_DEADLINE_S: Final = 3.0  # deadline of each request of the guard, s
_ENDS_S: Final = 2.0  # how long the run waits for the guard to end, s
# Renewing the list of stops may take _SHARE of the run's time plus _FREE_S seconds.
_SHARE: Final = 0.05
_FREE_S: Final = 0.1


class Guard:
    """Tells a process of its own how the device is stopped, from before the first request on that may move it.

    Args:
        api: its stops are sent, if the run may send them.
    """

    def __init__(self, api: RestInterface) -> None:
        self._api = api
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._told: list[dict[str, Any]] = []
        self._login: dict[str, Any] | None = None
        self._is_stale = True
        self._began, self._spent_s = time.monotonic(), 0.0

    def before_sending(self, *requests: tuple[str, str]) -> None:
        """Send the guard process the present stops: before a request that moves the device, and before the next one.

        What the device has responded to a move may be a part of its stop, and so may what is moved.
        """
        if self._api.driven is not None:
            for method, url in requests:
                self._api.driven.sends(method, url)
        self._before_sending(acts=any(method not in SAFE_METHODS for method, _ in requests))

    def _before_sending(self, *, acts: bool) -> None:
        if not (acts or self._is_stale) or (self._process is None and not acts):
            return
        with self._lock:
            # A device with a pack is always stopped by the same requests.
            if self._api.device.is_known and self._is_alive:
                self._is_stale = False
                return
            self._is_stale, started = True, time.monotonic()
            if self._spent_s > _FREE_S + _SHARE * (started - self._began):
                return
            self._is_stale = acts
            stops = [_told_of(draft) for draft in self._drafts() if draft.method not in SAFE_METHODS]
            self._spent_s += time.monotonic() - started
            if stops and (stops != self._told or not self._is_alive):
                self._tell(stops)

    @property
    def _is_alive(self) -> bool:
        return self._process is not None and self._process.poll() is None

    def start(self) -> int | None:
        """Start the process; return the descriptor for other processes that move the device to inherit, or None."""
        if self._api.driven is not None:
            self._api.driven.moves += 1  # counts moves that a process of Schemathesis made
        self._before_sending(acts=True)
        process = self._process
        return process.stdin.fileno() if process is not None and process.stdin is not None else None

    def release(self, *, stopped: bool = True) -> None:
        """End the process; if the device was not stopped, the process keeps trying for a while."""
        with self._lock:
            process, self._process, self._told = self._process, None, []
        if process is None or process.stdin is None:
            return
        with contextlib.suppress(OSError):
            if stopped:
                process.stdin.write(b"done\n")
            process.stdin.close()
        if stopped:
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(_ENDS_S)

    def _drafts(self) -> Iterable[Draft]:
        """Return the requests that stop the device, as the end of the run would send them now."""
        with self._api.run.limit.lift(), draft_requests() as drafts:
            stop_once(self._api)
        return drafts

    def _tell(self, stops: list[dict[str, Any]]) -> None:
        """Send the stops to the guard process, started if needed; if that fails, the run continues without a guard."""
        message = {
            "stops": stops,
            "login": self._renewal(),
            "for_s": self._api.run.tries_stop_s,
            "deadline_s": _DEADLINE_S,
        }
        try:
            if not self._is_alive:
                # Isolated, in a session of its own. The credentials of the stops go only through the pipe.
                self._process = subprocess.Popen(  # noqa: S603 - our own program
                    [sys.executable, "-I", "-S", str(_PROGRAM)],
                    stdin=subprocess.PIPE,
                    stdout=subprocess.DEVNULL,
                    stderr=subprocess.DEVNULL,
                    bufsize=0,
                    start_new_session=True,
                )
            self._told = stops if tell(self._process, json.dumps(message).encode() + b"\n") else []
        except OSError:
            self._told = []

    def _renewal(self) -> dict[str, Any] | None:
        """Return how the process gets a new token if the device refuses the stops' token; None without a login."""
        connection, auth = self._api.client.connection, self._api.run.statement.endpoints.auth
        if connection.log_in is None or auth is None:
            return None
        if self._login is None:
            with draft_requests() as drafts, contextlib.suppress(Exception):
                connection.log_in()
            self._login = _told_of(drafts[-1]) if drafts else {}
        is_quoted = connection.credentials.items[-1].kind is Kind.QUERY
        sent = connection.credentials.items[-1].as_sent
        return {**self._login, "token": auth.token, "sent": sent, "is_quoted": is_quoted} if self._login else None


def tell(process: subprocess.Popen[bytes] | None, line: bytes) -> bool:
    """Write a line to a process; return whether it took the line. A process that does not read is ended.

    Raises:
        OSError: the process has ended.
    """
    if process is None or process.stdin is None:
        return False
    os.set_blocking(process.stdin.fileno(), False)
    if process.stdin.write(line) == len(line):
        return True
    process.kill()
    process.wait()
    return False


def _told_of(draft: Draft) -> dict[str, Any]:
    """Return a request as the process reads it."""
    connection = draft.client.connection
    files = [item and str(Path(item).absolute()) for item in (connection.ca_file, *(connection.certificate or ()))]
    return {
        "host": draft.client.host.encode("idna").decode("ascii"),
        "port": draft.client.port,
        "tls": None if draft.client.tls is None else json.dumps(files),
        "request": base64.b64encode(draft.octets).decode(),
        "digest": _digest_user(draft),
    }


def _digest_user(draft: Draft) -> tuple[str, list[str]] | None:
    """Return user:password and our modules, with which the process answers digest challenges, if it may."""
    connection = draft.client.connection
    users = (credential.secret for credential in connection.credentials.items if credential.kind is Kind.DIGEST)
    user = next(users, None) if connection.may_authorize(draft.client.base_url) else None
    return None if user is None else (user, sys.path)
