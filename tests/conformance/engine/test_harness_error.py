"""What ends a run early: an error of the suite is exit code 4 and not the robot's; a broken run never looks whole."""

import gc
import os
import signal
import sys
from dataclasses import replace

import pytest

from conformance.api.rest import calls
from conformance.contract.pack import Contract
from conformance.documents.xml import Node
from conformance.engine.certification import certify
from conformance.engine.progress import note_signals
from conformance.engine.robot_under_test import RobotUnderTest
from conformance.packs.table1.robot import delivery, soap_services
from conformance.packs.table1.statement import Statement
from conformance.statement.endpoints import Endpoints
from conformance.transport import raw
from conformance.verdict.effort import Effort
from conformance.verdict.run import Run
from proof.selftest.robots import running
from proof.table1.selftest import BAROQUE


@pytest.fixture(scope="module")
def statement():
    with running(Contract.load(), BAROQUE) as robot:
        yield Statement(endpoints=Endpoints(rest=robot.rest, publishers_wsdl=robot.publishers))


def certified(statement, requirement, tmp_path):
    contract = Contract.load(only=(requirement,))
    claims = (contract.ledger[requirement].class_,)
    run = Run(statement=statement, contract=contract, claims=claims, allow_motion=True, effort=Effort("quick"))
    return certify(RobotUnderTest(run), tmp_path, progress=None)


def _misspelt(monkeypatch):
    fit = calls._fit  # noqa: SLF001 - whose mistake it is to be

    def wrong(api, operation, value):
        found = fit(api, operation, value)
        is_velocity = isinstance(found, dict) and "linear" in found
        return {name.replace("linear", "liner"): one for name, one in found.items()} if is_velocity else found

    monkeypatch.setattr(calls, "_fit", wrong)


def _with_letters(monkeypatch):
    make = delivery.path_of
    monkeypatch.setattr(delivery, "path_of", lambda _code, *coordinates: make("four", *coordinates))


def _without_an_element(monkeypatch):
    make = soap_services.delivery

    def wrong(*given, **named):
        whole = make(*given, **named)
        (inside,) = whole.children
        return Node(whole.tag, "", (replace(inside, children=inside.children[1:]),))

    monkeypatch.setattr(soap_services, "delivery", wrong)


def _cut_short(monkeypatch):
    make = raw.chunked
    monkeypatch.setattr(raw, "chunked", lambda body, size: make(body, size)[:-2])


@pytest.mark.parametrize(
    ("mistake", "requirement"),
    [
        (_misspelt, "http/charset"),
        (_with_letters, "rest-delivery/put"),
        (_without_an_element, "soap-delivery/delivery"),
        (_cut_short, "http/chunked"),
    ],
)
def test_a_mistake_of_the_suite_s_own_is_no_failure(statement, tmp_path, monkeypatch, mistake, requirement):
    mistake(monkeypatch)
    outcome = certified(statement, requirement, tmp_path)
    (item,) = outcome.document["requirements"]
    assert (outcome.exit_code, item["verdict"]) == (4, "error"), item
    assert "HarnessError" in item["reason"]


class _Finalized:
    def __init__(self, number):
        self._number = number

    def __del__(self):
        os.kill(os.getpid(), self._number)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interruption_that_is_swallowed_is_remembered(number, monkeypatch):
    ignored = []
    monkeypatch.setattr(sys, "unraisablehook", lambda args: ignored.append(args.exc_type))
    run = Run()
    before = signal.getsignal(number)
    with note_signals(run):
        dying = _Finalized(number)
        del dying
        gc.collect()
    assert (ignored, run.interrupted) == ([KeyboardInterrupt], True)
    assert signal.getsignal(number) is before


def test_a_run_with_a_swallowed_interruption_ends_as_interrupted(tmp_path, monkeypatch):
    robot = RobotUnderTest(Run())

    def connect(_progress) -> None:
        robot.run.interrupted = True

    monkeypatch.setattr(robot, "connect", connect)
    ended = certify(robot, tmp_path, progress=None)
    assert (ended.exit_code, ended.document["interrupted"]) == (130, True)
