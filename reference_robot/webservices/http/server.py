"""The HTTP server of one port: accepts connections, with TLS or without, ends overdue ones, and shuts down in order."""

import asyncio
import contextlib
import logging
import socket
import ssl
from pathlib import Path
from time import perf_counter, thread_time
from typing import Any, Final

from conformance.commandline.secret_file import warn_if_shared
from reference_robot.webservices.http.connection import HttpConnection
from reference_robot.webservices.http.crowd import NEVER
from reference_robot.webservices.http.port import Port

_SHUTDOWN: Final = 2.0  # seconds for the client's close_notify


class TlsFileError(ValueError):
    """An error for a certificate or key that cannot be used; the message names the file and the reason."""


class _EncryptedKeyError(Exception):
    """An error for a private key that is encrypted with a password."""


def server_context(certificate: Path, key: Path) -> ssl.SSLContext:
    """Return the TLS settings of a server for TLS 1.2 and 1.3.

    Args:
        certificate: A PEM file with the server's certificate first, and then its chain.
        key: A PEM file with the private key of the first certificate, without a password.

    Raises:
        TlsFileError: A file cannot be read or has other contents, or key and certificate do not belong together.
    """
    for option, path in (("--tls-cert", certificate), ("--tls-key", key)):
        try:
            path.read_bytes()
        except OSError as error:
            raise TlsFileError(f"{option} {path} cannot be read: {error.strerror}") from error
    warn_if_shared(key, at_once=True)
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    context.options |= ssl.OP_NO_RENEGOTIATION  # repeated renegotiation could occupy the robot's processor
    context.set_alpn_protocols(["http/1.1"])
    try:
        # Load the certificate alone first: load_cert_chain's error does not say which file is wrong.
        ssl.create_default_context().load_verify_locations(certificate)
    except ssl.SSLError as error:
        raise TlsFileError(f"--tls-cert {certificate} holds no certificate in PEM: {_reason(error)}") from error
    try:
        context.load_cert_chain(certificate, key, password=_refuse_password)
    except _EncryptedKeyError as error:
        raise TlsFileError(f"--tls-key {key} is encrypted; decrypt it with openssl pkey -in {key}") from error
    except ssl.SSLError as error:
        why = _reason(error)
        if "mismatch" in why:
            raise TlsFileError(f"--tls-key {key} is not the key of --tls-cert {certificate}") from error
        raise TlsFileError(f"--tls-key {key} holds no private key in PEM that can be used: {why}") from error
    return context


def _refuse_password() -> bytes:
    raise _EncryptedKeyError


def _reason(error: ssl.SSLError) -> str:
    return (error.reason or str(error)).replace("_", " ").lower()


def begin_handshake(port: Port, client: socket.socket, peer: Any, context: ssl.SSLContext) -> None:
    """Begin the TLS handshake of an accepted connection; it counts as a connection of the port.

    ``create_server(ssl=...)`` does not count connections whose handshake is not complete.
    """
    handshake = _Handshake(port, client)
    if port.add(handshake, peer):
        handshake.begin(context)
    else:
        port.remove(handshake)
        client.close()  # no response is possible before the handshake


class _Handshake:
    """A TLS handshake, which has a place among the connections of the port; a slow or failed one closes the socket."""

    is_known = False
    answered = -NEVER

    def __init__(self, port: Port, client: socket.socket) -> None:
        self._port = port
        self._client = client
        self._task: asyncio.Task[None] | None = None
        self.since = perf_counter()
        self.allowed = port.unknown_patience

    def begin(self, context: ssl.SSLContext) -> None:
        """Begin the handshake."""
        self._task = self._port.loop.create_task(self._agree(context))
        self._task.add_done_callback(lambda _: self._port.remove(self))

    async def _agree(self, context: ssl.SSLContext) -> None:
        with contextlib.suppress(OSError):  # the client does not use TLS, or shares no version
            await self._port.loop.connect_accepted_socket(
                lambda: HttpConnection(self._port, self), self._client, ssl=context, ssl_shutdown_timeout=_SHUTDOWN
            )

    def give_way(self) -> None:
        """End the handshake."""
        if self._task is not None:
            self._task.cancel()

    expire = stop = abort = give_way


