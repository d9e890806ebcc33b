"""A failure that does not come back is told as intermittent, and stays one."""

import pytest

from conformance.engine import intermittent
from conformance.engine.intermittent import look_again
from conformance.transport.client import Connection
from conformance.transport.exchange import Exchange, Request, Response
from conformance.verdict.run import Run
from conformance.verdict.verdicts import verdict_of

_BAD, _GOOD = Response(500, (), b"", 1.0), Response(200, (), b"x", 1.0)


def _run(method="GET"):
    run = Run(claims=("http",))
    run.judge.check("http/head", False, Exchange(Request(method, "http://r2/"), _BAD), "status 200")
    return run


@pytest.mark.parametrize(("again", "expected"), [([_BAD] * 5, (5, 5)), ([_BAD, _GOOD, _GOOD, _GOOD, _BAD], (2, 5))])
def test_how_often_it_comes_back(monkeypatch, again, expected):
    run, answers = _run(), iter(again)
    monkeypatch.setattr(intermittent, "send_again", lambda request, _: Exchange(request, next(answers)))
    look_again(run, Connection())
    evidence = run.judge.evidence["http/head"]
    (finding,) = evidence.findings.values()
    assert finding.again == expected
    verdict = verdict_of(run.contract.ledger["http/head"], evidence, run.claims)
    assert verdict.value == "fail"
    assert ("intermittent: it came back 2 of 5 times" in verdict.reason) == (expected[0] < 5)


def test_an_observer_s_word_counts_more_than_the_status(monkeypatch):
    run = _run()
    holds = iter([True, False, True, True, True])

    def send(request, _):
        run.judge.check("http/head", next(holds), Exchange(request, _GOOD), "status 200")
        return Exchange(request, _GOOD)

    monkeypatch.setattr(intermittent, "send_again", send)
    look_again(run, Connection())
    assert next(iter(run.judge.evidence["http/head"].findings.values())).again == (1, 5)


def test_what_is_not_safe_is_not_sent_again(monkeypatch):
    monkeypatch.setattr(intermittent, "send_again", lambda *_: pytest.fail("sent again"))
    run = _run("PUT")
    look_again(run, Connection())
    assert next(iter(run.judge.evidence["http/head"].findings.values())).again is None
