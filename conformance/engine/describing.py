"""Fetch an API's own description, and make the contract pack by which the API is judged."""

from __future__ import annotations

from pathlib import Path
from typing import Final
from urllib.parse import urljoin, urlsplit

from conformance.contract.described import write_described_pack
from conformance.contract.pack import Contract
from conformance.documents.description import Description, DescriptionError, is_url, read_description
from conformance.documents.security import without_credentials
from conformance.statement.endpoints import Endpoints
from conformance.transport.client import Connection, HttpClient
from conformance.transport.exchange import NoAnswer, NoAnswerError

#: The folder of the pack, in the folder of the results.
FOLDER: Final = "description"
# Where APIs usually serve their description, tried if the URL itself is none.
_USUAL: Final = (
    "/openapi.json", "/openapi.yaml", "/swagger.json", "/v3/api-docs", "/api/openapi.json", "/api-docs",
    "/swagger/v1/swagger.json", "/api/v1/openapi.json", "/docs/openapi.json",
)  # fmt: skip
_REDIRECTS: Final = 4
_OK, _REDIRECT, _CLIENT_ERROR = 200, 300, 400


def is_wsdl(source: str) -> bool:
    """Return whether a URL or file is named as a WSDL is."""
    return source.lower().endswith((".wsdl", "?wsdl", "?singlewsdl"))


class UnreachableError(Exception):
    """Raised when the server of a description does not respond; the message says why."""


class _Loader:
    """Loads the content of URLs, with the deadline of the run, and of files.

    Credentials go to the server of the description alone: its references may lead anywhere.
    """

    def __init__(self, connection: Connection, source: str) -> None:
        self._connection, self._own = connection, urlsplit(source).netloc
        self._silent: dict[str, str] = {}

    def __call__(self, source: str) -> bytes:
        """Return the content of a URL or file.

        Raises:
            UnreachableError: the server does not respond.
            OSError, ValueError: there is no such content.
        """
        if not is_url(source):
            return Path(source).read_bytes()
        url = source
        for _ in range(_REDIRECTS):
            parts = urlsplit(url)
            if parts.netloc in self._silent:
                raise UnreachableError(f"{url}: {self._silent[parts.netloc]}")
            client = HttpClient(f"{parts.scheme}://{parts.netloc}", self._connection)
            target = (parts.path or "/") + (f"?{parts.query}" if parts.query else "")
            try:
                accept = ("Accept", "application/json, application/yaml, */*")
                own = parts.netloc == self._own
                response = client.send("GET", target, headers=[accept], authorized=own).response
            except NoAnswerError as none:
                if none.kind is NoAnswer.CIRCUIT_OPEN:
                    raise ValueError(str(none)) from none
                self._silent[parts.netloc] = str(none)
                raise UnreachableError(f"{url}: {none}") from none
            finally:
                client.close()
            location = response.header("location")
            if _REDIRECT <= response.status < _CLIENT_ERROR and location:
                url = urljoin(url, location)
                if urlsplit(url).netloc != parts.netloc:
                    raise ValueError(f"it redirects to another server, {url}")
                continue
            if response.status != _OK:
                raise ValueError(f"the server responded {response.status}")
            return response.body
        raise ValueError(f"more than {_REDIRECTS} redirects")


def fetch_description(source: str, overlays: tuple[str, ...], connection: Connection) -> Description:
    """Return the description at a URL or in a file; at a URL that is none, try the usual places on its server.

    Raises:
        DescriptionError: there is no usable description.
        UnreachableError: the server does not respond.
    """
    load = _Loader(connection, source)
    try:
        return read_description(source, load, overlays)
    except DescriptionError as error:
        if not is_url(source):
            raise
        for path in _USUAL if len(urlsplit(source).path.strip("/").split("/")) <= 1 else ():
            try:
                return read_description(urljoin(source, path), load, overlays)
            except DescriptionError:
                continue
        raise DescriptionError(f"{error}; name the URL or file of its OpenAPI description") from error


