"""A device of a test that the suite's own scenarios play with, without a run of the command; and all that was sent."""

from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

from small_device import small_device

from conformance.api.rest.interface import RestInterface
from conformance.contract.described import write_described_pack
from conformance.contract.pack import Contract
from conformance.statement.endpoints import Endpoints
from conformance.statement.statement import Calls, Statement
from conformance.transport.client import Connection, HttpClient
from conformance.transport.exchange import Exchange, Listener
from conformance.verdict.effort import Effort
from conformance.verdict.run import Run


class Kept(Listener):
    """Keeps each exchange."""

    def __init__(self) -> None:
        self.exchanges: list[Exchange] = []

    def answered(self, exchange: Exchange) -> None:
        """Keep an exchange."""
        self.exchanges.append(exchange)


@contextmanager
def driven(description: Any, routes: Any, folder: Path) -> Iterator[tuple[RestInterface, Contract, Kept]]:
    """Serve a device that lets a run call all; yields its interface at effort quick, its contract, and what is sent."""
    contract = Contract.load(write_described_pack(folder, description, description))
    with small_device(description, routes) as url, closing(HttpClient(url, Connection(timeout_s=30.0))) as client:
        allowed = Calls(allow=("POST *", "PUT *", "PATCH *", "DELETE *"))
        statement = Statement(endpoints=Endpoints(rest=url), calls=allowed)
        run = Run(statement=statement, contract=contract, effort=Effort("quick"))
        client.connection.listeners.append(kept := Kept())
        yield RestInterface(run, client, alive=lambda: True), contract, kept
