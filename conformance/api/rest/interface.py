"""The REST interface of a device in one run."""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from conformance.api.call_rules import CallRules
from conformance.api.device import Device, device_of
from conformance.api.rest.driven import Driven
from conformance.contract.pack import Contract
from conformance.documents.openapi import operations_of
from conformance.transport.client import HttpClient
from conformance.transport.exchange import Attempt, Exchange, Outgoing
from conformance.transport.parallel import send_together
from conformance.verdict.run import Run


@dataclass
class RestInterface:
    """A device's REST interface as generic checks use it: description, client, values and permissions.

    Attributes:
        run: the data of the run.
        client: sends requests.
        alive: sends a request, and returns whether the robot responds.
        device: the contract pack's model of the device.
        small_numbers: by operation, the number that the robot accepts for its numeric parameters; empty: the example's.
        waits: how many more deferred reads may be repeated.
        working: requests that the survey of a described API found to be answered 2xx, by operation.
        first: the usual exchange of each of these operations at the beginning of the run.
        usual_status: status of the survey's last usual request to each operation; 0 without a response.
        refused: requests that the survey of a described API found to be refused, by status and operation.
        single: whether each operation that creates refuses the same request the second time.
        reads: how often each operation that reads was answered.
        judged: requests that only read, which were sent as allowed or forbidden values.
        streams: operations whose responses do not end.
        slow: operations that once took more than a second to respond.
        stop_device: stops a device by its motion map, and returns why it may still move, or an empty text; None: it has
            no map, or may not be moved.
        preparation: what keeps the device ready to move, for all that move it by its map; None if nothing has moved it.
        values: what the survey of a described API knows for parameters and bodies, or None.
        looked: the exchanges by which the run has connected, before anything observed them.
        server: the Server field of the first response that had one; empty if none had.
        is_shut_out: whether the device has refused the suite for too many wrong credentials.
        driven: by which values the run has named what it may have moved; None if the pack knows how it stops.
        left: what the run has created and changed on a described device; None if nobody follows that.
        is_recorded: whether the present exchange is recorded by a scenario, whose rules judge it.
    """

    run: Run
    client: HttpClient
    alive: Callable[[], bool] = lambda: True
    small_numbers: dict[str, str] = field(default_factory=dict)
    waits: int = 5
    working: dict[str, Any] = field(default_factory=dict)
    first: dict[str, Exchange] = field(default_factory=dict)
    usual_status: dict[str, int] = field(default_factory=dict)
    refused: dict[tuple[int, str], Any] = field(default_factory=dict)
    single: dict[str, bool] = field(default_factory=dict)
    reads: Counter[str] = field(default_factory=Counter)
    judged: set[Outgoing] = field(default_factory=set)
    streams: set[str] = field(default_factory=set)
    slow: set[str] = field(default_factory=set)
    stop_device: Callable[[], str] | None = None
    preparation: Any = None
    values: Any = None
    left: Any = None
    looked: list[Exchange] = field(default_factory=list)
    server: str = ""
    is_recorded: bool = False
    is_shut_out: bool = False
    device: Device = field(init=False)
    driven: Driven | None = field(init=False, default=None)

    def __post_init__(self) -> None:
        self.device = device_of(self.run)
        if not self.device.is_known:
            self.driven = Driven(self.run.contract, self.client.base_url)
            self.client.connection.listeners.append(self.driven)

    @cached_property
    def call_rules(self) -> CallRules:
        """Return the rules on which operations may be called."""
        return CallRules.of(self.run)

    def send(self, request: Outgoing, *, fresh: bool = False, timeout_s: float | None = None) -> Exchange:
        """Send a request; PUT and DELETE on a connection of their own.

        Clients send those again when a kept connection ends (RFC 9112 9.3.1), which hides a device that hangs up.

        Args:
            request: the request.
            fresh: on a connection of its own.
            timeout_s: deadline instead of the run's, s.

        Raises:
            NoAnswerError: no HTTP response was received.
        """
        return self.client.send(
            request.method,
            request.target,
            headers=request.headers,
            body=request.body,
            fresh=fresh or request.method in {"PUT", "DELETE"},
            timeout_s=timeout_s,
        )

    def send_together(self, requests: Sequence[Outgoing]) -> list[Attempt]:
        """Send requests at the same moment, each from a client of its own; see `transport.parallel`."""
        return send_together([[(self.client, request) for request in requests]])[0]

    @property
    def path(self) -> str:
        """A path for GET without parameters."""
        return plain_path(self.run.contract, self.call_rules)


def plain_path(contract: Contract, rules: CallRules) -> str:
    """Return a path for GET to check whether a device responds; "/" if there is none.

    It has no required parameters, is harmless, is no stream, and each device has it.
    """
    for operation in operations_of(contract):
        required = any(item.required for item in operation.parameters)
        streams = any(name.startswith(("text/event-stream", "multipart/", "video/")) for name in operation.formats)
        named = operation.method == "GET" and not (required or streams or operation.optional)
        if named and rules.decide(operation).may:
            return operation.template
    return "/"
