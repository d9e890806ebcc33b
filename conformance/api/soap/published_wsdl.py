"""The WSDL that a robot publishes: got from it, or read from a file of the vendor's."""

from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from conformance.documents.wsdl import Wsdl, WsdlError, describe
from conformance.statement.statement import StatementError
from conformance.transport.client import Connection, HttpClient
from conformance.transport.exchange import Attempt, Exchange, NoAnswerError
from conformance.transport.reach import Folder, split

_OK = 200


@dataclass(frozen=True)
class PublishedWsdl:
    """A WSDL, or the reason why it could not be read.

    Attributes:
        source: URL or file that it comes from, or None where none was named.
        document: its octets, or None where it is not to be had.
        problem: why it is not to be had; empty where it is.
        attempt: the request for it, where one was sent.
    """

    source: str | None = None
    document: bytes | None = None
    problem: str = "the statement names no WSDL"
    attempt: Attempt | None = None

    @property
    def url(self) -> str | None:
        """Its source, if that is a URL."""
        return self.source if self.source is not None and "://" in self.source else None

    def interpret(self, beside: str, connection: Connection) -> tuple[Wsdl | None, str]:
        """Return the description, or why it cannot be read.

        A WSDL from a file may refer to documents on the robot, which are looked for ``beside`` the service.
        """
        if self.document is None or self.source is None:
            return None, self.problem
        try:
            described = describe(
                self.document,
                self.source,
                lambda location: fetch(location, self.url or beside, connection, Folder(str(self.source))),
            )
        except WsdlError as error:
            return None, str(error)
        return described, ""


def get(url: str, connection: Connection, *, timeout_s: float | None = None) -> Exchange:
    """Send GET for a URL over a connection of its own, and return the exchange.

    Raises:
        NoAnswerError: no HTTP response came.
    """
    base, path = split(url)
    with closing(HttpClient(base, connection)) as client:
        return client.send("GET", path, timeout_s=timeout_s)


def obtain(name: str, source: str | None, connection: Connection) -> PublishedWsdl:
    """Read the WSDL at a URL or in a file.

    Raises:
        StatementError: the file cannot be read.
    """
    if source is None:
        return PublishedWsdl()
    if "://" not in source:
        try:
            return PublishedWsdl(source, Path(source).read_bytes(), "")
        except OSError as error:
            raise StatementError(f"{name} WSDL {source!r} cannot be read: {error.strerror or error}") from error
    try:
        exchange = get(source, connection)
    except NoAnswerError as none:
        return PublishedWsdl(source, None, str(none), none.unanswered)
    if exchange.response.status != _OK:
        return PublishedWsdl(source, None, f"{exchange.came} for GET {source}", exchange)
    return PublishedWsdl(source, exchange.response.body, "", exchange)


def fetch(location: str, robot: str, connection: Connection, folder: Folder) -> bytes:
    """Read a document that a WSDL refers to, at its resolved location: a file, or from the robot and no other host.

    A robot behind a proxy or another name writes locations with its own; the same path is asked for at the URL
    ``robot``. A file is in the ``folder``.

    Raises:
        OSError, ValueError: it cannot be had.
    """
    if "://" not in location:
        return folder.read(location)
    path = split(location)[1]
    try:
        exchange = get(split(robot)[0] + path, connection)
    except NoAnswerError as none:
        raise OSError(str(none)) from none
    if exchange.response.status != _OK:
        raise OSError(f"{exchange.came} for GET {path}")
    return exchange.response.body
