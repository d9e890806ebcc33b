"""The end of a run that may have moved a device: it is stopped, and its rest is awaited."""

from pathlib import Path
from typing import Self

import click
import msgspec

from conformance.api.rest.guard import Guard
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.stops import stop_device
from conformance.contract.pack import Contract
from conformance.scenarios.motion.binding import binding_of
from conformance.scenarios.motion.mapped import MappedDevice
from conformance.scenarios.scenario import NotPossibleError
from conformance.statement.statement import empty_statement
from conformance.transport.client import Connection, HttpClient
from conformance.transport.exchange import NoAnswerError
from conformance.verdict.run import Run
from loadtests.clients.failures import CallError
from loadtests.clients.robot import Robot
from loadtests.described.device import Device
from loadtests.settings.settings import SettingsError


class Stopping:
    """Stops a device that the run may move; a guard process does if this process is killed.

    Args:
        api: the device.
    """

    def __init__(self, api: RestInterface) -> None:
        self._api, self._guard = api, Guard(api)
        if api.run.allow_motion or api.call_rules.allow:
            api.client.connection.before_sending = self._guard.before_sending

    @classmethod
    def of(cls, device: Device) -> Self:
        """Read where a device is, before anything moves it: a device that nobody sees is not moved.

        Raises:
            SettingsError: its motion map does not show where it is.
            CallError: it does not respond.
        """
        motion = device.statement.motion_map
        try:
            if motion is not None and device.api.run.allow_motion:
                MappedDevice(device.api, motion, binding=binding_of(device.api))
        except NotPossibleError as error:
            raise SettingsError(f"[motion]: {error}") from None
        except NoAnswerError as none:
            raise CallError("closed", str(none)) from None
        return cls(device.api)

    @classmethod
    def of_papers_robot(cls, robot: Robot) -> Self:
        """Return what stops a robot with the paper's interface: its goal is cancelled, and it gets velocity 0."""
        contract = Contract.load()
        statement = empty_statement(contract)
        endpoints = msgspec.structs.replace(statement.endpoints, rest=robot.rest)
        run = Run(msgspec.structs.replace(statement, endpoints=endpoints), contract, allow_motion=True)
        connection = Connection(ca_file=Path(robot.ca_file) if robot.ca_file else None, token=robot.token)
        return cls(RestInterface(run, HttpClient(robot.rest or "", connection)))

    def guarded(self) -> int | None:
        """Start the guard; return the descriptor that the processes which send the load inherit, if there is a guard.

        The guard stops the device when all of them have ended.
        """
        return self._guard.start() if self._api.run.allow_motion or self._api.call_rules.allow else None

    def stop(self) -> str:
        """Stop the device, as a certification does; return why it may still move, or an empty text."""
        problem = stop_device(self._api, lambda line: click.echo(f"roaas load: {line}", err=True))
        self._guard.release(stopped=not problem)
        return problem
