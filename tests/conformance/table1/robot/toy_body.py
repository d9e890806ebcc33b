"""A robot's body behind a small HTTP server, for tests of what moves and stops it."""

from collections.abc import Iterator
from contextlib import closing, contextmanager
from typing import Protocol

from toy_server import serving

from conformance.api.rest.interface import RestInterface
from conformance.packs.table1.limits import DeclaredLimits
from conformance.packs.table1.statement import Statement
from conformance.transport.client import Connection, HttpClient
from conformance.verdict.run import Run


class Body(Protocol):
    """What answers: status and JSON value for each request, None for no content."""

    def answer(self, method: str, path: str, sent: bytes) -> tuple[int, object]: ...


@contextmanager
def interface_of(body: Body, **limits: float) -> Iterator[RestInterface]:
    """Serve a robot that may be moved and declares these limits."""
    with serving(body.answer) as url, closing(HttpClient(url, Connection())) as client:
        statement = Statement(declared=DeclaredLimits(**limits))
        yield RestInterface(Run(statement=statement, allow_motion=True), client)
