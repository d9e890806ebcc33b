"""What one run of the suite knows: the robot, what is claimed of it, and what has been found so far."""

from __future__ import annotations

import statistics
import time
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from conformance.contract.files import Contract
from conformance.contract.statement import Statement
from conformance.transport.client import Connection, HttpClient
from conformance.transport.exchange import NoAnswer, NoAnswerError
from conformance.verdict.effort import Effort
from conformance.verdict.evidence import Judge

if TYPE_CHECKING:
    from conformance.soap.service import SoapService

# How long a robot that stopped answering is given to come back before the rest of the run is called off, s.
_GRACE_S = 3.0
# How many answers tell how fast a robot usually is.
_LOOKS = 3
# The interfaces that a class needs; those of "any" need one of the three, those of "all" each that the contract has.
INTERFACES: dict[str, tuple[str, ...]] = {
    "rest-resources": ("rest",),
    "rest-delivery": ("rest",),
    "rest-formats": ("rest",),
    "http": ("rest",),
    "safety": ("rest",),
    "soap-delivery": ("publishers",),
    "soap-subscribers": ("subscribers",),
    "soap-basic-profile": ("any-soap",),
    "strict-input": ("all",),
    "xml-security": ("any",),
    "equivalence": ("rest", "publishers"),
    "describe": ("all",),
}


@dataclass
class Session:
    """One run.

    Attributes:
        statement: what the vendor says, options applied.
        contract: what the robot is judged by.
        claims: the classes that are judged.
        allow_motion: whether the robot may be moved.
        seed: of everything random.
        effort: how much is tried.
        connection: deadline, credentials and listeners of all clients.
        judge: what has been found.
        aborted: why the robot cannot be asked any more, or empty.
        unreachable: why an interface was not reached at the start, by its name.
    """

    statement: Statement = field(default_factory=Statement)
    contract: Contract = field(default_factory=Contract.load)
    claims: tuple[str, ...] = ()
    allow_motion: bool = False
    seed: int = 0
    effort: Effort = field(default_factory=Effort)
    connection: Connection = field(default_factory=Connection)
    judge: Judge = field(init=False)
    aborted: str = ""
    unreachable: dict[str, str] = field(default_factory=dict)
    rest: HttpClient | None = None
    publishers: SoapService | None = None
    subscribers: SoapService | None = None

    def __post_init__(self) -> None:
        self.judge = Judge(set(self.contract.ledger))

    @property
    def interfaces(self) -> tuple[str, ...]:
        """Names of the interfaces that the contract has."""
        there = {
            "rest": self.contract.openapi_path,
            "publishers": self.contract.publishers_path,
            "subscribers": self.contract.subscribers_path,
        }
        return tuple(name for name, path in there.items() if path)

    def connect(self) -> None:
        """Look for each interface that has an address; what is not there is put down in ``unreachable``.

        Raises:
            OSError: the CA file cannot be used.
        """
        # Imported late: zeep, lxml and xmlschema cost a third of a second that --help need not pay.
        from conformance.robot.soap_services import known_messages  # noqa: PLC0415
        from conformance.soap.discovery import open_service  # noqa: PLC0415

        where = self.statement.endpoints
        if where.rest:
            self.rest = HttpClient(where.rest, self.connection)
            self._look("rest", self.rest, self.rest_path())
        for name, wsdl, endpoint, path in (
            ("publishers", where.publishers_wsdl, where.publishers_endpoint, self.contract.publishers_path),
            ("subscribers", where.subscribers_wsdl, where.subscribers_endpoint, self.contract.subscribers_path),
        ):
            if wsdl or endpoint:
                service = open_service(name, wsdl, endpoint, self.connection, path, known_messages)
                setattr(self, name, service)
                self._look(name, service.client, service.path)

    def rest_path(self) -> str:
        """A path that the contract lets be read without parameters, for asking whether the robot is there."""
        for path, operations in self.contract.openapi.get("paths", {}).items():
            if "get" in operations and "{" not in path and not operations["get"].get("x-roaas-optional"):
                return str(path)
        return "/"

    def _look(self, name: str, client: HttpClient, path: str) -> None:
        """Put an interface down as silent unless it answers something, and see how fast it answers."""
        times = []
        # Should the resource hang, another one may not: that is one broken resource, not a robot that is not there.
        for method, target in (("GET", path), ("GET", path), ("GET", path), ("OPTIONS", path), ("GET", "/")):
            try:
                answer = client.send(method, target).response
            except NoAnswerError as none:
                self.unreachable[name] = str(none)
                if none.kind in {NoAnswer.REFUSED, NoAnswer.TLS}:
                    return
                continue
            self.unreachable.pop(name, None)
            times.append(answer.elapsed_ms)
            if len(times) == _LOOKS:
                break
        if times:
            self.unreachable.pop(name, None)
            usual = max(self.effort.usual_ms, statistics.median(times))
            self.effort = Effort(self.effort.name, usual, self.effort.minutes)

    @property
    def reached(self) -> bool:
        """Whether any interface answered at the start."""
        named = {name for name in ("rest", "publishers", "subscribers") if getattr(self, name) is not None}
        return bool(named - set(self.unreachable))

    def alive(self) -> bool:
        """Whether the robot answers HTTP at all, on any interface that it answered at the start."""
        until = time.monotonic() + _GRACE_S
        clients = self._answering()
        while True:
            for client, path in clients:
                # Several targets, so that an endpoint known to hang is no reason to call the robot dead.
                for method, target in (("GET", path), ("OPTIONS", path), ("GET", "/")):
                    try:
                        client.send(method, target, fresh=True, timeout_s=min(_GRACE_S, self.connection.timeout_s))
                    except NoAnswerError as none:
                        if none.kind is NoAnswer.REFUSED:
                            break
                        continue
                    return True
            if time.monotonic() > until:
                return False
            time.sleep(0.1)

    def _answering(self) -> list[tuple[HttpClient, str]]:
        """A client and a path for each interface that answered at the start."""
        found: list[tuple[HttpClient, str]] = []
        if self.rest is not None and "rest" not in self.unreachable:
            found.append((self.rest, self.rest_path()))
        for name in ("publishers", "subscribers"):
            service: SoapService | None = getattr(self, name)
            if service is not None and name not in self.unreachable:
                found.append((service.client, service.path))
        return found
