"""A server to which a robot must never connect: the addresses in attacks are its URLs."""

import contextlib
import socket
import threading
import time
from typing import Self

_WAIT_S = 0.2
_REPLY = b"HTTP/1.1 200 OK\r\nContent-Type: text/xml\r\nContent-Length: 4\r\nConnection: close\r\n\r\n<a/>"


class CallbackServer:
    """Listens at an address that the robot can reach, and remembers the requested URLs.

    Use as a context manager: it listens as long as the block lasts. Host and port are the robot's.
    """

    def __init__(self, host: str, port: int) -> None:
        self._socket = _listening(_facing(host, port))
        self.address = self._socket.getsockname()
        self._seen: list[str] = []
        self._closing = False
        self._thread = threading.Thread(target=self._listen, name="callback server", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._closing = True
        # Closing alone does not wake a thread in accept(). Shutting down does on most systems, and the timeout on all.
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)
        self._thread.join(1.0)
        self._socket.close()

    def url(self, canary: str) -> str:
        """Return the URL that stands for ``canary``."""
        host = f"[{self.address[0]}]" if ":" in self.address[0] else self.address[0]
        return f"http://{host}:{self.address[1]}/{canary}"

    def calls(self, canary: str) -> int:
        """Return how often the robot requested the URL of ``canary``, or only connected."""
        return sum(1 for line in list(self._seen) if f"/{canary}" in line or line == "")

    def settle(self, since: float) -> None:
        """Wait until a moment after a time of the monotonic clock, because a robot may call back late."""
        time.sleep(max(0.0, since + _WAIT_S - time.monotonic()))

    def _listen(self) -> None:
        while not self._closing:
            try:
                connection, _ = self._socket.accept()
            except TimeoutError:
                continue
            except OSError:
                return
            with connection, contextlib.suppress(OSError):
                connection.settimeout(1.0)
                first = connection.recv(4096)
                self._seen.append(first.split(b"\r\n", 1)[0].decode("latin-1"))
                connection.sendall(_REPLY)


def _facing(host: str, port: int) -> str:
    """Return this machine's address on the way to the robot. Connecting a datagram socket sends nothing."""
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
        with socket.socket(family, kind, protocol) as probe:
            probe.connect(address)
            return str(probe.getsockname()[0])
    except OSError:
        return "127.0.0.1"


def _listening(host: str) -> socket.socket:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    listener = socket.socket(family, socket.SOCK_STREAM)
    listener.bind((host, 0))
    listener.listen(16)
    # So that closing it ends the thread on every system.
    listener.settimeout(0.2)
    return listener
