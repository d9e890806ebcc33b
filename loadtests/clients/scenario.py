"""The client of a scenario's user: it calls operations of the device's description, and records each request.

Requests go out over the wire client: each is sent once, over a connection that the user keeps. A response is good or
bad by the description, unless the scenario decides for itself.
"""

import json
import re
from collections.abc import Mapping
from types import TracebackType
from typing import Any, NamedTuple, Protocol, Self
from urllib.parse import quote, urlencode

from locust.exception import CatchResponseError, RescheduleTask
from requests.structures import CaseInsensitiveDict

from conformance.transport.credentials import Credentials
from loadtests.clients.callers import server_ns
from loadtests.clients.endpoint import Endpoint
from loadtests.clients.failures import CallError, Declared
from loadtests.clients.robot import Described, Robot
from loadtests.clients.wire import Answer, Connection, Request, now_ns

_NAMED = re.compile(r"\{([^{}]*)\}")
_BREAK = re.compile(r"[\r\n\0]")
_KEPT = "/:@!$&'()*+,;=~%?"


_PARAMETER = re.compile(r"\\\{[^{}]*\\\}")


class ScenarioError(Exception):
    """A request that the scenario must not make, or that cannot be made; it ends the run."""


class Route(NamedTuple):
    """An operation: its number in the plan, the form of its paths, and its good responses."""

    number: int
    operation: Described
    path: re.Pattern[str]
    good: Declared


class Routes:
    """The operations of a description, found by name, or by the method and path of a request.

    Args:
        robot: with its operations.
        numbered: names of the operations that may be called, in the order in which the plan numbers them.
    """

    def __init__(self, robot: Robot, numbered: tuple[str, ...]) -> None:
        numbers = {name: number for number, name in enumerate(numbered)}
        self._routes = [
            Route(numbers.get(each.name, -1), each, _pattern(each), Declared(each.responses))
            for each in sorted(robot.described, key=lambda each: each.name.count("{"))  # /items/all before /items/{id}
        ]

    def of(self, method: str, path: str) -> Route:
        """Return the operation of a request.

        Raises:
            ScenarioError: there is none, or it may not be called.
        """
        found = next(
            (route for route in self._routes if route.operation.method == method and route.path.fullmatch(path)), None
        )
        if found is None:
            others = sorted(route.operation.method for route in self._routes if route.path.fullmatch(path))
            hint = f"the path has {', '.join(others)}" if others else "no path of it matches"
            raise ScenarioError(f"{method} {path} is not in the description: {hint}")
        return _check_allowed(found)

    def find(self, name: str) -> Route:
        """Return the operation with this method and path template.

        Raises:
            ScenarioError: there is none, or it may not be called.
        """
        found = next((route for route in self._routes if route.operation.name == name), None)
        if found is None:
            raise ScenarioError(f"the description has no operation {name!r}: name it as in 'GET /items/{{id}}'")
        return _check_allowed(found)


def _pattern(operation: Described) -> re.Pattern[str]:
    template = operation.name.partition(" ")[2]
    return re.compile(_PARAMETER.sub("[^/]+", re.escape(template)))


def _check_allowed(route: Route) -> Route:
    if route.operation.refused:
        raise ScenarioError(f"{route.operation.name} is not called: {route.operation.refused}")
    return route


class NoResponseError(RescheduleTask):
    """No response was received: the failure is recorded, and Locust ends the task, as if it had returned."""


class Record(Protocol):
    """Where requests are recorded.

    Attributes:
        busy: how many requests are under way.
    """

    busy: int

    def turn(self) -> None:
        """Wait until the next request may start, if the rate is limited."""

    def segment_at(self, moment_ns: int) -> int | None:
        """Return the number of the segment at a moment; None outside the plan, where nothing is recorded."""

    def count(self, name: str) -> None:
        """Add one to a counter."""

    def record(
        self, segment: int, operation: int, due: int, start: int, built: int, received: int, done: int, server: int
    ) -> None:
        """Record a success (moments in monotonic ns; `server` a duration, -1 when unknown)."""

    def failed(self, segment: int, operation: int, error: CallError, due_ns: int, start_ns: int, until_ns: int) -> None:
        """Record a failure."""


