"""TLS: the server's certificate, and the handshakes of new connections."""

import asyncio
import contextlib
import logging
import socket
import ssl
from pathlib import Path
from typing import Final

from reference_robot.webservices.http.connection import HttpConnection
from reference_robot.webservices.http.port import Port

_LOGGER: Final = logging.getLogger(__name__)
_SHUTDOWN: Final = 2.0  # seconds for the client's close_notify
_PAUSE: Final = 0.1  # seconds after a failed accept


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


async def accept(port: Port, listener: socket.socket, context: ssl.SSLContext) -> None:
    """Accept connections and perform their TLS handshakes until cancelled; handshakes count as connections of the port.

    ``create_server(ssl=...)`` does not count connections whose handshake is not complete.
    """
    handshakes: set[asyncio.Task[None]] = set()
    try:
        while True:
            try:
                client, _ = await port.loop.sock_accept(listener)
            except OSError as error:  # no file descriptor is left, or the client has disconnected
                _LOGGER.warning("cannot accept a connection: %s", error)
                await asyncio.sleep(_PAUSE)
                continue
            if not port.has_room_for(len(handshakes) + 1):
                client.close()  # no response is possible before the handshake
                continue
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            handshake = port.loop.create_task(_agree(port, client, context))
            handshakes.add(handshake)
            handshake.add_done_callback(handshakes.discard)
    finally:
        listener.close()
        for handshake in handshakes:
            handshake.cancel()


async def _agree(port: Port, client: socket.socket, context: ssl.SSLContext) -> None:
    # The handshake fails if the client does not use TLS, shares no version, or is too slow; the socket is then closed.
    with contextlib.suppress(OSError):
        await port.loop.connect_accepted_socket(
            lambda: HttpConnection(port),
            client,
            ssl=context,
            ssl_handshake_timeout=port.patience,
            ssl_shutdown_timeout=_SHUTDOWN,
        )
