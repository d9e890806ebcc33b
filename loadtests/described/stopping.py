"""The end of a run that may have moved a device: it is stopped, and its rest is awaited."""

from typing import Self

import click

from conformance.api.rest.stops import stop_device
from conformance.scenarios.motion.binding import binding_of
from conformance.scenarios.motion.mapped import MappedDevice
from conformance.scenarios.scenario import NotPossibleError
from conformance.transport.exchange import NoAnswerError
from loadtests.clients.failures import CallError
from loadtests.described.device import Device
from loadtests.settings.errors import SettingsError


class Stopping:
    """Stops a device that the run may move.

    Args:
        device: the device.
        mapped: the device by its motion map, which tells whether it rests; None: it has no map, or may not be moved.
    """

    def __init__(self, device: Device, mapped: MappedDevice | None) -> None:
        self._device, self._mapped = device, mapped

    @classmethod
    def of(cls, device: Device) -> Self:
        """Read where a device is, before anything moves it: a device that nobody sees is not moved.

        Raises:
            SettingsError: its motion map does not show where it is.
            CallError: it does not respond.
        """
        motion = device.statement.motion_map
        if motion is None or not device.api.run.allow_motion:
            return cls(device, None)
        try:
            return cls(device, MappedDevice(device.api, motion, binding=binding_of(device.api)))
        except NotPossibleError as error:
            raise SettingsError(f"[motion]: {error}") from None
        except NoAnswerError as none:
            raise CallError("closed", str(none)) from None

    def stop(self) -> str:
        """Stop the device, as a certification does; return why it may still move, or an empty text."""
        return stop_device(self._device.api, lambda line: click.echo(f"roaas load: {line}", err=True))
