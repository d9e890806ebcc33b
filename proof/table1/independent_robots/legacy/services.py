"""The delivery over Jersey's REST and over JAX-WS RI's SOAP, with their leniency: WSGI, a thread for each request."""

import re
import threading
from collections.abc import Callable, Iterable
from pathlib import Path
from socketserver import ThreadingMixIn
from typing import Any
from urllib.parse import unquote
from wsgiref.simple_server import WSGIRequestHandler, WSGIServer, make_server
from xml.etree import ElementTree as ET
from xml.sax.saxutils import escape

_SOAP = "http://schemas.xmlsoap.org/soap/envelope/"
_TNS = "http://soap.turtlebot.mybot.org/"
_PATH = re.compile(
    "/robot/app/delivery/([^/]+)/depot_x/([^/]+)/depot_y/([^/]+)/dest_x/([^/]+)/dest_y/([^/]+)"
    "/source_x/([^/]+)/source_y/([^/]+)"
)
# java.lang.Double.valueOf, "FloatValue", without its white space.
_JAVA_DOUBLE = re.compile(
    r"[+-]?(NaN|Infinity|((\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|0[xX]([0-9a-fA-F]+\.?|[0-9a-fA-F]*\.[0-9a-fA-F]+)[pP][+-]?\d+)"
    r"[fFdD]?)",
    re.ASCII,
)
_JAVA_INT = re.compile(r"[+-]?\d{1,10}", re.ASCII)
_DOUBLES = ("depot_x", "depot_y", "destination_x", "destination_y", "source_x", "source_y")
_PHRASES = {200: "OK", 204: "No Content", 404: "Not Found", 405: "Method Not Allowed", 415: "Unsupported Media Type"}
_MAX_BODY = 2 * 1024 * 1024


def _java_double(text: str) -> float | None:
    text = text.strip()
    if not _JAVA_DOUBLE.fullmatch(text):
        return None
    bare = text if "n" in text else text.rstrip("fFdD") if "x" not in text.lower() else text.rstrip("fd")
    return float.fromhex(bare) if "x" in bare.lower() else float(bare)


class Delivery:
    """The REST interface: one resource, as a WSGI application."""

    def __init__(self) -> None:
        self.accepted: list[tuple[int, list[float]]] = []

    def __call__(self, environ: dict[str, Any], start: Callable[..., Any]) -> Iterable[bytes]:
        """Respond to a request."""
        found = _PATH.fullmatch(environ["TARGET"].partition("?")[0])
        if found is None:
            return _page(start, 404)
        if environ["REQUEST_METHOD"] == "OPTIONS":
            return _plain(start, 200, b"", [("Allow", "OPTIONS,PUT")])
        if environ["REQUEST_METHOD"] != "PUT":
            return _page(start, 405, [("Allow", "OPTIONS,PUT")])
        code, *rest = [unquote(text) for text in found.groups()]
        numbers = [_java_double(text) for text in rest]
        if not _JAVA_INT.fullmatch(code) or not -(2**31) <= int(code) < 2**31 or None in numbers:
            return _page(start, 404)
        self.accepted.append((int(code), [number or 0.0 for number in numbers]))
        start("204 No Content", [("Server", "grizzly/1.9")])
        return []


