"""Make connection settings from a statement: deadline, TLS, credentials, and a login if there is one."""

import re
import ssl
from collections import deque
from functools import partial
from pathlib import Path
from typing import Any, Final
from urllib.parse import parse_qsl

import msgspec

from conformance.commandline.device_options import advice
from conformance.commandline.secrecy import SECRETS
from conformance.commandline.secret_file import read_secret, warn_if_shared
from conformance.documents.json_text import read_json
from conformance.statement.endpoints import Auth, Endpoints
from conformance.statement.statement import StatementError
from conformance.transport.client import Connection, HttpClient
from conformance.transport.connections import CertificateError, ClientCertificate
from conformance.transport.credentials import Credential, Credentials, Kind
from conformance.transport.exchange import NoAnswerError
from conformance.transport.reach import Trust

# Places in which a description may want an API key (OpenAPI 3.1, Security Scheme Object).
_PLACES: Final = frozenset({Kind.HEADER, Kind.QUERY, Kind.COOKIE})
# The names of what proves who somebody is in a login and in its response: refresh_token, clientSecret, PIN.
_PROOF: Final = re.compile(
    r"(?:pass(?:word|wd|phrase|code)?|pwd|secret|\bpin|token|key|code|assertion|session|lease|ticket)(?:_?id)?$",
    re.IGNORECASE,
)


def connection_of(where: Endpoints) -> Connection:
    """Return connection settings with the statement's deadline, credentials and rate limit, logged in if declared.

    Raises:
        OSError: a file with a credential cannot be read.
        StatementError: a credential is malformed, or the login fails; the message shows no secret.
    """
    try:
        trust = Trust.of(
            *(where.rest, where.publishers_wsdl, where.subscribers_wsdl),
            *(where.publishers_endpoint, where.subscribers_endpoint),
            hosts=where.trust_hosts,
        )
    except ValueError as error:
        raise StatementError(f"trusted host: {error}") from error
    found = Connection(
        timeout_s=where.timeout_s,
        ca_file=Path(where.ca_file) if where.ca_file else None,
        token=read_secret(where.token_file) if where.token_file else None,
        credentials=_credentials(where),
        certificate=_certificate(where),
        request_rate=where.request_rate,
        trust=trust,
    )
    if where.auth is not None and where.rest:
        # A login is neither subject to the run's permission, nor counted, nor judged.
        found.log_in = partial(_logged_in, where.auth, where.rest, found.unheard(recent=deque()))
        found.credentials = Credentials((*found.credentials.items, found.log_in()))
    return found


def place_api_key(where: Endpoints, document: dict[str, Any]) -> Endpoints:
    """Return endpoints whose API key goes to the description's place, unless the user names another.

    Args:
        where: the endpoints.
        document: an OpenAPI description.

    Raises:
        StatementError: there is a key, and the description wants none, or several.
    """
    if not where.api_key_file or where.api_key:
        return where
    schemes = document.get("components", {}).get("securitySchemes", {}).values()
    wanted = {
        f"{scheme['in']} {scheme['name']}"
        for scheme in schemes
        if isinstance(scheme, dict) and scheme.get("type") == "apiKey" and {"in", "name"} <= scheme.keys()
    }
    if len(wanted) != 1:
        named = f"wants {' and '.join(sorted(wanted))}" if wanted else "names no scheme of type apiKey"
        raise StatementError(
            f"the description {named}: say where the API key goes, as in "
            + advice("--api-key 'header X-Api-Key'", '[endpoints] api_key = "header X-Api-Key"')
        )
    return msgspec.structs.replace(where, api_key=wanted.pop())


def _logged_in(auth: Auth, base_url: str, connection: Connection) -> Credential:
    """Return the credential that a login gives.

    Raises:
        OSError: the file with the content cannot be read.
        StatementError: there is no response, or no token in it.
    """
    # Imported late: it takes a twentieth of a second.
    from jsonpath import JSONPointer  # noqa: PLC0415
    from jsonpath.exceptions import JSONPointerError  # noqa: PLC0415

    method, target = auth.login.split(" ", 1)
    content = Path(auth.body_file).read_bytes() if auth.body_file else b""
    if auth.body_file:
        warn_if_shared(auth.body_file)
    _keep_parts(content)
    headers = [("Accept", "application/json"), *([("Content-Type", auth.content_type)] if content else [])]
    client = HttpClient(base_url, connection)
    try:
        response = client.send(
            method, target, headers=[*headers, ("Accept", "application/json")], body=content
        ).response
    except NoAnswerError as none:
        raise StatementError(f"[auth] login: {none}") from none
    finally:
        client.close()
    if not response.ok:
        raise StatementError(f"[auth] login = {auth.login!r}: the device responded {response.status}")
    try:
        token = JSONPointer(auth.token).resolve(read_json(response.body).value)
    except JSONPointerError:
        token = None
    if not isinstance(token, str) or not token.isprintable() or not token:
        raise StatementError(f"[auth] token = {auth.token!r}: the response to {auth.login} has no text there")
    place, _, name = auth.send_as.partition(" ")
    found = Credential(Kind(place), token, name)
    _keep_parts(response.body)
    return found


def _keep_parts(content: bytes) -> None:
    """Mask the secret parts of a login's request or response, by their names: JSON or a form."""
    waiting: list[tuple[str, Any]] = [("", read_json(content).value), *parse_qsl(content.decode("utf-8", "replace"))]
    while waiting:
        name, value = waiting.pop()
        if isinstance(value, dict):
            waiting += value.items()
        elif isinstance(value, list):
            waiting += [(name, item) for item in value]
        elif isinstance(value, str) and _PROOF.search(name):
            SECRETS.keep(value, "$ROAAS_LOGIN")


def _certificate(where: Endpoints) -> ClientCertificate | None:
    """Return the client certificate.

    Raises:
        StatementError: it cannot be used.
    """
    if where.client_cert_file is None:
        return None
    warn_if_shared(where.client_key_file or where.client_cert_file)
    found = ClientCertificate(where.client_cert_file, where.client_key_file, where.client_key_passphrase_file)
    try:
        # Now, before the first request, and once for all: whether it can be used.
        found.load_into(ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT))
    except CertificateError as error:
        raise StatementError(str(error)) from None
    return found


def _credentials(where: Endpoints) -> Credentials:
    """Return the credentials other than the bearer token; their secrets are in files.

    Raises:
        StatementError: one is malformed; the message shows no secret.
        OSError: a file cannot be read.
    """
    found: list[Credential] = []
    for kind, file in ((Kind.BASIC, where.basic_file), (Kind.DIGEST, where.digest_file)):
        if file:
            pair = read_secret(file)
            if ":" not in pair:
                raise StatementError(f"{file}: expected one line user:password")
            found.append(Credential(kind, pair))
    if where.api_key or where.api_key_file:
        place, _, name = (where.api_key or "").partition(" ")
        if place not in _PLACES or not name.strip() or not where.api_key_file:
            raise StatementError("an API key needs api_key = 'header NAME' (or query, or cookie) and api_key_file")
        found.append(Credential(Kind(place), read_secret(where.api_key_file), name.strip()))
    for number, line in enumerate(read_secret(where.headers_file).splitlines() if where.headers_file else (), 1):
        name, colon, value = line.partition(":")
        if not colon or not name.strip():
            raise StatementError(f"{where.headers_file}, line {number}: expected Name: value")
        found.append(Credential(Kind.HEADER, value.strip(), name.strip()))
    return Credentials(tuple(found))
