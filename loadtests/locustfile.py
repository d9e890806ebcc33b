"""Users for plain Locust, with its web UI: `locust -f loadtests/locustfile.py --rest URL`.

Closed-model users of both interfaces, with wire and library clients, as many of each as the web UI asks for. Locust's
buckets of whole milliseconds are replaced by microseconds, because a robot responds in less than one. For reliable
figures (open model, alternating blocks, intervals) use `roaas load`.
"""

from typing import Any

import locust.stats
from locust import User, constant_throughput, events, tag, task
from locust.exception import StopTest

from conformance.documents.wsdl import WsdlError
from conformance.papers_robot.statement import RobotStatement
from loadtests.clients.callers import Caller, Workload
from loadtests.clients.endpoint import EndpointError
from loadtests.clients.failures import CallError
from loadtests.clients.library import read_document
from loadtests.clients.payloads import CATALOGUE, VARIANTS
from loadtests.clients.wire import now_ns
from loadtests.clients.wsdl import with_addresses
from loadtests.settings.settings import CliOptions, Settings, SettingsError
from loadtests.settings.settle import settle

OPERATIONS = tuple(CATALOGUE)
_TEXTS = ("rest", "publishers-wsdl", "subscribers-wsdl", "publishers-endpoint", "subscribers-endpoint")
_FILES = ("token-file", "ca-file")


def microseconds(response_time_ms: float) -> float:
    """Return the bucket of a response time for Locust: whole microseconds, in ms."""
    return round(response_time_ms, 3)


locust.stats.bucket_response_time = microseconds  # type: ignore[assignment]  # floats are keys as good as ints


@events.init_command_line_parser.add_listener  # type: ignore[untyped-decorator]  # Locust is typed in part
def add_options(parser: Any) -> None:
    """Add our options to Locust's own; the token's file does not appear in the web UI."""
    for name in _TEXTS:
        parser.add_argument(f"--{name}", env_var=f"ROAAS_{name.upper().replace('-', '_')}", default="")
    for name in _FILES:
        parser.add_argument(
            f"--{name}", env_var=f"ROAAS_{name.upper().replace('-', '_')}", default="", include_in_web_ui=False
        )
    parser.add_argument("--robot-timeout", type=float, default=10.0)
    parser.add_argument("--allow-motion", action="store_true", help="The robot may drive: deliveries too.")


class _Events:
    """Records into Locust's request event, in place of a recorder."""

    def __init__(self, environment: Any, workload: Workload) -> None:
        self._environment = environment
        self._workload = workload
        self.label = ("", "")

    def record(self, _: int, operation: int, due: int, start: int, *moments: int, noticed: int) -> None:
        """Record a success; the moments are built, received, done and the server's time."""
        del due, noticed
        self._fire(operation, (moments[2] - start) / 1e6, None)

    def failed(self, _: int, operation: int, error: CallError, due_ns: int, start_ns: int) -> None:
        """Record a failure."""
        del start_ns
        self._fire(operation, (now_ns() - due_ns) / 1e6, error)

    def count(self, name: str) -> None:
        """Ignore connections: Locust does not count them."""

    def _fire(self, operation: int, time_ms: float, error: CallError | None) -> None:
        interface, client = self.label
        name = self._workload.operations[operation]
        self._environment.events.request.fire(
            request_type=CATALOGUE[name].method if interface == "rest" else "SOAP",
            name=f"{name} {interface} {client}",
            response_time=time_ms,
            response_length=0,
            exception=error,
            context={},
        )


def settings_of(options: Any) -> Settings:
    """Return settings from Locust's options, checked as `roaas load` checks its own.

    Raises:
        SettingsError: the options do not make a run.
    """
    names = [name.replace("-", "_") for name in (*_TEXTS, *_FILES)]
    given = {name: getattr(options, name) for name in names}
    return settle(
        CliOptions.of(**given, timeout_s=options.robot_timeout, allow_motion=options.allow_motion), RobotStatement()
    )


def workload_of(options: Any) -> Workload:
    """Return the data that all users share: requests built beforehand, parsed WSDLs.

    Raises:
        StopTest: the options do not make a run; the message says why.
    """
    try:
        (robot,), _ = with_addresses(settings_of(options).robot)
        locations = {name: robot.wsdl(name) for name in CATALOGUE}
        documents = {name: read_document(location, robot) for name, location in locations.items() if location}
    except (SettingsError, WsdlError, CallError, EndpointError) as error:
        raise StopTest(f"cannot begin: {error}") from None
    return Workload(robot, OPERATIONS, 1, documents)


class RobotUser(User):
    """A user who calls an operation once a second, over one interface with one client."""

    abstract = True
    wait_time = constant_throughput(1)
    interface = "rest"
    client = "wire"

    def on_start(self) -> None:
        """Share the process's workload; the first user builds it."""
        environment = self.environment
        if not hasattr(environment, "roaas_workload"):
            environment.roaas_workload = workload_of(environment.parsed_options)
        self._sink = _Events(environment, environment.roaas_workload)
        self._sink.label = (self.interface, self.client)
        self._caller = Caller(environment.roaas_workload, self._sink)
        self._turn = 0

    def on_stop(self) -> None:
        """Close the connections."""
        self._caller.close()

    def call(self, operation: str) -> None:
        """Send one request, unless the robot must not move or does not offer the operation."""
        options, workload = self.environment.parsed_options, self.environment.roaas_workload
        moves = CATALOGUE[operation].code is not None
        if (moves and not options.allow_motion) or not workload.robot.offers(self.interface, self.client, operation):
            return
        self._turn += 1
        self._caller.perform(
            0, self.interface, self.client, OPERATIONS.index(operation), self._turn % VARIANTS, now_ns()
        )

    @tag("pose")
    @task(2)
    def pose(self) -> None:
        """Request the pose."""
        self.call("pose")

    @tag("delivery")
    @task
    def delivery(self) -> None:
        """Request a courier delivery."""
        self.call("delivery")

    @tag("coffee")
    @task
    def coffee(self) -> None:
        """Request a coffee."""
        self.call("coffee")


class RestWireUser(RobotUser):
    """REST by the wire client."""


class SoapWireUser(RobotUser):
    """SOAP by the wire client."""

    interface = "soap"


class RestOrdinaryUser(RobotUser):
    """REST by the requests library."""

    client = "zeep"


class SoapZeepUser(RobotUser):
    """SOAP by zeep."""

    interface = "soap"
    client = "zeep"
