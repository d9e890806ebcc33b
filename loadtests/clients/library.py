"""The library clients, zeep and requests: the latency that a user's own program would see.

SOAP goes through zeep: one Document (the parsed WSDL) for each process, because it takes milliseconds to build, and one
transport for each user. REST goes through `requests`. Both use a urllib3 adapter that counts the requests sent: two
requests for one call are a silent retry, which makes a run invalid. Responses are read up to a size: `requests` has no
limit for lines, bodies and what they unpack to.
"""

import io
from collections.abc import Callable
from dataclasses import dataclass
from http.client import HTTPResponse
from typing import Any, Final

import requests
import zeep
from requests.adapters import HTTPAdapter
from zeep.transports import Transport
from zeep.wsdl import Document

from loadtests.clients.failures import CallError, connect_error, require_good
from loadtests.clients.payloads import CATALOGUE, NAMESPACE, Values, rest_path
from loadtests.clients.robot import Robot
from loadtests.clients.wire import now_ns
from loadtests.clients.wsdl import loader

_MOST: Final = 16 * 1024 * 1024  # longest response, compressed or not, bytes
_COOKIES: Final = 100  # most cookies
_PIECE: Final = 65_536
#: Beginning of each error message for a response that is too long.
TOO_LONG: Final = f"the response is longer than {_MOST} bytes"


class _Limited(io.RawIOBase):
    """A response's content, read up to the limit."""

    def __init__(self, whole: Any) -> None:
        self._raw = whole.detach()
        self._left = _MOST

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        """Read as a socket does.

        Raises:
            OSError: the response is too long.
        """
        count = int(self._raw.readinto(buffer) or 0)
        self._left -= count
        if self._left < 0:
            raise OSError(TOO_LONG)
        return count

    def close(self) -> None:
        super().close()
        self._raw.close()


class BoundedResponse(HTTPResponse):
    """A response of the standard library that is read up to a limit, lines of headers and chunks included."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.fp: Any = io.BufferedReader(_Limited(self.fp))


class StayingSession(requests.Session):
    """A session that follows no redirect, which would measure another server, and reads no endless response."""

    def get_redirect_target(self, resp: requests.Response) -> str | None:
        """Return None: there is no redirect to follow."""
        del resp
        return None

    def send(self, request: requests.PreparedRequest, **kwargs: Any) -> requests.Response:
        """Send a request, and read its response up to the limit: a small one may unpack to any size.

        Raises:
            requests.RequestException: there is no response, or it is too long.
        """
        response = super().send(request, **{**kwargs, "stream": True})
        pieces: list[bytes] = []
        size = 0
        for piece in response.iter_content(_PIECE):
            pieces.append(piece)
            size += len(piece)
            if size > _MOST:
                response.close()
                raise requests.exceptions.ContentDecodingError(TOO_LONG)
        # As the property `content` does it.
        response._content, response._content_consumed = b"".join(pieces), True  # noqa: SLF001
        if len(self.cookies) > _COOKIES:
            self.cookies.clear()
        return response


@dataclass(slots=True)
class Timed:
    """When a call's request was built and its response received; and the Server-Timing header, if any."""

    built_ns: int
    received_ns: int
    timing: bytes | None


@dataclass(slots=True)
class Sent:
    """Counts the calls of library clients, and the requests that these put on the wire."""

    requests: int = 0
    calls: int = 0

    @property
    def resends(self) -> int:
        """Return how many requests were sent beyond one for each call."""
        return max(0, self.requests - self.calls)


class _CountingAdapter(HTTPAdapter):
    """Counts sends below urllib3's retries."""

    def __init__(self, sent: Sent) -> None:
        self._sent = sent
        super().__init__()

    def init_poolmanager(self, *args: Any, **kwargs: Any) -> None:
        super().init_poolmanager(*args, **kwargs)
        classes: dict[str, Any] = self.poolmanager.pool_classes_by_scheme
        self.poolmanager.pool_classes_by_scheme = {
            scheme: type("CountingPool", (pool,), {"ConnectionCls": _counting(pool.ConnectionCls, self._sent)})
            for scheme, pool in classes.items()
        }


def _counting(base: Any, sent: Sent) -> Any:
    """Return a class of connections that counts its requests."""

    class Counting(base):  # type: ignore[misc]  # HTTPConnection or HTTPSConnection
        response_class = BoundedResponse

        def request(self, *args: Any, **kwargs: Any) -> None:
            sent.requests += 1
            super().request(*args, **kwargs)

    return Counting


def new_session(robot: Robot, sent: Sent | None = None) -> requests.Session:
    """Return a `requests` session as a user would set it up for this robot; it follows no redirect.

    Args:
        robot: its credentials.
        sent: counts the requests.
    """
    session = StayingSession()
    session.trust_env = False  # a proxy from the environment would be measured instead of the robot
    for scheme in ("http://", "https://"):
        session.mount(scheme, _CountingAdapter(sent or Sent()))
    if robot.ca_file:
        session.verify = robot.ca_file
    if robot.token:
        session.headers["Authorization"] = f"Bearer {robot.token}"
    return session