class Response:
    """A response, as the scenario sees it.

    Attributes:
        status_code: its status.
        headers: names are case-insensitive.
        content: the body as bytes.
        error: why it counts as a failure, or None.
    """

    def __init__(self, answer: Answer, error: CallError | None) -> None:
        self.status_code = answer.status
        self.headers = CaseInsensitiveDict(
            {name.decode("latin-1"): value.decode("latin-1") for name, value in answer.headers.items()}
        )
        self.content = answer.body
        self.error = error

    @property
    def ok(self) -> bool:
        """Return whether it counts as a success."""
        return self.error is None

    @property
    def text(self) -> str:
        """Return the body as text."""
        return self.content.decode("utf-8", "replace")

    def json(self) -> Any:
        """Return the body's JSON value.

        Raises:
            ValueError: it is no JSON.
        """
        return json.loads(self.content)


class ResponseContext(Response):
    """A response that the scenario judges: `with self.client.get(path, catch_response=True) as response`."""

    def __init__(self, answer: Answer, error: CallError | None, sent: "_Sent") -> None:
        super().__init__(answer, error)
        self._sent = sent

    def success(self) -> None:
        """Count the request as a success, whatever the description says."""
        self.error = None

    def failure(self, reason: object) -> None:
        """Count it as a failure."""
        self.error = CallError("scenario", str(reason))

    def __enter__(self) -> Self:
        """Return itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> bool:
        """Record the request. As in Locust, `CatchResponseError` makes it a failure, and goes no further."""
        if isinstance(value, CatchResponseError):
            self.failure(value)
        self._sent.settle(self.error)
        return isinstance(value, CatchResponseError)


class _Sent(NamedTuple):
    """A request with its response, to be recorded: where, and its moments."""

    record: Record
    segment: int | None
    operation: int
    moments: tuple[int, int, int, int, int]
    server: int

    def settle(self, error: CallError | None) -> None:
        if self.segment is None:
            return
        due, start, _, _, done = self.moments
        if error is None:
            self.record.record(self.segment, self.operation, *self.moments, self.server)
        else:
            self.record.failed(self.segment, self.operation, error, due, start, done)


class Client:
    """Sends a user's requests to the device, over one connection.

    Args:
        robot: address, credentials and deadline.
        routes: its operations.
        record: where requests are recorded.
    """

    def __init__(self, robot: Robot, routes: Routes, record: Record) -> None:
        self._robot = robot
        self._routes = routes
        self._record = record
        self._endpoint = Endpoint.parse(robot.rest or "")
        self._credentials = Credentials(robot.credentials)
        self._connection = Connection(self._endpoint, robot.timeout_s, robot.tls, robot.digest)

    def get(self, path: str, **how: Any) -> Any:
        """Send a GET request; the arguments are those of `request`."""
        return self.request("GET", path, **how)

    def post(self, path: str, **how: Any) -> Any:
        """Send a POST request; the arguments are those of `request`."""
        return self.request("POST", path, **how)

    def put(self, path: str, **how: Any) -> Any:
        """Send a PUT request; the arguments are those of `request`."""
        return self.request("PUT", path, **how)

    def patch(self, path: str, **how: Any) -> Any:
        """Send a PATCH request; the arguments are those of `request`."""
        return self.request("PATCH", path, **how)

    def delete(self, path: str, **how: Any) -> Any:
        """Send a DELETE request; the arguments are those of `request`."""
        return self.request("DELETE", path, **how)

    def call(self, operation: str, values: Mapping[str, object] | None = None, **how: Any) -> Any:
        """Send a request for an operation by its name, as in `call("GET /items/{id}", {"id": 3})`.

        Args:
            operation: method and path template, as in the description.
            values: values of the path's parameters.
            how: the further arguments of `request`.
        """
        route, given = self._routes.find(operation), values or {}
        method, _, template = route.operation.name.partition(" ")
        missing = [name for name in _NAMED.findall(template) if name not in given]
        if missing:
            raise ScenarioError(f"{operation}: the path needs a value for {', '.join(missing)}")
        path = _NAMED.sub(lambda match: quote(str(given[match[1]]), safe=""), template)
        return self._send(route, method, path, **how)

    def request(self, method: str, path: str, **how: Any) -> Any:
        """Send a request and return its response (`Response`).

        Args:
            method: HTTP method.
            path: below the device's base URL; it may contain a query.
            how: `params` for the query; `json`, or `data` as text or bytes, for the body; `headers`;
                `catch_response=True` to judge the response in a `with` block (`ResponseContext`).

        Raises:
            ScenarioError: the description has no such operation, or it may not be called.
            NoResponseError: no response was received; Locust ends the task.
        """
        path = quote(path, safe=_KEPT)
        return self._send(self._routes.of(method, path.partition("?")[0]), method, path, **how)

    def _send(
        self,
        route: Route,
        method: str,
        path: str,
        *,
        params: Mapping[str, Any] | None = None,
        json: Any = None,
        data: str | bytes | None = None,
        headers: Mapping[str, str] | None = None,
        catch_response: bool = False,
    ) -> Response:
        query = urlencode(params or {}, doseq=True)
        if query:
            path += f"{'&' if '?' in path else '?'}{query}"
        target = self._endpoint.path + path
        record, connection = self._record, self._connection
        record.turn()
        start = now_ns()
        segment = record.segment_at(start)
        connects = connection.connects
        record.busy += 1
        try:
            octets = self._octets(method, target, _body(json, data), _fields(json, headers))
            built = now_ns()
            answer = connection.call(Request(octets))
        except CallError as failure:
            if segment is not None:
                record.failed(segment, route.number, failure, start, start, now_ns())
            raise NoResponseError(str(failure)) from None
        finally:
            record.busy -= 1
        if connection.connects != connects:
            record.count("connects")
        error = _fault_of(answer, route.good)
        moments = (start, start, built, answer.received_ns, now_ns())
        sent = _Sent(record, segment, route.number, moments, server_ns(answer.headers.get(b"server-timing")))
        if catch_response:
            return ResponseContext(answer, error, sent)
        sent.settle(error)
        return Response(answer, error)

    def _octets(self, method: str, target: str, body: bytes, fields: dict[str, str]) -> bytes:
        """Return a request with its credentials; those that answer a challenge are added when it is sent."""
        if body or method in {"POST", "PUT", "PATCH"}:  # RFC 9110 section 8.6
            fields["Content-Length"] = str(len(body))
        fields |= dict(self._credentials.fields(method, target, fields, shown=True))
        lines = [f"{name}: {value}" for name, value in {"Host": self._endpoint.authority, **fields}.items()]
        if wrong := next(filter(_BREAK.search, lines), None):
            raise ScenarioError(f"the header {wrong!r} contains a line break")
        head = [f"{method} {self._credentials.target(target, shown=True)} HTTP/1.1", *lines, "", ""]
        return self._robot.fixed.reveal("\r\n".join(head).encode()) + body

    def close(self) -> None:
        """Close the connection."""
        self._connection.close()


def _body(value: Any, data: str | bytes | None) -> bytes:
    if value is not None:
        return json.dumps(value).encode()
    return data.encode() if isinstance(data, str) else data or b""


def _fields(value: Any, headers: Mapping[str, str] | None) -> dict[str, str]:
    fields = {"Accept": "*/*", **({} if value is None else {"Content-Type": "application/json"})}
    given = {name.lower() for name in headers or {}}
    return {name: text for name, text in fields.items() if name.lower() not in given} | dict(headers or {})


def _fault_of(answer: Answer, good: Declared) -> CallError | None:
    try:
        answer.require_good(good)
    except CallError as error:
        return error
    return None
