"""What an exception in a check says of the requirements that it was to judge."""

from conformance.engine.record_exception import record_exception
from conformance.transport.exchange import Exchange, NoAnswer, NoAnswerError, Request, Response, Unanswered
from conformance.verdict.run import Run

_IDS = ("http/date", "http/framing")
_FINE = Exchange(Request("GET", "http://robot/"), Response(200, (), b"", 1.0))
_SILENT = NoAnswerError(Unanswered(Request("GET", "http://robot/x"), "no answer within 10 s", NoAnswer.TIMEOUT))


def broken(error: Exception, *judged: str, alive: bool = True) -> Run:
    run = Run()
    for id_ in judged:
        run.judge.check(id_, holds=True, exchange=_FINE, expected="")
    try:
        raise error
    except (ValueError, NoAnswerError) as raised:
        record_exception(run, lambda: alive, _IDS, dict.fromkeys(_IDS, 0), raised)
    return run


def test_what_was_not_judged_yet_is_told_of():
    run = broken(ValueError("no"), "http/date")
    assert [bool(run.judge.evidence[id_].errors) for id_ in _IDS] == [False, True]


def test_when_all_were_judged_it_is_told_of_all():
    assert all(broken(ValueError("no"), *_IDS).judge.evidence[id_].errors for id_ in _IDS)
    assert set(broken(_SILENT, *_IDS).judge.refuted()) == set(_IDS)


def test_a_robot_that_is_gone_ends_the_run():
    run = broken(_SILENT, alive=False)
    assert "stopped answering (no answer within 10 s, at GET http://robot/x)" in run.aborted
    assert all(run.judge.evidence[id_].errors for id_ in _IDS)
