"""Fetch an API's own description, and make the contract pack by which the API is judged."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Final
from urllib.parse import urljoin, urlsplit

from conformance.commandline.device_options import advice
from conformance.contract.described import write_described_pack
from conformance.contract.pack import Contract
from conformance.documents.description import Description, DescriptionError, is_url, read_description
from conformance.documents.json_schema import Schema
from conformance.documents.openapi import methods_of
from conformance.documents.schema_budget import unrolls
from conformance.documents.security import without_credentials
from conformance.statement.endpoints import Endpoints
from conformance.transport.client import Connection
from conformance.transport.reach import Folder, Trust, UnreachableError, is_same, server_of
from conformance.verdict.finding import count_of

if TYPE_CHECKING:
    from conformance.documents.wsdl import Wsdl

#: The folder of the pack, in the folder of the results.
FOLDER: Final = "description"
# The description in the script of swagger-ui-express, which indents it by JSON.stringify; without the copy that an
# `await import("swagger.json")` adds as "default".
_IN_SCRIPT: Final = re.compile(rb'"swaggerDoc": (\{.*?)(?:,\n    "default": \{.*?\n    \})?(\n  \})', re.DOTALL)
# Where APIs usually serve their description, tried if the URL itself is none: first below the URL's own path.
_BELOW: Final = ("/openapi.json", "/openapi.yaml", "/swagger.json", "/swagger-ui-init.js")
_USUAL: Final = (
    *_BELOW, "/v3/api-docs", "/api/openapi.json", "/api-docs", "/swagger/v1/swagger.json", "/api/v1/openapi.json",
    "/docs/openapi.json", "/schema/openapi.json", "/documentation/json", "/api-json", "/openapi/v1.json",
    "/openapi", "/q/openapi", "/v1/openapi.json", "/api/schema/", "/apispec_1.json", "/api/docs/swagger.json",
    "/swagger/doc.json", "/doc", "/api-docs/openapi.json", "/openapi/openapi.json", "/api-docs.json",
    "/api-docs/swagger-ui-init.js", "/docs/swagger-ui-init.js", "/openapi/json", "/swagger/json",
)  # fmt: skip


def is_wsdl(source: str) -> bool:
    """Return whether a URL or file is named as a WSDL is."""
    return source.lower().endswith((".wsdl", "?wsdl", "?singlewsdl"))


class Loader:
    """Loads a description and the files it refers to, from the user's servers and its own folder only.

    Args:
        connection: deadline, credentials and TLS.
        trust: the servers that get the credentials.
        source: URL or file of the description.
        named: URLs and files that the user named beside it; their servers get no credentials.
        anywhere: whether it may refer to any file (--allow-files).
    """

    def __init__(
        self, connection: Connection, trust: Trust, source: str, named: Iterable[str] = (), *, anywhere: bool = False
    ) -> None:
        self._settings = connection, trust, tuple(named)
        self._folder = Folder(source, tuple(named), anywhere)

    @cached_property
    def _fetch(self) -> Callable[[str], bytes]:
        # Imported late: httpx takes a twentieth of a second, which a description in a file need not pay.
        from conformance.transport.fetching import Fetcher  # noqa: PLC0415

        return Fetcher(*self._settings)

    def __call__(self, source: str) -> bytes:
        """Return the content of a URL or file.

        Raises:
            UnreachableError: the server does not respond.
            OSError, ValueError: there is no such content, or the description must not refer to it.
        """
        content = self._fetch(source) if is_url(source) else self._folder.read(source)
        found = _IN_SCRIPT.search(content) if urlsplit(source).path.endswith(".js") else None
        return found[1] + found[2] if found else content


def trusting(connection: Connection, *named: str | None) -> Trust:
    """Return the trust of a connection, and in the servers of further URLs that the user named."""
    known = connection.trust or Trust()
    return Trust.of(*known.named, *named, hosts=known.hosts)


def _trust_in(source: str, connection: Connection, *api: str | None) -> tuple[Trust, tuple[str, ...]]:
    """Return the servers that get the credentials; and the description's URL, if its server does not get them.

    Args:
        source: URL or file of the description.
        connection: what it trusts.
        api: URLs by which the user says where the API is. Only those get the credentials then.
    """
    named = trusting(connection, *api)
    if not any(api) or not is_url(source) or named.trusts(source):
        return trusting(connection, *api, source), ()
    return named, (source,)


def fetch_description(
    source: str,
    overlays: tuple[str, ...],
    connection: Connection,
    base_url: str | None = None,
    *,
    allow_files: bool = False,
) -> Description:
    """Return the description at a URL or in a file; at a URL that is none, try the usual places on its server.

    Args:
        source: URL or file of the description.
        overlays: URLs or files of overlays.
        connection: deadline, credentials and TLS.
        base_url: where the user says that the API is. A description elsewhere is then fetched without credentials.
        allow_files: whether a description in a file may refer to files outside its folder.

    Raises:
        DescriptionError: there is no usable description.
        UnreachableError: the server does not respond.
    """
    trust, public = _trust_in(source, connection, base_url)
    load = Loader(connection, trust, source, (*overlays, *public), anywhere=allow_files)
    # Which of its servers is used: that is no request.
    trust = trusting(connection, source)
    try:
        return read_description(source, load, overlays, trust)
    except DescriptionError as error:
        if not is_url(source):
            raise
        usual = _usual_places(source)
        for path in usual:
            try:
                found = read_description(urljoin(source, path), load, overlays, trust)
            except DescriptionError:
                continue
            named = f"{source} is no description. " if urlsplit(source).path.strip("/") else ""
            return replace(found, elsewhere=(f"{named}The description was found at {found.source}.",))
        if "; are credentials missing" in str(error):
            raise
        tried = f"{', '.join(usual[:2])} and {len(usual) - 2} other usual places have none either. " if usual else ""
        raise DescriptionError(f"{error}. {tried}Name the URL or file of its OpenAPI description") from error


def _usual_places(source: str) -> tuple[str, ...]:
    """Return the paths at which the description of an API is tried, given a URL that is none."""
    folder = urlsplit(source).path.rstrip("/")
    below = tuple(f"{folder}{path}" for path in _BELOW if folder and "." not in folder.rpartition("/")[2])
    return (*below, *(_USUAL if folder.count("/") <= 1 else ()))


def _check_server(source: str, base: str, endpoints: Endpoints, connection: Connection) -> None:
    """Check that no description in a file decides where credentials go.

    Raises:
        DescriptionError: there are credentials, and only the file says where the device is.
    """
    secret = connection.credentials or connection.certificate or endpoints.auth or endpoints.username_token_file
    if not is_url(source) and (secret or endpoints.api_key_file) and not trusting(connection).trusts(base):
        host = urlsplit(base).netloc.rpartition("@")[2]
        how = advice(f", as by --base-url {base}, or allow it by --trust-host {host}", f", as by --base-url {base}")
        raise DescriptionError(
            f"{source} names the server {base}, and no description decides where credentials go: name the server "
            f"yourself{how}"
        )


def described_contract(
    source: str,
    overlays: tuple[str, ...],
    base_url: str | None,
    endpoints: Endpoints,
    connection: Connection,
    out: Path,
    *,
    mapped: Collection[str] = (),
    allow_files: bool = False,
) -> tuple[Contract, Endpoints, tuple[str, ...]]:
    """Return the contract of an API's own description, the endpoints with its base URL, and remarks.

    Args:
        source: URL or file of the description.
        overlays: URLs or files of overlays.
        base_url: URL below which the operations are; None means as the description says.
        endpoints: what the statement or the options say.
        connection: deadline, credentials and TLS.
        out: folder of the results, in which the pack is written.
        mapped: the classes that maps in the statement claim.
        allow_files: whether a description in a file may refer to files outside its folder.

    Raises:
        DescriptionError: there is no usable description, or it does not say where the API is.
        UnreachableError: the server of the description does not respond.
        OSError: the pack cannot be written.
    """
    import msgspec  # noqa: PLC0415 - read already where this is used

    found = fetch_description(source, overlays, connection, base_url or endpoints.rest, allow_files=allow_files)
    base = base_url or endpoints.rest or found.base_url
    if not base:
        how = advice(" with --base-url, as in --base-url http://robot:8000", ", as in [api] base_url of a statement")
        raise DescriptionError(f"{source} names no server: say where the API is{how}")
    if not (base_url or endpoints.rest):
        _check_server(source, base, endpoints, connection)
    document = without_credentials(found.document, connection.credentials.places)
    folder = write_described_pack(out / FOLDER, document, found.original, found.unresolved, mapped=mapped)
    Contract.load.cache_clear()
    of_server = () if base_url or endpoints.rest else found.remarks
    remarks = (*found.elsewhere, *of_server, *found.not_called, *found.unread)
    remarks += _without_cases(document)
    return Contract.load(folder), msgspec.structs.replace(endpoints, rest=base), remarks


def _without_cases(document: Schema) -> tuple[str, ...]:
    """Return a remark on operations that are too large for generated requests, or an empty text."""
    paths = ((path, item) for path, item in document["paths"].items() if isinstance(item, dict))
    every = ((method, path, operation) for path, item in paths for method, operation in methods_of(item).items())
    large = [f"{method} {path}" for method, path, operation in every if unrolls(document, operation)]
    if not large:
        return ()
    more = f" and {count_of(len(large) - 1, 'other operation')}" if large[1:] else ""
    return (f"{large[0]}{more} had no generated requests: the schemas have too many parts for that.",)


def _server_of_ports(found: Wsdl, source: str, trust: Trust) -> tuple[str, str]:
    """Return the server of a WSDL's ports, and a remark where that is another one than the user named."""
    if not is_url(source):
        return found.base, ""
    url = found.ports[0].url
    if trust.trusts(url):
        return server_of(trust.place(url)), ""
    here = server_of(trust.place(source))
    remark = f"The WSDL names the address {url}, on another server. Tested was {here}, from where the WSDL was read"
    return here, f"{remark}{advice('; --base-url and --trust-host change that', '; --base-url changes that')}."