class Soap:
    """A SOAP service, as a WSGI application.

    Attributes:
        base: URL of this server, for the WSDL's address.
    """

    def __init__(self) -> None:
        self.base = ""
        self.accepted: list[dict[str, float]] = []

    def __call__(self, environ: dict[str, Any], start: Callable[..., Any]) -> Iterable[bytes]:
        """Respond to a request."""
        path, _, query = environ["TARGET"].partition("?")
        if path != "/turtlesim_publisher_ws":
            return _page(start, 404)
        if environ["REQUEST_METHOD"] in {"GET", "HEAD"}:
            if query.lower() not in {"wsdl", "xsd=1"}:
                return _page(start, 200)
            file = Path(__file__).parent / f"publishers.{'xsd' if query.startswith('xsd') else 'wsdl'}"
            text = file.read_text(encoding="utf-8").replace("@ADDRESS@", self.base + path)
            return _plain(start, 200, text.encode(), [("Content-Type", "text/xml;charset=utf-8")])
        if environ["REQUEST_METHOD"] != "POST":
            return _page(start, 405, [("Allow", "GET, POST")])
        if environ.get("CONTENT_TYPE", "").partition(";")[0].strip().lower() != "text/xml":
            return _plain(start, 415, b"", [])
        length = int(environ.get("CONTENT_LENGTH") or 0)
        body = environ["wsgi.input"].read(min(length, _MAX_BODY))
        status, content = self._process(body) if len(body) == length else _fault("Client", "incomplete")
        envelope = f'<?xml version="1.0" ?><S:Envelope xmlns:S="{_SOAP}"><S:Body>{content}</S:Body></S:Envelope>'
        return _plain(start, status, envelope.encode(), [("Content-Type", "text/xml;charset=utf-8")])

    def _process(self, body: bytes) -> tuple[int, str]:
        try:
            root = ET.fromstring(body)  # noqa: S314 - a legacy robot: it claims no class that speaks of XML attacks
        except (ET.ParseError, ValueError, LookupError) as error:
            return _fault("Client", f"Couldn't create SOAP message due to exception: XML reader error: {error}")
        if root.tag != f"{{{_SOAP}}}Envelope":
            return _fault("VersionMismatch", f"Couldn't create SOAP message. Expecting Envelope, got {root.tag}")
        found = root.find(f"{{{_SOAP}}}Body")
        request = next(iter(found), None) if found is not None else None
        operation = request.tag.removeprefix(f"{{{_TNS}}}") if request is not None else ""
        if request is None or operation not in {"ExecuteCoffeeRequest", "ExecuteDeliveryRequest"}:
            return _fault(
                "Client", f"Cannot find dispatch method for {request.tag if request is not None else 'nothing'}"
            )
        message = request.find("arg0")
        if message is None:
            return _fault("Server", "java.lang.NullPointerException")
        texts = {child.tag: "".join(child.itertext()) for child in message}
        accepted: dict[str, float] = {name: _java_double(texts.get(name, "")) or 0.0 for name in _DOUBLES}
        code = texts.get("message_code", "").strip()
        accepted["message_code"] = int(code) if _JAVA_INT.fullmatch(code) else 0
        self.accepted.append(accepted)
        return 200, f'<ns2:{operation}Response xmlns:ns2="{_TNS}"/>'


def _fault(code: str, text: str) -> tuple[int, str]:
    return 500, (
        '<S:Fault xmlns:ns4="http://www.w3.org/2003/05/soap-envelope">'
        f"<faultcode>S:{code}</faultcode><faultstring>{escape(text)}</faultstring></S:Fault>"
    )


def _plain(start: Callable[..., Any], status: int, body: bytes, fields: list[tuple[str, str]]) -> Iterable[bytes]:
    phrase = _PHRASES.get(status, "Internal Server Error")
    start(f"{status} {phrase}", [*fields, ("Content-Length", str(len(body)))])
    return [body]


def _page(start: Callable[..., Any], status: int, fields: list[tuple[str, str]] | None = None) -> Iterable[bytes]:
    body = f"<html><head><title>{_PHRASES[status]}</title></head><body>{_PHRASES[status]}</body></html>".encode()
    return _plain(start, status, body, [*(fields or []), ("Content-Type", "text/html;charset=UTF-8")])


class _Handler(WSGIRequestHandler):
    timeout = 20

    def get_environ(self) -> dict[str, Any]:
        """Add the unchanged target, because WSGI's PATH_INFO has lost its escapes."""
        return {**super().get_environ(), "TARGET": self.path}

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002 - http.server's own name
        """Log nothing."""


class _Server(ThreadingMixIn, WSGIServer):
    daemon_threads = True
    request_queue_size = 128

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Ignore a connection that the client has broken."""


def start(application: Any, port: int) -> tuple[str, Callable[[], None]]:
    """Serve a WSGI application on loopback. Return its URL and a function that stops the server."""
    server = make_server("127.0.0.1", port, application, server_class=_Server, handler_class=_Handler)
    threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.1}, daemon=True).start()

    def stop() -> None:
        server.shutdown()
        server.server_close()

    return f"http://127.0.0.1:{server.server_port}", stop
