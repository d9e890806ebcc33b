"""The robot of a run: opens its interfaces and checks whether they respond."""

from __future__ import annotations

import statistics
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any, Final, TextIO

from conformance.api.call_rules import CallRules
from conformance.api.device import Device, device_of
from conformance.api.interfaces import Interfaces
from conformance.api.permission import Permission
from conformance.api.rest.guard import Guard
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.operation_log import OperationLog
from conformance.api.rest.stops import stop_device
from conformance.api.soap.callable_services import SoapServices
from conformance.api.soap.service import SoapService
from conformance.contract.classes import Interface
from conformance.contract.described import ROS, SOAP
from conformance.documents.openapi import operations_of
from conformance.engine.lost_device import LostDevice
from conformance.engine.refused import RefusalListener
from conformance.engine.resending import SentListener
from conformance.history.writing import HISTORY_NAME, HistoryWriter
from conformance.scenarios.scenario import NotPossibleError
from conformance.statement.motion_calls import NAME, names_operation
from conformance.statement.motion_map import MotionMap
from conformance.statement.ros_map import Parameter, Publishes, RosMap, followers
from conformance.transport.client import Connection, HttpClient
from conformance.transport.exchange import OF_GATEWAY, Attempt, Exchange, NoAnswer, NoAnswerError, Request
from conformance.transport.pace import Hangs
from conformance.transport.rosbridge import BridgeClient
from conformance.verdict.finding import Finding
from conformance.verdict.run import Run

# Words in messages for the ROS side of each kind of operation.
_DOES: Final = {
    "topic": "reads", "publishes": "publishes on", "service": "calls", "action": "sends goals to",
    "parameter": "gets or sets", "lists": "lists",
}  # fmt: skip
_TIDY_S: Final = 10.0  # longest time for deleting what the run created, and writing back what it changed
#: Requirements that expect the web API's value, and observe ROS's.
_SEEN_ON_ROS: Final = frozenset(
    f"{ROS}/{name}"
    for name in (
        "write-exact", "once", "order", "refused-nothing", "service-once", "goal-once", "goal-cancel", "subscriptions",
    )
)  # fmt: skip


class RosEnds:
    """Counts the cases of each operation of a ROS map.

    Args:
        ros: the map.
        concerned: returns the labels of the description's operations that a request concerns.
    """

    def __init__(self, ros: RosMap, concerned: Callable[[Request], Iterable[str]]) -> None:
        self._ros, self._concerned = ros, concerned
        self._compared: Counter[str] = Counter()

    def count(self, requirement: str, exchange: Attempt | None) -> None:
        """Count a case."""
        if exchange is not None and requirement.startswith(f"{ROS}/"):
            self._compared.update(self._calls(exchange.request))

    def _calls(self, request: Request) -> list[str]:
        """Return the map's operations that a request belongs to; of several with one template, the named one."""
        path = request.target.partition("?")[0]
        labels = [*self._concerned(request), f"{request.method} {path}"]
        found: dict[str, str] = {}
        for call, one in self._ros.operations.items():
            found |= {
                each: call for each in (call, *followers(one)) if any(names_operation(each, label) for label in labels)
            }
        exact = [call for call in found if call == f"{request.method} {request.target}"]
        named = [found[each] for each in found if not NAME.search(each) and path.endswith(each.partition(" ")[2])]
        return list(dict.fromkeys(exact or named or found.values()))

    def document(self, findings: Iterable[Finding]) -> Iterator[dict[str, Any]]:
        """Yield a row for each operation: its end on ROS, how many cases were judged, and the first finding."""
        of_ros = [one for one in findings if one.requirement.startswith(f"{ROS}/") and one.exchange]
        calls_of = {one.number: self._calls(one.exchange.request) for one in of_ros if one.exchange}
        for call, one in self._ros.operations.items():
            key = next(key for key in _DOES if hasattr(one, key))
            # A finding that several operations share shows the request of the first.
            mine = [
                each
                for each in sorted(of_ros, key=lambda each: each.number)
                if call in calls_of[each.number] or any(names_operation(call, label) for label in each.operations)
            ]
            name = getattr(one, key) + (f" of {one.node}" if isinstance(one, Parameter) else "")
            row = {"operation": call, "does": _DOES[key], "name": name, "compared": self._compared[call]}
            row |= {"type": one.type} if key != "lists" else {}
            if mine:
                web, ros = mine[0].observed, f"expected: {mine[0].expected}"
                if mine[0].requirement in _SEEN_ON_ROS:
                    # The response came from the web API, the effect was seen on ROS.
                    response, _, seen = web.partition(": ")
                    web, ros = f"{ros}; {response}" if seen else ros, seen or web
                numbers = [finding.number for finding in mine]
                row |= {"findings": numbers, "differs": {"web": web, "ros": ros, "requirement": mine[0].requirement}}
            yield row


