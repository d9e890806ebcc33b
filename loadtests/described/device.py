"""A device with a description: what it is called by, what may be called, and with which credentials."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Self

import click

from conformance.api.permission import Permission
from conformance.api.rest.interface import RestInterface
from conformance.cli.certify_target import told_apart, what_is_judged
from conformance.contract.locating import ContractError
from conformance.contract.pack import DEFAULT_PACK, Contract
from conformance.documents.description import DescriptionError
from conformance.documents.openapi import operations_of
from conformance.engine.connecting import connection_of
from conformance.engine.describing import UnreachableError, is_wsdl
from conformance.statement.endpoints import Endpoints
from conformance.statement.statement import Statement, StatementError, api_of
from conformance.transport.client import HttpClient
from conformance.verdict.run import Run
from loadtests.clients.failures import CallError
from loadtests.clients.robot import Secrets
from loadtests.settings.errors import SettingsError

#: Options, by their names in Python, that a device with a description alone has.
DESCRIBED_ONLY = (
    "openapi", "wsdl", "overlays", "base_url", "allow", "never", "basic_file", "digest_file", "api_key", "api_key_file",
    "headers_file", "client_cert_file", "client_key_file", "streams", "stamp_field", "clock_field",
    "scenario",
)  # fmt: skip
#: The credentials in options, by their names in Python.
CREDENTIALS = ("token_file", "basic_file", "digest_file", "api_key", "api_key_file", "headers_file")


def secrets_of(options: Mapping[str, str | None]) -> Secrets:
    """Return what the options on credentials name, as a worker on another machine needs it.

    Raises:
        SettingsError: a file cannot be read, or is no such credential.
    """
    given = {name: value for name, value in options.items() if value}
    try:
        connection = connection_of(Endpoints(**given))  # type: ignore[arg-type] # they are texts
    except (StatementError, OSError) as error:
        raise SettingsError(str(error)) from None
    return Secrets(connection.token, connection.credentials.items)


@dataclass(frozen=True)
class Named:
    """What a command names.

    Attributes:
        source: URL or file of the description; None for the paper's robot.
        statement: the statement's file, or None.
    """

    source: str | None
    statement: Path | None

    @classmethod
    def of(cls, targets: tuple[str, ...], options: Mapping[str, Any]) -> Self:
        """Return what the arguments and options of a command name.

        Raises:
            SettingsError: two descriptions or two statements are named, or a WSDL.
            StatementError: the statement cannot be read.
        """
        try:
            source, statement = told_apart(targets, options["openapi"] or options["wsdl"])
        except click.UsageError as error:
            raise SettingsError(error.message) from None
        api = api_of(statement) if statement is not None else None
        source = source or (api.openapi or api.wsdl if api else None)
        if source is not None and (is_wsdl(source) or source in {options["wsdl"], api.wsdl if api else None}):
            raise SettingsError(f"{source} is a WSDL: so far, only operations of an OpenAPI description are measured")
        return cls(source, statement)


@dataclass(frozen=True)
class Device:
    """A device with a description.

    Attributes:
        api: its REST interface, as the suite calls it.
        remarks: what a reader of the result should know.
    """

    api: RestInterface
    remarks: tuple[str, ...]

    @property
    def statement(self) -> Statement:
        """Return the statement, with the options applied."""
        return self.api.run.statement

    @classmethod
    def at(cls, named: Named, options: Mapping[str, Any]) -> Self:
        """Read a device's description and its statement. Nothing else is sent.

        Args:
            named: its description and statement.
            options: of the command; they win over the statement.

        Raises:
            SettingsError: the description, the statement or a credential cannot be used.
            CallError: the server of the description does not respond.
        """
        own = {"pack": DEFAULT_PACK, "profile": None, "classes": (), "ros_domain_id": None}
        try:
            with TemporaryDirectory(prefix="roaas-load-") as folder:
                taken: dict[str, Any] = {**options, **own, "out": Path(folder)}
                statement, contract = what_is_judged(named.source, named.statement, taken)
                run = Run(statement=statement, contract=contract, allow_motion=bool(options["allow_motion"]))
                connection = connection_of(statement.endpoints)
                connection.permit, connection.endless = Permission(run).refusal, True
                api = RestInterface(run, HttpClient(statement.endpoints.rest or "", connection))
                operations_of(contract)  # read while the folder is there
        except (StatementError, ContractError, DescriptionError, OSError) as error:
            raise SettingsError(str(error)) from None
        except UnreachableError as error:
            raise CallError("refused", str(error)) from None
        return cls(api, taken.get("remarks", ()))

    @property
    def contract(self) -> Contract:
        """Return the contract that the description makes."""
        return self.api.run.contract
