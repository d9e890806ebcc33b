"""What an exception in a check says of the requirements that it was to judge."""

import pytest

from conformance.engine.certification import draw_verdicts
from conformance.engine.record_exception import record_exception
from conformance.scenarios.scenario import NoOccasionError, NotPossibleError
from conformance.transport.exchange import Exchange, NoAnswer, NoAnswerError, Request, Response, Unanswered
from conformance.verdict.run import Run

_IDS = ("http/date", "http/framing")
_FINE = Exchange(Request("GET", "http://robot/"), Response(200, (), b"", 1.0))
_SILENT = NoAnswerError(Unanswered(Request("GET", "http://robot/x"), "no response within 10 s", NoAnswer.TIMEOUT))


def broken(error: Exception, *judged: str, alive: bool = True) -> Run:
    run = Run()
    for id_ in judged:
        run.judge.check(id_, holds=True, exchange=_FINE, expected="")
    try:
        raise error
    except (ValueError, NoAnswerError, NotPossibleError) as raised:
        record_exception(run, lambda: alive, _IDS, dict.fromkeys(_IDS, 0), raised)
    return run


def test_what_was_not_judged_yet_is_told_of():
    run = broken(ValueError("no"), "http/date")
    assert [bool(run.judge.evidence[id_].errors) for id_ in _IDS] == [False, True]


def test_when_all_were_judged_it_is_told_of_all():
    assert all(broken(ValueError("no"), *_IDS).judge.evidence[id_].errors for id_ in _IDS)
    assert set(broken(_SILENT, *_IDS).judge.failure_counts()) == set(_IDS)


@pytest.mark.parametrize(
    ("error", "values"), [(NotPossibleError("no"), ["skip", "skip"]), (NoOccasionError("no"), ["pass", "skip"])]
)
def test_without_an_occasion_what_other_checks_judged_stays_judged(error, values):
    run = broken(error, "http/date")
    run.claims = ("http",)
    by_id = {verdict.requirement.id: verdict for verdict in draw_verdicts(run)[0]}
    assert [by_id[id_].value for id_ in _IDS] == values
    assert all(by_id[id_].reason == "no" for id_ in _IDS)


def test_a_robot_that_is_gone_ends_the_run():
    run = broken(_SILENT, alive=False)
    assert "stopped responding (no response within 10 s, at GET http://robot/x)" in run.aborted
    assert all(run.judge.evidence[id_].errors for id_ in _IDS)


def test_a_request_that_the_robot_dies_of_is_a_finding_because_of_which_the_rest_is_not_tested():
    run = Run(claims=("http",))
    run.judge.at_risk = ("http/framing",)
    record_exception(run, lambda: False, _IDS, dict.fromkeys(_IDS, 0), _SILENT)
    verdicts, causes = draw_verdicts(run)
    by_id = {verdict.requirement.id: verdict for verdict in verdicts}
    assert by_id["http/framing"].value == "fail"
    assert "no response to any request since" in by_id["http/framing"].reason
    assert [(cause.finding.requirement, cause.finding.number, cause.finding.cause) for cause in causes] == [
        ("http/framing", 1, "hang")
    ]
    for id_ in ("http/date", "http/head"):
        assert (by_id[id_].value, by_id[id_].because.number) == ("skip", 1)
        assert id_ in causes[0].blocks
    assert by_id["safety/hold"].value == "not-claimed"


def test_a_robot_that_only_hangs_is_one_finding_of_all_requirements_of_a_check():
    run = broken(_SILENT)
    run.claims = ("http",)
    verdicts, (cause,) = draw_verdicts(run)
    by_id = {verdict.requirement.id: verdict.value for verdict in verdicts}
    assert [by_id[id_] for id_ in _IDS] == ["skip", "fail"]
    assert (cause.finding.requirement, cause.blocks) == ("http/framing", ("http/date",))
