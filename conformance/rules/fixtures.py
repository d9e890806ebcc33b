"""pytest fixtures of every run: the checkers, which judge each exchange of every check."""

import importlib
import threading
from collections.abc import Iterable, Iterator
from contextlib import suppress
from typing import Final

import pytest

from conformance.api.device import device_of
from conformance.api.interfaces import Interfaces
from conformance.api.rest.description import KeptExchanges
from conformance.api.rest.habits import Habits
from conformance.api.rest.references import collections_of
from conformance.api.rest.values import Values
from conformance.api.soap.resources import resources_of
from conformance.api.soap.service import SoapService
from conformance.checkers.rest import RestCheckers
from conformance.checkers.soap import PASSIVE, SoapCheckers, answers_of
from conformance.checkers.soap_memory import SoapThings
from conformance.documents.openapi import operations_of
from conformance.documents.wsdl import Wsdl
from conformance.scenarios.motion.binding import binding_of
from conformance.scenarios.motion.mapped import MappedDevice
from conformance.scenarios.other_exchanges import OtherExchanges
from conformance.scenarios.ros.gateway import Gateway
from conformance.scenarios.scenario import NotPossibleError
from conformance.statement.motion_map import MotionMap
from conformance.statement.ros_map import RosMap
from conformance.statement.state_map import StateMap
from conformance.transport.client import Connection
from conformance.transport.exchange import Listener
from conformance.verdict.evidence import Checker, CheckerListener
from conformance.verdict.run import Run

# Wait for the modules that later checks need, s.
_PREPARES_S: Final = 30.0
# Modules that are imported late because few commands need them; the second one in longer runs alone.
_NEEDED_LATER: Final = ("jsonschema", "schemathesis.specs.openapi")


@pytest.fixture(scope="session", autouse=True)
def _attach_checkers(
    run: Run,
    interfaces: Interfaces,
    connection: Connection,
    other_exchanges: OtherExchanges | None,
    kept_exchanges: KeptExchanges | None,
) -> None:
    """Register the checkers before the first request, so that they judge every exchange of the run.

    No other code registers any.
    """
    services = interfaces.soap.there.values()
    api = interfaces.rest
    device = api.device if api is not None else device_of(run)
    checkers: list[Checker] = []
    listeners: list[Listener] = [CheckerListener(run.judge, device.checkers(api, services), by_rule=False)]
    if api is not None:
        elsewhere = [service.endpoint for service in services]
        checkers += [Habits(api), RestCheckers(run.contract, api.client.base_url, elsewhere)]
        listeners += device.listeners(api)
        listeners += [one for one in (other_exchanges, kept_exchanges) if one is not None]
    if services and not run.contract.ledger.keys().isdisjoint(PASSIVE):
        answers = {service.endpoint: answers_of(*_descriptions(service)) for service in services}
        checkers.append(SoapCheckers(answers))
    if (resources := resources_of(run.contract)) is not None:
        checkers.append(SoapThings(resources))
    listeners.append(CheckerListener(run.judge, checkers))
    connection.listeners.extend(listeners)
    for exchange in api.looked if api is not None else ():
        for listener in listeners:
            listener.on_response(exchange)


def _descriptions(service: SoapService) -> Iterator[Wsdl]:
    """Yield the robot's and the contract's description of a service."""
    if service.own is not None:
        yield service.own
    if service.contract_wsdl_path is not None:
        yield service.contract


@pytest.fixture(scope="session")
def other_exchanges(run: Run, interfaces: Interfaces) -> OtherExchanges | None:
    """Return the keeper of exchanges that no scenario records; None if no rule needs them."""
    asked = not run.contract.ledger.keys().isdisjoint({"description/status-declared", "robustness/no-server-error"})
    return OtherExchanges(interfaces.rest) if asked and interfaces.rest else None


@pytest.fixture(scope="session")
def kept_exchanges(run: Run, interfaces: Interfaces) -> KeptExchanges | None:
    """Return the keeper of exchanges that are compared with the robot's own description; None if no rule needs them."""
    asked = "describe/openapi-answers" in run.contract.ledger
    return KeptExchanges(interfaces.rest) if asked and interfaces.rest else None


@pytest.fixture(scope="session")
def values(run: Run) -> Values:
    """Return the values that the run knows for parameters and bodies: the user's, and those seen in responses."""
    operations = operations_of(run.contract) if run.contract.openapi_path else ()
    return Values(run.statement.values, collections_of(operations))


@pytest.fixture(scope="session")
def motion(run: Run) -> MotionMap:
    """Return the motion map; its class is judged only if there is one."""
    if run.statement.motion_map is None:
        raise NotPossibleError("the statement has no motion map")
    return run.statement.motion_map


@pytest.fixture(scope="session")
def mapped(interfaces: Interfaces, motion: MotionMap) -> MappedDevice:
    """Return the device that is moved by its map."""
    if interfaces.rest is None:
        raise NotPossibleError("the device has no REST interface")
    return MappedDevice(interfaces.rest, motion, binding=binding_of(interfaces.rest))


@pytest.fixture(scope="session")
def state_map(run: Run) -> StateMap:
    """Return the state map; its class is judged only if there is one."""
    if run.statement.state_map is None:
        raise NotPossibleError("the statement has no state map")
    return run.statement.state_map


@pytest.fixture(scope="session")
def ros(run: Run) -> RosMap:
    """Return the ROS map; its class is judged only if there is one."""
    if run.statement.ros_map is None or not run.ros:
        raise NotPossibleError("a gateway is judged with --ros or --ros-play, by the table [ros] of its statement")
    return run.statement.ros_map


@pytest.fixture(scope="session")
def gateway(run: Run, interfaces: Interfaces, ros: RosMap) -> Iterator[Gateway]:
    """Yield the gateway with both of its ends."""
    if interfaces.rest is None:
        raise NotPossibleError("the device has no REST interface")
    found = Gateway(run, interfaces.rest, binding_of(interfaces.rest), ros)
    yield found
    found.close()


@pytest.fixture
def _import_early(interfaces: Interfaces, run: Run) -> Iterator[None]:
    """Import modules that later checks need in a background thread, while the current check waits for the robot."""
    services = tuple(interfaces.soap.there.values())
    for service in services:
        _ = service.own  # may send requests: here, and not at any moment of a drive
    # A signal during an import may leave its lock held: then this thread never ends.
    thread = threading.Thread(target=_prepare, args=(services, run), name="preparing", daemon=True)
    thread.start()
    yield
    thread.join(_PREPARES_S)


def _prepare(services: Iterable[SoapService], run: Run) -> None:
    # A failure here happens again in the check that needs the value, and is judged there.
    with suppress(Exception):
        for service in services:
            _ = service.description.types, service.contract.types
            importlib.import_module("conformance.api.soap.zeep_client")
        for module in _NEEDED_LATER[: 1 if run.effort.name == "quick" else None]:
            importlib.import_module(module)
        if run.prepare is not None:
            run.prepare()
