"""One robot's REST interface in one run: where requests go, what answers are judged by, and what its domain adds."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

from conformance.contract.files import Contract
from conformance.transport.client import HttpClient
from conformance.verdict.run import Run


class Domain(Protocol):
    """What only the robot's own domain knows: which values make sense to it."""

    def fit(self, operation_id: str, value: Any) -> Any:
        """A valid value of an operation (its body, or its parameters by name) with what makes sense to this robot."""


@dataclass
class RestInterface:
    """What generic checks over HTTP need.

    Attributes:
        run: what is judged, and by what.
        client: sends the requests.
        alive: whether the robot answers HTTP at all, asked anew.
        domain: of the robot; None where the contract is not RoAAS's own.
        small_numbers: by operation, the text for its numbers with which it was found to be answered; empty: the
            example's own.
        waits: how often a read is still sent again that the robot puts off for a moment.
    """

    run: Run
    client: HttpClient
    alive: Callable[[], bool] = lambda: True
    domain: Domain | None = None
    small_numbers: dict[str, str] = field(default_factory=dict)
    waits: int = 5

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
