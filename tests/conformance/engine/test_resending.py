"""A failure that does not come back is told as intermittent, and stays one."""

from types import SimpleNamespace

import pytest

from conformance.engine import resending
from conformance.engine.resending import look_again
from conformance.transport.client import Connection
from conformance.transport.exchange import Exchange, Request, Response
from conformance.verdict.run import Run
from conformance.verdict.verdicts import verdict_of

_BAD, _GOOD = Response(500, (), b"", 1.0), Response(200, (), b"x", 1.0)


def _run(method="GET", answer=_BAD):
    run = Run(claims=("http",))
    run.judge.check("http/head", False, Exchange(Request(method, "http://r2/"), answer), "status 200")
    return run


@pytest.mark.parametrize(("again", "expected"), [([_BAD] * 5, (5, 5)), ([_BAD, _GOOD, _GOOD, _GOOD, _BAD], (2, 5))])
def test_how_often_it_comes_back(monkeypatch, again, expected):
    run, answers = _run(), iter(again)
    monkeypatch.setattr(resending, "send_again", lambda request, _: Exchange(request, next(answers)))
    look_again(run, Connection())
    evidence = run.judge.evidence["http/head"]
    (finding,) = evidence.findings.values()
    assert finding.again[:2] == expected
    verdict = verdict_of(run.contract.ledger["http/head"], evidence, run.claims)
    assert verdict.value == "fail"
    assert ("the request had the same kind of response 2 times: the failure is intermittent" in verdict.reason) == (
        expected[0] < 5
    )


def test_an_observer_s_word_counts_more_than_the_status(monkeypatch):
    run = _run()
    holds = iter([True, False, True, True, True])

    def send(request, _):
        run.judge.check("http/head", next(holds), Exchange(request, _GOOD), "status 200")
        return Exchange(request, _GOOD)

    monkeypatch.setattr(resending, "send_again", send)
    look_again(run, Connection())
    assert next(iter(run.judge.evidence["http/head"].findings.values())).again == (1, 5, True)


def _sent_again(monkeypatch, run, answer=_GOOD):
    """What is put down of a finding, and whether the robot was left at rest."""
    stopped = []
    monkeypatch.setattr(resending, "send_again", lambda request, _: Exchange(request, answer))
    monkeypatch.setattr(resending, "stop_device", stopped.append)
    look_again(run, Connection(), SimpleNamespace(client=SimpleNamespace(base_url="http://robot")))
    return next(iter(run.judge.evidence["http/head"].findings.values())).again, bool(stopped)


def test_what_is_not_safe_is_not_sent_again_to_a_robot_that_may_not_be_moved(monkeypatch):
    assert _sent_again(monkeypatch, _run("PUT")) == (None, False)


def test_an_error_of_the_server_is_asked_for_again_where_the_robot_may_be_moved(monkeypatch):
    run = _run("PUT")
    run.allow_motion = True
    assert _sent_again(monkeypatch, run) == ((0, 5, False), True)


def test_what_may_be_right_in_another_state_of_the_robot_is_not_sent_again(monkeypatch):
    run = _run("PUT", _GOOD)
    run.allow_motion = True
    assert _sent_again(monkeypatch, run) == (None, False)


def test_a_fault_is_no_error_page_with_its_status(monkeypatch):
    page, fault = (Response(500, (("Content-Type", "text/xml"),), body, 1.0) for body in (b"oops", b"<fault/>"))
    run = _run("POST", page)
    run.allow_motion = True
    assert _sent_again(monkeypatch, run, fault) == ((0, 5, False), True)
    assert _sent_again(monkeypatch, run, page) == ((5, 5, False), True)
