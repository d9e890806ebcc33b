"""A device and a clock of a test that the suite's own scenarios play with, without a run of the command."""

from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

from small_device import contract_of, small_device

from conformance.api.rest.interface import RestInterface
from conformance.contract.pack import Contract
from conformance.statement.endpoints import Endpoints
from conformance.statement.statement import Calls, Statement
from conformance.transport.client import Connection, HttpClient
from conformance.transport.exchange import Exchange, Listener
from conformance.verdict.effort import Effort
from conformance.verdict.run import Run


class SimulatedClock:
    """A clock whose time advances only by sleep().

    Attributes:
        time_s: the time, s.
    """

    def __init__(self, time_s: float = 100.0) -> None:
        self.time_s = time_s

    def now(self) -> float:
        """Return the time, s."""
        return self.time_s

    def sleep(self, seconds: float) -> None:
        """Advance the time."""
        self.time_s += max(0.0, seconds)


class Kept(Listener):
    """Keeps each exchange."""

    def __init__(self) -> None:
        self.exchanges: list[Exchange] = []

    def on_response(self, exchange: Exchange) -> None:
        """Keep an exchange."""
        self.exchanges.append(exchange)


@contextmanager
def driven(description: Any, routes: Any, folder: Path) -> Iterator[tuple[RestInterface, Contract, Kept]]:
    """Serve a device that lets a run call all; yields its interface at effort quick, its contract, and what is sent."""
    contract = contract_of(folder, description)
    with small_device(description, routes) as url, closing(HttpClient(url, Connection(timeout_s=30.0))) as client:
        allowed = Calls(allow=("POST *", "PUT *", "PATCH *", "DELETE *"))
        statement = Statement(endpoints=Endpoints(rest=url), calls=allowed)
        run = Run(statement=statement, contract=contract, effort=Effort("quick"))
        client.connection.listeners.append(kept := Kept())
        yield RestInterface(run, client, alive=lambda: True), contract, kept