def request_error(error: requests.RequestException, where: str, timeout_s: float) -> CallError:  # noqa: PLR0911 - one for each kind
    """Return a CallError with its kind for an exception of `requests`."""
    cause: BaseException | None = error
    while cause is not None:
        if isinstance(cause, OSError) and not isinstance(cause, requests.RequestException):
            break
        arguments = [argument for argument in cause.args if isinstance(argument, BaseException)]
        reason = getattr(cause, "reason", None)
        following = reason if isinstance(reason, BaseException) else (arguments[0] if arguments else None)
        cause = following or cause.__cause__ or cause.__context__
    if TOO_LONG in str(error):
        return CallError("malformed", TOO_LONG)
    if isinstance(error, requests.ConnectTimeout):
        return connect_error(TimeoutError(), where)
    if isinstance(error, requests.ReadTimeout) or isinstance(cause, TimeoutError):
        return CallError("timeout", f"no complete response within {timeout_s:g} s")
    if isinstance(cause, ConnectionResetError | BrokenPipeError):
        return CallError("closed", f"the robot reset the connection: {cause}")
    if isinstance(cause, OSError):
        return connect_error(cause, where)
    if "RemoteDisconnected" in repr(error) or "IncompleteRead" in repr(error):
        return CallError("closed", "the robot closed the connection before its response was complete")
    return CallError("network", f"{where}: {error}")


class _TimedTransport(Transport):
    """zeep's transport, with the times at which a message is sent and its response received."""

    def __init__(self, robot: Robot, sent: Sent) -> None:
        super().__init__(  # type: ignore[no-untyped-call]  # zeep annotates the class, not its constructor
            session=new_session(robot, sent), timeout=robot.timeout_s, operation_timeout=robot.timeout_s
        )
        self.timed = Timed(0, 0, None)

    def post(self, address: str, message: bytes, headers: dict[str, str]) -> Any:
        self.timed.built_ns = now_ns()
        response = super().post(address, message, headers)  # type: ignore[no-untyped-call]  # as above
        self.timed.received_ns = now_ns()
        if response.is_redirect:
            require_good(response.status_code, response.headers.get("Location"), response.content)
        timing = response.headers.get("Server-Timing")
        self.timed.timing = timing.encode("latin-1") if timing else None
        return response


class _Documents(Transport):
    """zeep's transport for a WSDL and the documents it refers to, read from the robot's servers only."""

    def __init__(self, load: Callable[[str], bytes]) -> None:
        super().__init__()  # type: ignore[no-untyped-call]  # as above
        self._load = load

    def load(self, url: str) -> bytes:
        """Return a document."""
        return self._load(url)


def read_document(location: str, robot: Robot) -> Document:
    """Parse a WSDL for zeep.

    Raises:
        WsdlError: it, or what it refers to, is not there, or is elsewhere.
        CallError: its server does not respond.
        Exception: of any kind that zeep and lxml raise; the caller words it.
    """
    transport: Any = _Documents(loader(location, robot))  # zeep annotates the class itself
    return Document(location, transport, settings=zeep.Settings())


class LibrarySoap:
    """A user's zeep client, with parsed WSDLs by operation that the process shares."""

    def __init__(self, robot: Robot, documents: dict[str, Document], sent: Sent) -> None:
        self._robot = robot
        self._sent = sent
        self._transport = _TimedTransport(robot, sent)
        self._methods = {}
        for operation, document in documents.items():
            client = zeep.Client(document, transport=self._transport)
            address = robot.address("soap", operation)
            service = client.create_service(_binding(document), address)
            self._methods[operation] = service[CATALOGUE[operation].element]

    def call(self, operation: str, values: Values) -> Timed:
        """Call an operation.

        Raises:
            CallError: the response is a fault, or there is none.
        """
        self._sent.calls += 1
        where = self._robot.address("soap", operation) or ""
        try:
            answer = self._methods[operation](**({"arg0": values} if values else {}))
        except requests.RequestException as error:
            raise request_error(error, where, self._robot.timeout_s) from None
        except zeep.exceptions.Fault as error:
            raise CallError("fault", f"SOAP fault: {error.message}") from None
        except zeep.exceptions.TransportError as error:
            raise CallError("status", f"status {error.status_code}: {error.message}") from None
        except zeep.exceptions.Error as error:
            raise CallError("content", f"zeep cannot read the response: {error}") from None
        if not values and answer is None:
            raise CallError("content", "zeep found nothing in the response")
        return self._transport.timed

    def close(self) -> None:
        """Close its connections; the next call opens a new one."""
        self._transport.session.close()


def _binding(document: Document) -> str:
    """Return the name of the contract's binding in a WSDL; the robot may name its ports as it likes."""
    for name in document.bindings:
        if name.startswith(f"{{{NAMESPACE}}}"):
            return str(name)
    raise CallError("content", f"the WSDL has no binding in {NAMESPACE}")


class LibraryRest:
    """A user's REST client: the requests library, and the response parsed as JSON."""

    def __init__(self, robot: Robot, sent: Sent) -> None:
        self._robot = robot
        self._sent = sent
        self._session = new_session(robot, sent)
        self._base = (robot.rest or "").rstrip("/")

    def call(self, operation: str, values: Values) -> Timed:
        """Call an operation.

        Raises:
            CallError: the response is an error, or there is none.
        """
        self._sent.calls += 1
        kind = CATALOGUE[operation]
        timed = Timed(0, 0, None)
        request = self._session.prepare_request(
            requests.Request(kind.method, self._base + rest_path(values), headers={"Accept": "application/json"})
        )
        timed.built_ns = now_ns()
        try:
            response = self._session.send(request, timeout=self._robot.timeout_s)
        except requests.RequestException as error:
            raise request_error(error, self._base, self._robot.timeout_s) from None
        timed.received_ns = now_ns()
        require_good(response.status_code, response.headers.get("Location"), response.content, kind.rest_expects)
        if response.content:
            try:
                response.json()
            except requests.JSONDecodeError as error:
                raise CallError("content", f"the response is not JSON: {error}") from None
        timing = response.headers.get("Server-Timing")
        timed.timing = timing.encode("latin-1") if timing else None
        return timed

    def close(self) -> None:
        """Close its connections; the next call opens a new one."""
        self._session.close()