_LOGGER: Final = logging.getLogger(__name__)
_AT_ONCE: Final = 64  # connections that are accepted before clients that have one get their turn
_SHORT_TURN: Final = 2e-3  # seconds of processor time; one connection in each such turn accepts a full backlog in 2 s
_PAUSE: Final = 0.1  # seconds after a failed accept
_BACKLOG: Final = 1024  # connections that may wait to be accepted
_TICK: Final = 0.5  # seconds
_LAST_WORDS: Final = 2.0  # seconds for pending responses when the robot stops


async def serve(
    port: Port,
    listener: socket.socket,
    started: asyncio.Event,
    stop: asyncio.Event,
    context: ssl.SSLContext | None = None,
) -> None:
    """Serve requests until ``stop`` is set; requests in progress are finished, for at most two seconds.

    Args:
        port: The interface behind the listener, with its connections and limits.
        listener: A listening socket.
        started: An event that is set once requests are served.
        stop: The event that ends the server.
        context: The TLS settings; None for plain HTTP.
    """
    listener.listen(_BACKLOG)
    accepting = _Accepting(port, listener, context)
    await accepting.begin()
    ticking = port.loop.create_task(_tick(port))
    started.set()
    await stop.wait()
    accepting.end()
    port.stop()
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(_LAST_WORDS):
            await port.is_empty.wait()
    ticking.cancel()
    port.abort()


class _Accepting:
    """Accepts connections, many at a time.

    ``create_server`` accepts one connection in each turn of the event loop. New clients would wait behind the
    connections of a client that opens many. So after a long turn, this class accepts all connections that wait. After a
    short turn it does not look for more, because each look costs as much as a tenth of a request.
    """

    def __init__(self, port: Port, listener: socket.socket, context: ssl.SSLContext | None) -> None:
        self._port = port
        self._listener = listener
        self._context = context
        self._server: asyncio.Server | None = None
        self._tasks: set[asyncio.Task[Any]] = set()
        self._accepted_at = 0.0  # processor time of this thread

    async def begin(self) -> None:
        """Accept connections from now on."""
        if self._context is None:
            self._server = await self._port.loop.create_server(self._on_accept, sock=self._listener, backlog=_BACKLOG)
        else:
            self._resume()

    def end(self) -> None:
        """Accept no more connections."""
        if self._server is not None:
            self._server.close()
        else:
            self._port.loop.remove_reader(self._listener)
            self._listener.close()

    def _resume(self) -> None:
        if self._listener.fileno() >= 0:
            self._port.loop.add_reader(self._listener, self._accept)

    def _on_accept(self) -> HttpConnection:
        now = thread_time()
        if now > self._accepted_at + _SHORT_TURN:
            self._accept()
        self._accepted_at = now
        return HttpConnection(self._port)

    def _accept(self) -> None:
        for _ in range(_AT_ONCE):
            try:
                client, peer = self._listener.accept()
            except BlockingIOError:
                return
            except OSError as error:  # no file descriptor is left, or the client has disconnected
                _LOGGER.warning("cannot accept a connection: %s", error)
                if self._context is not None:
                    self._port.loop.remove_reader(self._listener)
                    self._port.loop.call_later(_PAUSE, self._resume)
                return
            client.setblocking(False)  # noqa: FBT003 - the standard library's signature
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            if self._context is None:
                task = self._port.loop.create_task(self._connect(client))
                self._tasks.add(task)
                task.add_done_callback(self._tasks.discard)
            else:
                begin_handshake(self._port, client, peer, self._context)

    async def _connect(self, client: socket.socket) -> None:
        with contextlib.suppress(OSError):  # the client has disconnected
            await self._port.loop.connect_accepted_socket(lambda: HttpConnection(self._port), client)


async def _tick(port: Port) -> None:
    while True:
        await asyncio.sleep(_TICK)
        port.tick()
