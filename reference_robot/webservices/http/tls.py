"""TLS: the server's certificate, and the handshakes of new connections."""

import contextlib
import socket
import ssl
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any, Final

from conformance.commandline.secret_file import warn_if_shared
from reference_robot.webservices.http.connection import HttpConnection
from reference_robot.webservices.http.crowd import NEVER
from reference_robot.webservices.http.port import Port

if TYPE_CHECKING:
    import asyncio

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
