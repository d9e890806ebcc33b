"""A conforming robot, and in front of it a proxy that spoils what passes through it."""

from __future__ import annotations

import http.client
import inspect
import threading
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

import pytest
from spoiling import Ask, Reply

from conformance.contract.files import Contract
from conformance.contract.ledger import CLASSES
from conformance.contract.statement import Endpoints, Statement
from conformance.engine.outcome import settle
from conformance.engine.session import Session
from conformance.selftest.independent_robots import plain
from conformance.transport.client import Connection
from conformance.transport.exchange import NoAnswerError
from conformance.verdict.effort import Effort
from conformance.verdict.explorer import Explorer

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator


class Proxy:
    def __init__(self, robot: str) -> None:
        self._robot = urlsplit(robot)
        self.fault = None
        proxy = self

        class Handler(BaseHTTPRequestHandler):
            protocol_version = "HTTP/1.1"
            wbufsize = -1  # head and body in one packet: two would wait 40 ms for an acknowledgement

            def _pass(self) -> None:
                body = self.rfile.read(int(self.headers.get("Content-Length") or 0))
                ask = Ask(self.command, self.path, dict(self.headers), body)
                reply = proxy.fault(ask, proxy.forward) if proxy.fault else proxy.forward(ask)
                self.send_response_only(reply.status)
                for name, value in reply.headers.items():
                    if name.lower() not in {"content-length", "connection", "transfer-encoding"}:
                        self.send_header(name, value)
                self.send_header("Content-Length", str(len(reply.body)))
                self.end_headers()
                self.wfile.write(reply.body)

            do_GET = do_POST = do_PUT = do_DELETE = do_PATCH = do_OPTIONS = _pass  # noqa: N815 - http.server's names

            def log_message(self, *_args) -> None:
                pass

        class Server(ThreadingHTTPServer):
            daemon_threads = True
            request_queue_size = 64

            def handle_error(self, *_args) -> None:
                pass

        self._server = Server(("127.0.0.1", 0), Handler)
        self.url = f"http://127.0.0.1:{self._server.server_port}"
        threading.Thread(target=self._server.serve_forever, args=(0.05,), daemon=True).start()

    def forward(self, ask: Ask) -> Reply:
        there = http.client.HTTPConnection(self._robot.hostname, self._robot.port, timeout=20)
        try:
            headers = {
                name: value
                for name, value in ask.headers.items()
                if name.lower() not in {"connection", "content-length"}
            }
            there.request(ask.method, ask.target, ask.body, headers)
            answer = there.getresponse()
            return Reply(answer.status, dict(answer.getheaders()), answer.read())
        finally:
            there.close()

    def stop(self) -> None:
        self._server.shutdown()
        self._server.server_close()


@pytest.fixture(scope="session")
def robot() -> Iterator[tuple[str, str]]:
    """A conforming robot: base URLs of REST and SOAP."""
    rest, wsdl, stop = plain.serve(0, 0)
    yield rest, wsdl.rsplit("/", 1)[0]
    stop()


@contextmanager
def _session(rest: str, soap: str, *, effort: str, motion: bool = True, timeout: float = 5.0) -> Iterator[Session]:
    statement = Statement(
        endpoints=Endpoints(
            rest=rest,
            publishers_wsdl=f"{soap}/turtlesim_publisher_ws?wsdl",
            subscribers_wsdl=f"{soap}/turtlesim_subscriber_ws?wsdl",
        )
    )
    session = Session(
        statement=statement,
        contract=Contract.load(),
        claims=CLASSES,
        allow_motion=motion,
        effort=Effort(effort),
        connection=Connection(timeout_s=timeout),
    )
    session.connect()
    session.judge.check = "test"
    yield session


@pytest.fixture
def judged(robot: tuple[str, str]) -> Iterator[Callable[..., Session]]:
    """Connect a session to the robot through a proxy with a fault (or none)."""
    open_proxies: list[Proxy] = []

    def connected(fault=None, *, effort: str = "quick", motion: bool = True) -> Session:
        proxy = Proxy(robot[1])
        open_proxies.append(proxy)
        proxy.fault = fault
        with _session(robot[0], proxy.url, effort=effort, motion=motion) as session:
            # Requests go through the proxy, whatever address the robot writes into its WSDL.
            for service in (session.publishers, session.subscribers):
                service.client = type(service.client)(proxy.url, session.connection)
            return session

    yield connected
    for proxy in open_proxies:
        proxy.stop()


@pytest.fixture
def connected() -> Callable[..., Session]:
    """Connect a session to a robot, without a proxy."""

    def opened(rest: str, soap: str, *, effort: str) -> Session:
        with _session(rest, soap, effort=effort) as session:
            return session

    return opened


@pytest.fixture
def run() -> Callable[..., dict[str, str]]:
    """Run checks on a session; gives what failed: first message by requirement."""

    def ran(session: Session, *checks) -> dict[str, str]:
        for check in checks:
            known = {
                "roaas": session,
                "judge": session.judge,
                "effort": session.effort,
                "statement": session.statement,
                "rest": session.rest,
                "publishers": session.publishers,
                "subscribers": session.subscribers,
                "explore": Explorer(session.seed, check.__name__, session.effort),
            }
            names = inspect.signature(check).parameters
            before = session.judge.counts(session.judge.evidence)
            try:
                check(**{name: known[name] for name in names})
            except NoAnswerError as none:
                settle(session, tuple(session.judge.evidence), before, none)
        return {
            id_: next(iter(evidence.findings.values())).message
            for id_, evidence in session.judge.evidence.items()
            if evidence.findings
        }

    return ran
