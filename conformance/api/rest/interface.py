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
        alive: sends a request, and returns whether the robot responds to HTTP at all.
        device: what the contract pack knows of it.
        small_numbers: by operation, the text for its numbers with which the robot accepts it; empty: the example's own.
        waits: how many more reads that the robot puts off for a moment are sent again.
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
    """Return a path that a contract lets be read without parameters, for asking whether a robot is there."""
    for path, operations in contract.openapi.get("paths", {}).items():
        if "get" in operations and "{" not in path and not operations["get"].get("x-roaas-optional"):
            return str(path)
    return "/"
