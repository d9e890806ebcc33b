"""The REST interface of a device in one run."""

from collections.abc import Callable
from dataclasses import dataclass, field

from conformance.api.device import Device, device_of
from conformance.contract.pack import Contract
from conformance.transport.client import HttpClient
from conformance.verdict.run import Run


@dataclass
class RestInterface:
    """What generic checks over HTTP need.

    Attributes:
        run: what is judged, and by what.
        client: sends the requests.
        alive: whether the robot answers HTTP at all, asked anew.
        device: what the contract pack knows of it.
        small_numbers: by operation, the text for its numbers with which it was found to be answered; empty: the
            example's own.
        waits: how often a read is still sent again that the robot puts off for a moment.
    """

    run: Run
    client: HttpClient
    alive: Callable[[], bool] = lambda: True
    small_numbers: dict[str, str] = field(default_factory=dict)
    waits: int = 5
    device: Device = field(init=False)

    def __post_init__(self) -> None:
        self.device = device_of(self.run)

    @property
    def path(self) -> str:
        """A path that can be read without parameters."""
        return plain_path(self.run.contract)


def plain_path(contract: Contract) -> str:
    """A path that a contract lets be read without parameters, for asking whether a robot is there."""
    for path, operations in contract.openapi.get("paths", {}).items():
        if "get" in operations and "{" not in path and not operations["get"].get("x-roaas-optional"):
            return str(path)
    return "/"