def soap_contract(
    source: str,
    base_url: str | None,
    endpoints: Endpoints,
    connection: Connection,
    out: Path,
    *,
    schemas: Path | None = None,
    mapped: Collection[str] = (),
    allow_files: bool = False,
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
        mapped: the classes that maps in the statement claim.
        allow_files: whether a WSDL in a file may refer to files outside its folder.

    Raises:
        DescriptionError: there is no usable WSDL.
        UnreachableError: its server does not respond.
        OSError: the pack cannot be written.
    """
    import msgspec  # noqa: PLC0415 - read already where this is used

    from conformance.documents.wsdl import WsdlError, read_services  # noqa: PLC0415
    from conformance.documents.wsdl_imports import SchemaFolder  # noqa: PLC0415

    # xmlschema and lxml take a third of a second, which other devices need not pay.
    from conformance.documents.wsdl_pack import each, label_of, write_soap_pack  # noqa: PLC0415

    trust, public = _trust_in(source, connection, base_url, endpoints.rest)
    load = Loader(connection, trust, source, (*([str(schemas)] if schemas else ()), *public), anywhere=allow_files)
    documents, named = dict[str, bytes](), dict[str, str]()
    folder = SchemaFolder(schemas) if schemas else None

    def fetch(place: str) -> bytes:
        own = is_same(place, source)
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
    base = found.base if address else base_url or endpoints.rest
    remark = ""
    if base is None:
        base, remark = _server_of_ports(found, source, trust)
        _check_server(source, base, endpoints, connection)
    base = base.rstrip("/")
    elsewhere = (
        f"Port {port.name} is at {port.url}, another server, and is not called."
        for port in found.ports
        if not is_same(port.url, found.base) and not is_same(port.url, base)
    )
    uncalled = (
        f"{label_of(port, one)} is not called: {why}." for port, one in each(found.ports) if (why := found.remark(one))
    )
    pack = write_soap_pack(out / FOLDER, found, source, documents, address, named=named, foreign=foreign, mapped=mapped)
    Contract.load.cache_clear()
    remarks = (*filter(None, [remark]), *elsewhere, *uncalled, *found.notes)
    return Contract.load(pack), msgspec.structs.replace(endpoints, rest=base), remarks
