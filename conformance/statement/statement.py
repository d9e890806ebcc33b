"""The implementation conformance statement: what a vendor declares about a device, and what it is judged by."""

from pathlib import Path
from typing import Annotated, Any, Self

import msgspec
from msgspec import Meta

from conformance.contract.interfaces import Interface
from conformance.contract.pack import Contract
from conformance.contract.toml_file import Positive, Text, TomlFileError, read_toml


class StatementError(TomlFileError):
    """Raised for an invalid statement; the message names the file, the key and the offending value."""


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
        publishers_wsdl: URL or file; likewise subscribers_wsdl.
        publishers_endpoint: URL of the service if it differs from the WSDL's; likewise subscribers_endpoint.
        ca_file: certificate authorities to trust.
        token_file: file with the bearer token.
        basic_file: file with ``user:password`` for HTTP's basic authentication.
        api_key: where the API key goes: ``header NAME``, ``query NAME`` or ``cookie NAME``.
        api_key_file: file with the API key.
        headers_file: file with fixed headers, ``Name: value`` in each line; their values are secrets.
        client_cert_file: client certificate for TLS (PEM).
        client_key_file: its key, if it is not in the same file.
        request_rate: maximum requests per second; slower than one a second, no run would end.
        timeout_s: deadline of one request, s.
        auth: a login before the run.
    """

    rest: Text | None = None
    publishers_wsdl: Text | None = None
    subscribers_wsdl: Text | None = None
    publishers_endpoint: Text | None = None
    subscribers_endpoint: Text | None = None
    ca_file: Text | None = None
    token_file: Text | None = None
    basic_file: Text | None = None
    api_key: Text | None = None
    api_key_file: Text | None = None
    headers_file: Text | None = None
    client_cert_file: Text | None = None
    client_key_file: Text | None = None
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


class Load(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What a load test may do to the device.

    Attributes:
        max_rate: maximum requests per second.
        max_duration_s: maximum duration of a measurement, s.
    """

    max_rate: Positive | None = None
    max_duration_s: Positive | None = None