# How long a robot that stopped responding may take to return before the run ends, s.
_GRACE_S = 3.0
# A slow robot gets instead the time of this many responses.
_GRACE_ANSWERS = 10
_LOOKS = 11  # responses that show the robot's usual speed
_FEWEST_LOOKS = 5  # responses that are measured even if they take longer than _LOOKING_S
_LOOKING_S = 1.0
# After this time the command says what it waits for, s.
_SILENT_S = 2.0


@dataclass
class RobotUnderTest:
    """A robot and its connections.

    Attributes:
        run: the data of the run.
        connection: the settings that all clients share.
        rest: client of its REST interface, or None; ``connect`` sets it.
        log: what was sent to each operation of a device that claims no contract, else None.
        ros_ends: what was compared by a ROS map, or None.
        permission: what may be sent; every request passes it.
        refusals: whether the device accepts the run's credentials.
        is_at_rest: whether the run has sent nothing that may move the device, or has stopped it since.
    """

    run: Run
    connection: Connection = field(default_factory=Connection)
    rest: RestInterface | None = None
    log: OperationLog | None = None
    ros_ends: RosEnds | None = None
    permission: Permission = field(init=False)
    refusals: RefusalListener = field(init=False)
    is_at_rest: bool = True
    _guard: Guard | None = None
    _history: HistoryWriter | None = None
    _services: SoapServices | None = None
    _progress: TextIO | None = None
    # Whether one of the first requests was not answered.
    _hung: bool = False
    # Response to the last request that tested whether the device still responds.
    _answered: tuple[str, str] = ("", "")

    def __post_init__(self) -> None:
        self.permission = Permission(self.run)
        self.refusals = RefusalListener(self.run, bool(self.connection.credentials), lambda: self.rest)
        self.connection.permit = self.permission.refusal
        self.connection.endpoint_of = self._endpoint_of

    @property
    def soap(self) -> SoapServices:
        """The SOAP services, each of which may be missing."""
        # Imported late: zeep, lxml and xmlschema cost a third of a second that --help need not pay.
        from conformance.api.soap.callable_services import SoapServices  # noqa: PLC0415

        if self._services is None:
            self._services = SoapServices(self.run)
        return self._services

    @cached_property
    def device(self) -> Device:
        """The contract pack's model of the robot."""
        return device_of(self.run) if self.rest is None else self.rest.device

    @property
    def interfaces(self) -> Interfaces:
        """All interfaces that have an address."""
        from conformance.api.interfaces import Interfaces  # noqa: PLC0415 - as above

        return Interfaces(self.rest, self.soap)

    def connect(self, progress: TextIO | None = None) -> None:
        """Connect to each interface that has an address; record failures in ``run.unreachable``.

        Args:
            progress: stream for what is waited for and for failures, or None.

        Raises:
            OSError: the CA file cannot be used.
        """
        self._progress = progress
        self.connection.listeners.insert(0, SentListener(self.run.judge))
        self.connection.listeners.insert(0, self.refusals)
        if not self.device.is_known:
            # A device with a contract has no streams, and counts requests; another device may do otherwise.
            self.connection.endless = self.connection.resends = True
            self.connection.is_away = self._is_away
        # If timing matters, the scenarios themselves decide when to send a request again.
        said = self.run.statement
        self.connection.is_patient = not (self.device.is_known or said.motion_map or said.ros_map)
        self.connection.overload.ended = self._end
        self._connect_rest()
        self._connect_soap()
        kinds = [sending.kind for sending in self.connection.recent]
        # The robot was there, and one of the first requests was too much for it.
        lost = not self.was_reached and NoAnswer.CLOSED in kinds and kinds[-1] is NoAnswer.REFUSED
        if lost and self.alive():
            self.run.unreachable.clear()

    def _connect_rest(self) -> None:
        where = self.run.statement.endpoints
        if not where.rest:
            return
        ros = self.run.statement.ros_map
        client = HttpClient(where.rest, self.connection)
        if ros is not None and ros.rosbridge:
            published = {
                publishes.publishes: publishes.type
                for publishes in ros.operations.values()
                if isinstance(publishes, Publishes)
            }
            client = BridgeClient(where.rest, self.connection, published)
        self.rest = RestInterface(self.run, client, self.alive)
        if self.run.statement.motion_map is not None and self.run.allow_motion:
            self.rest.stop_device = partial(_stop_by_map, self.rest, self.run.statement.motion_map)
        if self.run.allow_motion or self.run.statement.calls.allow:
            self._guard = Guard(self.rest)
            self.connection.before_sending = self._guard.before_sending
        if not self.run.contract.is_claimed:
            self.permission.may_call_ports(self.rest.client.base_url)
            self.log = OperationLog(self.run.contract, self.rest.client.base_url)
            self.connection.listeners.append(self.log)
            self.rest.left = None if SOAP in self.run.contract.classes else self.log.left
            self.run.judge.concerned = lambda request: sorted(self.log.labels_of(request)) if self.log else ()
            if self.run.ros and self.run.statement.ros_map is not None:
                self.ros_ends = RosEnds(self.run.statement.ros_map, self.run.judge.concerned)
                self.run.judge.judged = self.ros_ends.count
        with self._tell_if_slow(Interface.REST, where.rest):
            self._look(Interface.REST, self.rest.client, self.rest.path)

    def _connect_soap(self) -> None:
        from conformance.api.soap.callable_services import SoapServices  # noqa: PLC0415 - as above
        from conformance.api.soap.service import open_service  # noqa: PLC0415 - as above

        where, contract = self.run.statement.endpoints, self.run.contract
        services = {}
        for name, wsdl, endpoint, path in (
            (Interface.PUBLISHERS, where.publishers_wsdl, where.publishers_endpoint, contract.publishers_path),
            (Interface.SUBSCRIBERS, where.subscribers_wsdl, where.subscribers_endpoint, contract.subscribers_path),
        ):
            url = wsdl or endpoint
            if url:
                with self._tell_if_slow(name, url):
                    services[name] = open_service(name, wsdl, endpoint, self.connection, path, self.device.messages)
                    self._look(name, services[name].client, services[name].path)
        self._permit_reading(services)
        for name, service in services.items():
            with suppress(NoAnswerError):
                self.run.unreachable |= {name: problem} if (problem := service.mistaken) else {}
        self._services = SoapServices(self.run, services.get(Interface.PUBLISHERS), services.get(Interface.SUBSCRIBERS))

    def _permit_reading(self, services: Mapping[Interface, SoapService]) -> None:
        """Permit messages to the service that only reads, unless the acting service has the same address."""
        if Interface.SUBSCRIBERS in services:
            self.permission.may_post_to(services[Interface.SUBSCRIBERS].endpoint)
        if Interface.PUBLISHERS in services:
            self.permission.forbid_post_to(services[Interface.PUBLISHERS].endpoint)

    @contextmanager
    def _tell_if_slow(self, name: Interface, url: str) -> Iterator[None]:
        """Say what the run waits for if connecting takes long."""
        waits = f"{name}: waiting for {url}, up to {self.connection.timeout_s:g} s for each answer"
        later = threading.Timer(_SILENT_S, self._tell, [waits])
        later.daemon = True
        later.start()
        try:
            yield
        finally:
            later.cancel()

    def _end(self, reason: str) -> None:
        """End the run, and the check that is running.

        Raises:
            NotPossibleError: a check is running.
        """
        self.run.aborted = self.run.aborted or reason
        if self.run.judge.check_name:
            raise NotPossibleError(reason)

    def _tell(self, line: str) -> None:
        if self._progress is not None:
            self._progress.write(f"{line}\n")
            self._progress.flush()

    def _look(self, name: Interface, client: HttpClient, path: str) -> None:
        """Measure an interface's response time, or record it as unreachable."""
        run = self.run
        times: list[float] = []
        # If one resource hangs, another may respond: then only that resource is broken.
        for method, target in (("GET", path), ("OPTIONS", path), ("GET", "/")):
            try:
                while len(times) < _FEWEST_LOOKS or (len(times) < _LOOKS and sum(times) < 1000 * _LOOKING_S):
                    exchange = client.send(method, target)
                    if self.rest is not None and client is self.rest.client:
                        self.rest.looked.append(exchange)
                    if exchange.response.cut:
                        break
                    times.append(exchange.response.elapsed_ms)
                if times:
                    break
            except NoAnswerError as none:
                run.unreachable[name] = str(none)
                if none.kind in {NoAnswer.REFUSED, NoAnswer.TLS}:
                    return
                self._hung = True
                self._tell(f"{name}: {method} {target}: {none}")
        # A hang before the checks was not judged: the checks send the request again.
        client.hangs.forget()
        if times:
            run.unreachable.pop(name, None)
            run.effort = run.effort.slowed_to(statistics.median(times), min(times))
            self.connection.pace.usual_s = run.effort.usual_ms / 1000

    def leave_at_rest(self) -> None:
        """Stop the device after the checks, unless that is done; the stop is tried for a bounded time. Never raises."""
        self.run.limit.end()
        if not self.is_at_rest:
            self.begin("")  # requests from here on belong to no check
            self.stop()
            self.is_at_rest = True
        if self._guard is not None:
            # If the stop could not be delivered, the guard keeps trying.
            self._guard.release(stopped=not self.run.stop_undelivered)

    def keep_history(self, history: HistoryWriter) -> None:
        """Record all sent and received messages in the history from now on."""
        self._history = self.connection.recorder = history

    def begin(self, check_name: str) -> None:
        """Begin a check; an empty name begins a phase outside of checks."""
        self.run.judge.begin(check_name)
        self.begin_span(check_name)

    def begin_span(self, name: str) -> None:
        """Record in the history which check or scenario runs from now on."""
        if self._history is not None:
            self._history.begin(name)

    def end_history(self) -> tuple[str, ...]:
        """Close the history; return remarks on it."""
        if self._history is None:
            return ()
        self._history.close()
        problem = self._history.problem
        return (f"{HISTORY_NAME} does not have every request: {problem}.",) if problem else ()

    def has(self, name: Interface) -> bool:
        """Return whether an interface has an address."""
        return self.rest is not None if name is Interface.REST else name in self.soap.there

    @property
    def was_reached(self) -> bool:
        """Return whether any interface responded at the start, or was lost in one of the first requests."""
        return self.run.losses > 0 or any(self.has(name) and name not in self.run.unreachable for name in Interface)

    @property
    def nothing_shown(self) -> str:
        """Why the run shows nothing of a device with a description of its own, or an empty text."""
        run = self.run
        # Requirements on the web server need no operation.
        alone = all(run.contract.classes[name].beside for name in run.claims)
        left_out = run.limit.is_struck or bool(run.refused)
        if self.log is None or self.rest is None or alone or left_out or not self.was_reached:
            return ""
        return self.log.nothing_shown(self.rest.call_rules)

    def alive(self) -> bool:
        """Return whether the run can go on: the device responds, or does so again after it was lost."""
        if self.run.aborted:
            return False
        recent = self.connection.recent
        # A gateway that briefly lost its device shows no fault yet.
        behind_gateway = bool(recent) and recent[-1].kind in OF_GATEWAY.values()
        with self.run.limit.lift():
            return (not behind_gateway and self._responds(self._grace_s)) or self._comes_back()

    def stop(self) -> None:
        """Stop the device if the run may have moved it; ``run.stop_undelivered`` says why it may still move."""
        if self.rest is not None:
            stop_device(self.rest, self._tell)

    def tidy_up(self) -> None:
        """Delete what the run created and write back what it changed; stop a device that this may have moved."""
        if self.log is not None and self.rest is not None and self.log.tidy_up(self.rest, _TIDY_S):
            self.stop()

    def finish(self) -> None:
        """Notice if the last request was one too many, and stop the device if it could not be stopped before."""
        if self.alive() and self.run.stop_undelivered:
            self.stop()

    def _comes_back(self) -> bool:
        """Return whether a device that was lost is back, after recording the loss."""
        lost = LostDevice(self.run, self.connection, self._responds, self._operation_of, self._tell, self.stop)
        goes_on = lost.handle(tuple(self.connection.recent))
        self.connection.recent.clear()
        for client, _ in self._answering():
            client.close()
            client.hangs.forget()
        return goes_on

    def estimate(self, *, measured: bool = True) -> str:
        """Return how many requests the run sends, and how long it takes, if the device is judged by its description."""
        run = self.run
        if "description/operations" not in run.contract.ledger and SOAP not in run.contract.classes:
            return ""  # there is no survey
        # Imported late: the survey and what it needs cost time that --help need not pay.
        from conformance.scenarios.estimate import estimate  # noqa: PLC0415

        operations = [operation for operation in operations_of(run.contract) if CallRules.of(run).decide(operation).may]
        # The first requests call no WSDL operation, so they do not show its response time; nor do those that hang.
        measured = measured and not self._hung and SOAP not in run.contract.classes
        said = estimate(run, operations).text(run.effort.usual_ms if measured else None)
        return f"{said} It ends after about {run.limit.minutes:g} minutes." if run.limit.minutes is not None else said

    def note_uncalled(self) -> None:
        """Note which operations were not called because time was over."""
        if self.run.limit.is_struck and self.log and self.rest:
            self.run.limit.uncalled = tuple(self.log.uncalled_labels(self.rest.call_rules))

    @property
    def _grace_s(self) -> float:
        return _GRACE_S + _GRACE_ANSWERS * self.connection.pace.usual_s

    def _responds(self, within_s: float) -> bool:
        """Return whether an interface that responded at the start responds within the given seconds."""
        until = time.monotonic() + within_s
        # These requests judge nothing, and did not cause the robot's silence.
        silent = self.connection.unheard(recent=deque(), sent=0, is_away=self._is_of_gateway)
        clients = [(HttpClient(client.base_url, silent, Hangs()), path) for client, path in self._answering()]
        for client, _ in self._answering():
            client.close()  # a server that serves one connection at a time accepts another one only then
        try:
            while not (responds := any(self._answers(client, path) for client, path in clients)):
                if time.monotonic() > until:
                    break
                time.sleep(0.3)
        finally:
            self.connection.sent += silent.sent
        return responds

    def _answers(self, client: HttpClient, path: str) -> bool:
        client.hangs.forget()
        # Several targets, because one endpoint that hangs does not mean a dead robot; the one that last responded comes
        # first.
        targets = [("GET", path), ("OPTIONS", path), ("GET", "/")]
        for method, target in sorted(targets, key=lambda pair: pair != self._answered):
            try:
                client.send(method, target, fresh=True, timeout_s=min(self._grace_s, self.connection.timeout_s))
            except NoAnswerError as none:
                if none.kind is NoAnswer.REFUSED or none.kind in OF_GATEWAY.values():
                    return False
                continue
            self._answered = (method, target)
            return True
        return False

    def _is_of_gateway(self, exchange: Exchange) -> bool:
        """Return whether a response has a status of gateways that the first requests of the run did not get."""
        status = exchange.response.status
        # A gateway to a ROS graph says by 503 and 504 that a publisher or a server is away, which a run orders.
        is_own = self.run.ros and OF_GATEWAY.get(status) is not NoAnswer.BAD_GATEWAY
        if status not in OF_GATEWAY or is_own or exchange.response.header("retry-after") is not None:
            return False
        before = {one.response.status for one in (self.rest.looked if self.rest else [])}
        return bool(before) and status not in before

    def _is_away(self, exchange: Exchange) -> bool:
        """Return whether a gateway responded in the device's place, as to requests that worked before."""
        with self.run.limit.lift():
            return self._is_of_gateway(exchange) and not self._responds(0.0)

    def _endpoint_of(self, request: Request) -> str:
        """Return the method and operation of a request; without an operation, a path with its values masked."""
        label = self._operation_of(request)
        return f"{request.method} {label.partition(' ')[2]}" if label else request.endpoint

    def _operation_of(self, request: Request) -> str:
        """Return the label of the operation that a request is for, or an empty text."""
        from conformance.api.rest.request_context import RequestContext  # noqa: PLC0415 - as above

        if self.rest is None:
            return ""
        context = RequestContext.of(self.run.contract, self.rest.client.base_url, request)
        return context.operation.label if context and context.operation else ""

    def _answering(self) -> list[tuple[HttpClient, str]]:
        """Return a client and a path for each interface that responded at the start."""
        found: list[tuple[HttpClient, str]] = []
        if self.rest is not None and (Interface.REST not in self.run.unreachable or not self.was_reached):
            found.append((self.rest.client, self.rest.path))
        found += [
            (service.client, service.path)
            for name, service in self.soap.there.items()
            if name not in self.run.unreachable
        ]
        return found


def _stop_by_map(api: RestInterface, motion: MotionMap) -> str:
    """Stop a device by its motion map before any scenario has moved it; return why it may still move, or nothing."""
    from conformance.scenarios.motion.binding import binding_of  # noqa: PLC0415 - as above
    from conformance.scenarios.motion.mapped import MappedDevice  # noqa: PLC0415 - as above

    return MappedDevice(api, motion, binding=binding_of(api), looks=False).leave_at_rest()
