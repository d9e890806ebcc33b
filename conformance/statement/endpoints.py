"""The addresses of a device's interfaces in a statement, with deadline and credentials."""

from pathlib import Path
from typing import Annotated

import msgspec
from msgspec import Meta

from conformance.contract.classes import Interface
from conformance.contract.toml_file import Positive, Text


class Auth(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A login before the run, whose token all requests carry.

    Attributes:
        login: method and target of the request: ``POST /login``.
        token: JSON pointer to the token in the response (RFC 6901): ``/access_token``.
        body_file: file with the request's content, for example a user name and a password.
        content_type: media type of that content.
        send_as: where the token goes: ``bearer``, ``header NAME``, ``query NAME`` or ``cookie NAME``.
    """

    login: Annotated[str, Meta(pattern=r"^[A-Z]+ /\S*$")]
    token: Annotated[str, Meta(pattern="^/")]
    body_file: Text | None = None
    content_type: Text = "application/json"
    send_as: Annotated[str, Meta(pattern=r"^(bearer|(header|query|cookie) \S+)$")] = "bearer"


class Endpoints(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The addresses of a device's interfaces.

    Attributes:
        rest: base URL.
        publishers_wsdl, subscribers_wsdl: URL or file of the service's WSDL.
        publishers_endpoint, subscribers_endpoint: URL of the service if it differs from the WSDL's.
        ca_file: certificate authorities to trust.
        token_file: file with the bearer token.
        basic_file: file with ``user:password`` for HTTP's basic authentication.
        digest_file: file with ``user:password`` for HTTP's digest authentication.
        username_token_file: file with ``user:password`` for WS-Security's UsernameToken.
        api_key: where the API key goes: ``header NAME``, ``query NAME`` or ``cookie NAME``.
        api_key_file: file with the API key.
        headers_file: file with fixed headers, ``Name: value`` in each line; their values are secrets.
        client_cert_file: client certificate for TLS (PEM).
        client_key_file: its key, if it is not in the same file.
        client_key_passphrase_file: file with the passphrase of that key, if it is encrypted.
        trust_hosts: further servers, ``HOST`` or ``HOST:PORT``, to which a description may lead, with the credentials.
        request_rate: maximum requests per second, at least 1.
        timeout_s: deadline of one request, s.
        auth: a login before the run; the same as the table ``[auth]``.
    """

    rest: Text | None = None
    publishers_wsdl: Text | None = None
    subscribers_wsdl: Text | None = None
    publishers_endpoint: Text | None = None
    subscribers_endpoint: Text | None = None
    ca_file: Text | None = None
    token_file: Text | None = None
    basic_file: Text | None = None
    digest_file: Text | None = None
    username_token_file: Text | None = None
    api_key: Text | None = None
    api_key_file: Text | None = None
    headers_file: Text | None = None
    client_cert_file: Text | None = None
    client_key_file: Text | None = None
    client_key_passphrase_file: Text | None = None
    trust_hosts: tuple[Text, ...] = ()
    request_rate: Annotated[float, Meta(ge=1, le=100_000)] | None = None
    timeout_s: Positive = 10.0
    auth: Auth | None = None

    @property
    def publishers(self) -> bool:
        """Whether the publishers service has an address."""
        return bool(self.publishers_wsdl or self.publishers_endpoint)

    @property
    def subscribers(self) -> bool:
        """Whether the subscribers service has an address."""
        return bool(self.subscribers_wsdl or self.subscribers_endpoint)

    @property
    def interfaces(self) -> tuple[Interface, ...]:
        """The interfaces that have an address."""
        there = {
            Interface.REST: bool(self.rest),
            Interface.PUBLISHERS: self.publishers,
            Interface.SUBSCRIBERS: self.subscribers,
        }
        return tuple(name for name, known in there.items() if known)


def beside(folder: Path, where: Endpoints, auth: Auth | None = None) -> Endpoints:
    """Return endpoints, with a login, whose file names are relative to a folder; URLs stay unchanged."""
    files = [key for key in where.__struct_fields__ if key.endswith(("_file", "_wsdl"))]
    named = {key: getattr(where, key) for key in files}
    beside_it = {key: str(folder / name) for key, name in named.items() if name is not None and "://" not in name}
    auth = auth or where.auth
    if auth is not None and auth.body_file is not None:
        auth = msgspec.structs.replace(auth, body_file=str(folder / auth.body_file))
    return msgspec.structs.replace(where, auth=auth, **beside_it)
