"""What the suite makes of answers of a live service: what is steady, what agrees, what may be sent."""

import signal
import subprocess
import sys
from dataclasses import replace

import pytest
from lending_library import CONTRACT, Library, open_library

from conformance.api.rest import effects
from conformance.api.rest.applicable import applicable_operations, readable, reads, working_reads
from conformance.api.rest.calls import example_call
from conformance.api.rest.formats import disagreements
from conformance.api.rest.generated import as_request, targets
from conformance.api.rest.guard import tell
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.motion_guard import MotionGuard
from conformance.api.rest.statuses import is_refusal
from conformance.contract.pack import Contract
from conformance.documents.openapi import operations_of
from conformance.engine.robot_under_test import RobotUnderTest
from conformance.packs.table1.statement import Statement
from conformance.statement.endpoints import Endpoints
from conformance.transport.client import Connection, HttpClient
from conformance.transport.exchange import Exchange, Outgoing, Request, Response
from conformance.verdict.run import Run


@pytest.fixture
def library():
    return Library()


@pytest.fixture
def api(library):
    rest, _, close = open_library(library)
    robot = RobotUnderTest(Run(Statement(endpoints=Endpoints(rest=rest)), Contract.load(CONTRACT), ("http",)))
    robot.connect()
    yield robot.rest
    close()


def _operation(api, id_):
    return next(item for item in operations_of(api.run.contract) if item.id == id_)


def test_requests_are_made_from_examples(api):
    put = example_call(api, _operation(api, "putBook"))
    assert put.path == "/books/9780141439600"
    assert put.send(api).response.status == 204
    assert example_call(api, _operation(api, "listBooks")).path == "/books/?limit=10"
    assert put.having("isbn", "a/b %").path == "/books/a%2Fb%20%25"


def test_reads_and_what_is_answered(api, library):
    assert [call.operation.id for call in reads(api)] == ["getHours", "listBooks", "getBook"]
    # A book may be lent between two requests.
    assert "getBook" not in [call.operation.id for call in working_reads(api)]
    library.books.clear()
    assert [call.operation.id for call in working_reads(api)] == ["getHours", "listBooks"]
    assert readable(api, _operation(api, "listBooks")).send(api).response.status == 200


def test_what_was_put_is_got(api, library):
    call = example_call(api, _operation(api, "putBook"))
    assert effects.reader_of(api, call).path == call.path
    assert effects.settles_at(api, call).startswith("'Emma' as title instead of ")
    call.send(api)
    assert effects.settles_at(api, call) == ""
    library.books.clear()
    assert effects.settles_at(api, call) is None


def test_formats_disagree_only_where_they_do(api, library):
    call = readable(api, _operation(api, "getBook"))
    library.books[9780141439600] = {"title": "Emma", "year": 1, "price": 0.1 + 0.2, "shelf": {"room": "A", "row": 3}}
    assert disagreements(api, call, ["application/xml", "text/plain"])[0] == []
    library.fault = "xml-rounds"
    (found,) = disagreements(api, call, ["application/xml", "text/plain"])[0]
    assert (found.place, found.description) == (
        "price",
        "0.0 as price in application/xml and 0.30000000000000004 in JSON",
    )


def test_what_changes_is_told_from_what_is_steady(api, library):
    call = readable(api, _operation(api, "getBook"))
    before = effects.take_snapshots(api, [call])["getBook"][0]
    assert before["price"] == 7.25
    library.books[9780141439600] = dict(library.books[9780141439600], price=8.0)
    assert effects.deltas(before, effects.flatten(call.send(api))) == {"price": (7.25, 8.0)}
    assert not effects.changes_by_itself(api, call, "price", 0.05)
    assert effects.steady([{"a": 1, "b": 2}, {"a": 1, "b": 3}]) == {"a": 1}


def test_a_slow_robot_is_asked_less(api):
    assert api.run.effort.subsample(range(10), 3) == list(range(10))
    api.run.effort = api.run.effort.slowed_to(usual_ms=300)
    assert api.run.effort.subsample(range(10), 3) == [0, 3, 6]
    assert len(api.run.effort.draw(range(100), 50, "0/name")) == 3
    assert api.run.effort.draw(range(100), 50, "0/name") == api.run.effort.draw(range(100), 50, "0/name")


def test_what_moves_needs_permission(api):
    ids = ["http/delete-idempotent"]
    assert applicable_operations(api, ids, lambda item: item.method == "DELETE", "deletes") == []
    assert "allow-motion" in api.run.judge.evidence["http/delete-idempotent"].skips[0]
    assert applicable_operations(api, ["http/safe"], lambda item: item.method == "PATCH", "patches") == []
    assert "no operation that patches" in api.run.judge.evidence["http/safe"].unclaimed
    wanted = Outgoing.of("DELETE", "/books/5", "", b"")
    assert MotionGuard(api).admit(wanted) is None
    assert MotionGuard(replace(api, run=replace(api.run, allow_motion=True))).admit(wanted) == wanted


def test_a_guard_that_does_not_read_is_ended_and_not_waited_for():
    with subprocess.Popen([sys.executable, "-c", "input(); input()"], stdin=subprocess.PIPE, bufsize=0) as process:
        process.send_signal(signal.SIGSTOP)
        # A pipe holds 64 KiB.
        taken = [tell(process, b"a" * 9_999 + b"\n") for _ in range(7)]
        assert (taken[0], taken[-1], process.poll()) == (True, False, -signal.SIGKILL)


def test_schemathesis_makes_the_same_requests_again(api):
    def made(**options):
        found = targets(api.run.contract, **options)
        return {one.label: list(filter(None, map(as_request, one.covering()))) for one in found}

    requests = made(undeclared=True)
    assert sum(map(len, requests.values())) > 100
    assert requests == made(undeclared=True)
    assert {item.method for group in requests.values() for item in group} > {"GET", "PUT", "DELETE"}
    assert all({item.method for item in group} == {label.split()[0]} for label, group in made().items())


@pytest.mark.parametrize(
    ("status", "expected"), [(400, True), (422, True), (404, True), (204, False), (500, False), (401, False)]
)
def test_refusals(status, expected):
    assert is_refusal(Exchange(Request("PUT", "http://robot/"), Response(status, (), b"", 1.0))) is expected


def test_what_a_robot_might_take_of_random_requests_is_slow_or_not_sent():
    guard = MotionGuard(RestInterface(Run(allow_motion=True), HttpClient("http://127.0.0.1:1", Connection())))
    wild = Outgoing.of("PUT", "/robot/velocity/", "application/json", b'{"linear": {"x": 900.5, "y": -7, "z": true}}')
    assert guard.admit(wild).body == b'{"linear": {"x": 0.1, "y": 1, "z": true}}'
    vector = b"<Vector3><x>0.6</x><y>0</y><z>0</z></Vector3>"
    assert guard.admit(Outgoing.of("PUT", "/robot/velocity/linear/", "application/xml", vector)) is None
    assert guard.admit(Outgoing.of("PUT", "/robot/velocity/", "text/plain", wild.body)) is None
    assert guard.admit(Outgoing.of("GET", "/robot/pose/", "", b"")) is not None
