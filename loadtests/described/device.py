"""A device with a description: its address, the operations that may be called, and the credentials."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Self

import click
import msgspec

from conformance.api.permission import Permission
from conformance.api.rest.interface import RestInterface
from conformance.contract.locating import ContractError
from conformance.contract.pack import Contract
from conformance.documents.description import DescriptionError, is_url
from conformance.documents.openapi import Operation, operations_of
from conformance.scenarios.scenario import NotPossibleError
from conformance.statement.endpoints import Endpoints
from conformance.statement.motion_calls import named_by
from conformance.statement.statement import Statement, StatementError, api_of
from conformance.target.connecting import connection_of
from conformance.target.describing import is_wsdl, soap_contract, trusting
from conformance.target.naming import DeviceOptions, split_args, targets_or_roaas_toml, what_is_judged
from conformance.transport.client import Connection, HttpClient
from conformance.transport.credentials import UsernameToken
from conformance.transport.exchange import NoAnswerError
from conformance.transport.reach import UnreachableError
from conformance.verdict.run import Run
from loadtests.clients.failures import CallError
from loadtests.clients.robot import Secrets
from loadtests.settings.settings import SettingsError

if TYPE_CHECKING:
    from conformance.scenarios.described_messages import DescribedMessages

#: Options that only a device with a description has, by their Python names.
DESCRIBED_ONLY = (
    "openapi", "wsdl", "schemas", "overlays", "base_url", "allow_files", "allow", "never", "basic_file", "digest_file",
    "username_token_file", "api_key", "api_key_file", "headers_file", "client_cert_file", "client_key_file",
    "client_key_passphrase_file", "streams", "stamp_field", "clock_field", "scenario", "operators",
)  # fmt: skip
#: Options with credentials, by their Python names.
CREDENTIALS = (
    "token_file", "basic_file", "digest_file", "username_token_file", "api_key", "api_key_file", "headers_file",
)  # fmt: skip


def secrets_of(options: Mapping[str, str | None]) -> Secrets:
    """Return what the options on credentials name, as a worker on another machine needs it.

    Raises:
        SettingsError: a file cannot be read, or is no such credential.
    """
    given = {name: value for name, value in options.items() if value}
    try:
        connection = connection_of(Endpoints(**given))  # type: ignore[arg-type] # they are texts
        user = UsernameToken.of(given.get("username_token_file"))
    except (StatementError, OSError, ValueError) as error:
        raise SettingsError(str(error)) from None
    return Secrets(connection.token, connection.credentials.items, user)


@dataclass(frozen=True)
class Named:
    """The arguments and options of a command that name a device.

    Attributes:
        source: URL or file of the description; None for the paper's robot.
        statement: the statement's file, or None.
        wsdl: URL or file of the WSDL beside an OpenAPI description, or None.
    """

    source: str | None
    statement: Path | None
    wsdl: str | None = None

    @property
    def sources(self) -> str:
        """Return the descriptions as the result names them: URLs, or names of files."""
        sources = filter(None, (self.source, self.wsdl))
        return " and ".join(source if is_url(source) else Path(source).name for source in sources)

    @classmethod
    def of(cls, targets: tuple[str, ...], options: Mapping[str, Any]) -> Self:
        """Return the device that a command's arguments and options name.

        Raises:
            SettingsError: two descriptions of one kind or two statements are named.
            StatementError: the statement cannot be read.
        """
        try:
            source, statement = split_args(targets_or_roaas_toml(targets, options), options["openapi"])
        except click.UsageError as error:
            raise SettingsError(error.message) from None
        wsdl = options["wsdl"]
        if source is not None and is_wsdl(source):
            if wsdl is not None:
                raise SettingsError(f"{source} and {wsdl} are several WSDLs: name one")
            source, wsdl = None, source
        if source is None and wsdl is None and statement is not None:
            api = api_of(statement)
            source, wsdl = api.openapi, api.wsdl
        return cls(source, statement, wsdl) if source is not None else cls(wsdl, statement)


@dataclass(frozen=True)
class Device:
    """A device with a description.

    Attributes:
        api: its interface, as the suite calls it.
        remarks: what a reader of the result should know.
        messages: makes the messages of a WSDL; None for a device with an OpenAPI description.
    """

    api: RestInterface
    remarks: tuple[str, ...]
    messages: "DescribedMessages | None" = None

    @property
    def interface(self) -> str:
        """Return `rest` or `soap`."""
        return "rest" if self.messages is None else "soap"

    @property
    def statement(self) -> Statement:
        """Return the statement, with the options applied."""
        return self.api.run.statement

    @classmethod
    def at(cls, named: Named, options: Mapping[str, Any]) -> Self:
        """Read a device's description and its statement. Nothing else is sent.

        Args:
            named: its description and statement.
            options: options of the command; they win over the statement.

        Raises:
            SettingsError: the description, the statement or a credential cannot be used.
            CallError: the server of the description does not respond.
        """
        try:
            with TemporaryDirectory(prefix="roaas-load-") as folder:
                wanted = DeviceOptions.of(options, out=Path(folder))
                statement, contract, remarks = what_is_judged(named.source, named.statement, wanted)
                run = Run(statement=statement, contract=contract, allow_motion=bool(options["allow_motion"]))
                return cls._open(run, connection_of(statement.endpoints), remarks)
        except (StatementError, ContractError, DescriptionError, NotPossibleError, OSError) as error:
            raise SettingsError(str(error)) from None
        except (UnreachableError, NoAnswerError) as error:
            raise CallError("refused", str(error)) from None

    @classmethod
    def _open(cls, run: Run, connection: Connection, remarks: tuple[str, ...]) -> Self:
        """Return a device while its contract's folder exists."""
        # xmlschema and lxml take a third of a second, which the paper's robot need not pay.
        from conformance.scenarios.described_messages import DescribedMessages  # noqa: PLC0415

        permission = Permission(run)
        connection.permit, connection.endless = permission.refusal, True
        api = RestInterface(run, HttpClient(run.statement.endpoints.rest or "", connection))
        permission.may_call_ports(api.client.base_url)
        operations_of(run.contract)  # the result is cached from now on
        return cls(api, remarks, DescribedMessages.of(api))

    def beside(self, wsdl: str, schemas: Path | None = None) -> Self:
        """Return the same device by its WSDL, with the same statement and credentials.

        Args:
            wsdl: URL or file of the WSDL.
            schemas: folder with schemas that its references do not lead to, or None.

        Raises:
            SettingsError: the WSDL cannot be used.
            CallError: its server does not respond.
        """
        said, known = self.statement, self.api.client.connection
        connection = replace(known, permit=lambda *_: "", trust=trusting(known, wsdl))
        where = msgspec.structs.replace(said.endpoints, rest=None)
        try:
            with TemporaryDirectory(prefix="roaas-load-") as folder:
                contract, where, remarks = soap_contract(wsdl, None, where, connection, Path(folder), schemas=schemas)
                statement = msgspec.structs.replace(said, endpoints=where, motion_map=None)
                run = Run(statement=statement, contract=contract, allow_motion=self.api.run.allow_motion)
                return self._open(run, connection, remarks)
        except (ContractError, DescriptionError, NotPossibleError, OSError) as error:
            raise SettingsError(str(error)) from None
        except (UnreachableError, NoAnswerError) as error:
            raise CallError("refused", str(error)) from None

    def name_of(self, operation: Operation) -> str:
        """Return an operation's name in the result: method and path, or a WSDL operation's name if it is unique."""
        if self.messages is None or sum(each.id == operation.id for each in operations_of(self.contract)) > 1:
            return operation.label
        return operation.id

    def is_moved_by(self, operation: Operation) -> bool:
        """Return whether the motion map of the statement commands the device by an operation."""
        motion = self.statement.motion_map
        return motion is not None and operation.label in named_by(
            [call for call, _ in motion.bodies], [operation.label]
        )

    def half(self, name: str) -> str:
        """Return this device's operation of a pair in [load.pairs]; any other name unchanged."""
        pair = self.statement.load.pairs.get(name)
        return name if pair is None else pair.rest if self.messages is None else pair.soap

    @property
    def contract(self) -> Contract:
        """Return the contract that the description makes."""
        return self.api.run.contract