def described_contract(
    source: str,
    overlays: tuple[str, ...],
    base_url: str | None,
    endpoints: Endpoints,
    connection: Connection,
    out: Path,
    *,
    moves: bool = False,
) -> tuple[Contract, Endpoints, tuple[str, ...]]:
    """Return the contract of an API's own description, the endpoints with its base URL, and remarks.

    Args:
        source: URL or file of the description.
        overlays: URLs or files of overlays.
        base_url: URL below which the operations are; None: as the description says.
        endpoints: what the statement or the options say.
        connection: deadline, credentials and TLS.
        out: folder of the results, in which the pack is written.
        moves: whether the statement has a motion map.

    Raises:
        DescriptionError: there is no usable description, or it does not say where the API is.
        UnreachableError: the server of the description does not respond.
        OSError: the pack cannot be written.
    """
    import msgspec  # noqa: PLC0415 - read already where this is used

    found = fetch_description(source, overlays, connection)
    base = base_url or endpoints.rest or found.base_url
    if not base:
        raise DescriptionError(
            f"{source} names no server: say where the API is with --base-url, as in --base-url http://robot:8000"
        )
    document = without_credentials(found.document, connection.credentials.places)
    folder = write_described_pack(out / FOLDER, document, found.original, found.unresolved, moves=moves)
    Contract.load.cache_clear()
    remarks = (*(() if base_url or endpoints.rest else found.remarks), *found.not_called, *found.unread)
    return Contract.load(folder), msgspec.structs.replace(endpoints, rest=base), remarks


def soap_contract(
    source: str,
    base_url: str | None,
    endpoints: Endpoints,
    connection: Connection,
    out: Path,
    *,
    schemas: Path | None = None,
    moves: bool = False,
) -> tuple[Contract, Endpoints, tuple[str, ...]]:
    """Return the contract of a device's WSDL, the endpoints with its address, and remarks.

    Args:
        source: URL or file of the WSDL.
        base_url: scheme and host to use in place of those in the WSDL, or with a path the address of the service; None:
            as the WSDL says.
        endpoints: what the statement or the options say.
        connection: deadline, credentials and TLS.
        out: folder of the results, in which the pack is written.
        schemas: folder with schemas that the WSDL's references do not lead to, or None.
        moves: whether the statement has a motion map.

    Raises:
        DescriptionError: there is no usable WSDL.
        UnreachableError: its server does not respond.
        OSError: the pack cannot be written.
    """
    import msgspec  # noqa: PLC0415 - read already where this is used

    from conformance.documents.soap_services import WsdlError, base_of, moved, read_services  # noqa: PLC0415
    from conformance.documents.wsdl_imports import SchemaFolder  # noqa: PLC0415

    # xmlschema and lxml take a third of a second, which other devices need not pay.
    from conformance.documents.wsdl_pack import each, label_of, write_soap_pack  # noqa: PLC0415

    load, documents, named = _Loader(connection, source), dict[str, bytes](), dict[str, str]()
    folder = SchemaFolder(schemas) if schemas else None

    def fetch(place: str) -> bytes:
        own = urlsplit(place).netloc == urlsplit(source).netloc
        given = folder.at(place) if folder and not own else None
        try:
            documents[place] = load(place) if given is None else given
        except (UnreachableError, OSError, ValueError) as error:
            given = folder.at(place) if folder else None
            if given is None:
                raise ValueError(str(error)) from error
            documents[place] = given
        return documents[place]

    def locate(space: str) -> str:
        named[space] = folder.locate(space) if folder else ""
        return named[space]

    foreign = bool(base_url) and not is_url(source)
    try:
        address = base_url if base_url and urlsplit(base_url).path.strip("/") else ""
        documents[source] = load(source)
        try:
            found = read_services(documents[source], source, fetch, address, locate, foreign=foreign)
        except WsdlError:
            if not base_url or address:
                raise
            # It may say nothing of where the service is.
            address = f"{base_url.rstrip('/')}/"
            found = read_services(documents[source], source, fetch, address, locate, foreign=foreign)
    except WsdlError as error:
        raise DescriptionError(str(error)) from error
    except ValueError as error:
        raise DescriptionError(f"{source} could not be read: {error}") from error
    base = (base_of(found) if address else base_url or endpoints.rest or base_of(found)).rstrip("/")
    elsewhere = (
        f"Port {port.name} is at {port.url}, another server, and is not called."
        for port in found.ports
        if not moved(port.url, base_of(found), base).startswith(base)
    )
    uncalled = (f"{label_of(port, one)} is not called: {one.remark}." for port, one in each(found.ports) if one.remark)
    pack = write_soap_pack(out / FOLDER, found, source, documents, address, named=named, foreign=foreign, moves=moves)
    Contract.load.cache_clear()
    return Contract.load(pack), msgspec.structs.replace(endpoints, rest=base), (*elsewhere, *uncalled, *found.notes)