class Calls(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What may be called of an API of which only its description is known.

    Attributes:
        allow: patterns of operations that may be called although they are not safe.
        never: patterns of operations that must not be called.
    """

    allow: tuple[Text, ...] = ()
    never: tuple[Text, ...] = ()


class Api(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The device's own description, by which it is judged in place of a contract.

    Attributes:
        openapi: URL or file of its OpenAPI or Swagger description.
        overlays: files of OpenAPI Overlays to apply to it.
        base_url: where its operations are, if the description does not say it.
    """

    openapi: Text | None = None
    overlays: tuple[Text, ...] = ()
    base_url: Text | None = None


class Statement(msgspec.Struct, frozen=True):
    """What a vendor declares about a device. A pack whose device has more to declare extends it.

    Attributes:
        robot: name, vendor, version.
        claims: the claimed conformance classes; None: none were named.
        values: values to use in requests, by the name of a parameter or member.
        calls: what may be called.
    """

    robot: dict[str, str] = {}
    endpoints: Endpoints = Endpoints()
    claims: tuple[str, ...] | None = None
    load: Load = Load()
    values: dict[str, tuple[Any, ...]] = {}
    calls: Calls = Calls()

    @property
    def figures(self) -> dict[str, dict[str, float]]:
        """Return the declared figures for result.json: ``declared``, ``limits`` and ``tolerances``, by name."""
        return {"declared": {}, "limits": {}, "tolerances": {}}

    @property
    def undeclared(self) -> dict[str, str]:
        """Return why requirements are not tested whose prerequisite is not declared, by prerequisite."""
        return {}

    @property
    def domain_id(self) -> int | None:
        """The ROS domain that a probe may join, or None."""
        return None

    def on_domain(self, domain_id: int) -> Self:
        """Return the statement with another ROS domain.

        Raises:
            StatementError: this type of statement has no ROS domain.
        """
        raise StatementError(f"--ros-domain-id {domain_id}: this contract has no ROS probe")

    def claimed(self, contract: Contract) -> tuple[str, ...]:
        """Return the classes to judge: those claimed, or, without claims, those whose interfaces all have an address.

        So a vendor who claims nothing is not judged more leniently than one who claims everything.
        """
        if self.claims is not None:
            return tuple(name for name in contract.classes if name in self.claims)
        lacking, described = self.lacking(contract), contract.interfaces
        judged = (item for name, item in contract.classes.items() if name not in lacking)
        return tuple(item.name for item in judged if any(one in described for one in item.interfaces))

    def lacking(self, contract: Contract) -> dict[str, tuple[Interface, ...]]:
        """Return the classes that are not judged although none were claimed, with the interfaces without an address."""
        if self.claims is not None:
            return {}
        there, described = self.endpoints.interfaces, contract.interfaces
        found = {name: item.missing(there, described) for name, item in contract.classes.items()}
        return {name: missing for name, missing in found.items() if missing}


class _Robot(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    name: str | int | float | None = None
    vendor: str | int | float | None = None
    version: str | int | float | None = None


class _Claims(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    profile: str | None = None
    classes: tuple[str, ...] | None = None

    def named(self, contract: Contract, path: Path) -> tuple[str, ...] | None:
        """Return the classes that are claimed by profile or name, or None if none are.

        Raises:
            StatementError: the contract has no such profile or class.
        """
        if self.profile is None and self.classes is None:
            return None
        profiles = contract.profiles
        if self.profile is not None and self.profile not in profiles:
            raise StatementError(f"{path}: [claims] profile = {self.profile!r} must be one of {', '.join(profiles)}")
        for index, name in enumerate(self.classes or ()):
            if name not in contract.classes:
                known = ", ".join(contract.classes)
                raise StatementError(f"{path}: [claims] classes[{index}] = {name!r} must be one of {known}")
        return (*(profiles[self.profile] if self.profile else ()), *(self.classes or ()))


class StatementFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The tables of a statement file. A pack extends it with its own tables."""

    robot: _Robot = _Robot()
    endpoints: Endpoints = Endpoints()
    claims: _Claims = _Claims()
    load: Load = Load()
    values: dict[str, tuple[Any, ...]] = {}
    calls: Calls = Calls()
    api: Api = Api()
    auth: Auth | None = None

    def read(self, contract: Contract, path: Path) -> Statement:
        """Return the statement.

        Raises:
            StatementError: it claims an unknown class or profile.
        """
        return Statement(**self.common(contract, path))

    def common(self, contract: Contract, path: Path) -> dict[str, Any]:
        """Return the attributes that every statement has, by name.

        Raises:
            StatementError: it claims an unknown class or profile.
        """
        robot = msgspec.structs.asdict(self.robot)
        return {
            "robot": {key: str(value) for key, value in robot.items() if value is not None},
            "endpoints": beside(path.parent, self.endpoints, self.auth),
            "claims": self.claims.named(contract, path),
            "load": self.load,
            "values": self.values,
            "calls": self.calls,
        }


def load_statement(path: Path, contract: Contract) -> Statement:
    """Read a statement. Files that it names (CA, token, WSDL) are relative to its folder.

    Raises:
        StatementError: it cannot be read, or has an unknown key or an invalid value.
        ContractError: the contract's plugin cannot be imported.
    """
    shape: type[StatementFile] = getattr(contract.plugin, "StatementFile", StatementFile)
    return read_toml(path, shape, StatementError).read(contract, path)


class _Addresses(msgspec.Struct, frozen=True):
    """The tables of a statement that say which contract the rest is read by."""

    api: Api = Api()
    endpoints: Endpoints = Endpoints()
    auth: Auth | None = None


def api_of(path: Path) -> Api:
    """Return the description that a statement names, files relative to the statement's folder.

    Raises:
        StatementError: the statement cannot be read, or this table is invalid.
    """
    api = read_toml(path, _Addresses, StatementError).api

    def beside_it(name: str) -> str:
        return name if "://" in name else str(path.parent / name)

    return Api(beside_it(api.openapi) if api.openapi else None, tuple(map(beside_it, api.overlays)), api.base_url)


def endpoints_of(path: Path) -> Endpoints:
    """Return the endpoints of a statement, files relative to the statement's folder.

    Raises:
        StatementError: the statement cannot be read, or this table is invalid.
    """
    found = read_toml(path, _Addresses, StatementError)
    return beside(path.parent, found.endpoints, found.auth)


def empty_statement(contract: Contract) -> Statement:
    """Return the statement of a vendor who declares nothing.

    Raises:
        ContractError: the contract's plugin cannot be imported.
    """
    found: Statement = getattr(contract.plugin, "Statement", Statement)()
    return found


def beside(folder: Path, where: Endpoints, auth: Auth | None = None) -> Endpoints:
    """Return endpoints, with a login, whose file names are relative to a folder; URLs stay unchanged."""
    files = [key for key in where.__struct_fields__ if key.endswith(("_file", "_wsdl"))]
    named = {key: getattr(where, key) for key in files}
    beside_it = {key: str(folder / name) for key, name in named.items() if name is not None and "://" not in name}
    auth = auth or where.auth
    if auth is not None and auth.body_file is not None:
        auth = msgspec.structs.replace(auth, body_file=str(folder / auth.body_file))
    return msgspec.structs.replace(where, auth=auth, **beside_it)
