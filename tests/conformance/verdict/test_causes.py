"""What several requirements meet is one finding, and all others point to it."""

import datetime as dt

import pytest

from conformance.contract.generic import generic_ledger
from conformance.engine.record_exception import record_exception
from conformance.transport.exchange import Exchange, NoAnswer, NoAnswerError, Request, Response, Unanswered
from conformance.verdict.baseline import Expectation, apply_baseline
from conformance.verdict.causes import by_cause
from conformance.verdict.evidence import Judge
from conformance.verdict.run import Run
from conformance.verdict.verdicts import class_verdicts, overall, verdict_of

_CLAIMS = ("rest-resources", "rest-formats", "http")
_READ, _SERVICES, _XML = "rest-resources/sensors-type", "rest-resources/services-type", "rest-formats/xml"
_STATUS, _INPUT, _DATE = "http/declared-status", "http/no-server-error", "http/date"
_GOOD = Exchange(Request("GET", "http://r2/robot/velocity/"), Response(200, (), b"", 1.0))


def _closed(path="/robot/sensors/", **given):
    return Unanswered(Request("GET", f"http://r2{path}", **given), "the server closed the connection", NoAnswer.CLOSED)


def _error(path="/robot/sensors/", method="GET", **given):
    return Exchange(Request(method, f"http://r2{path}", **given), Response(500, (), b"", 1.0))


def _run(*failed, passed=()):
    run = Run(claims=_CLAIMS)
    for id_ in run.contract.ledger:
        if id_ in passed or id_.endswith("/reachable"):
            run.judge.check(id_, True, _GOOD, "a response")
    for id_, exchange in failed:
        run.judge.check(id_, False, exchange, "a response")
    return run


def _told(run):
    seen, causes = by_cause(run.judge.evidence, run.contract.ledger, run.claims)
    return seen, [(cause.finding.requirement, cause.finding.number, cause.blocks) for cause in causes]


def test_a_closed_connection_is_one_finding_of_who_met_it_first():
    run = _run((_SERVICES, _closed()), (_READ, _closed()), (_XML, _closed()))
    seen, causes = _told(run)
    assert causes == [(_SERVICES, 1, (_READ, _XML))]
    verdict = verdict_of(run.contract.ledger[_XML], seen[_XML], run.claims)
    assert (verdict.value, verdict.because.number) == ("skip", 1)
    assert verdict.reason == (
        "Not tested, because of finding 1: GET /robot/sensors/: no response: the server closed the connection"
    )


def test_a_server_error_stays_with_the_requirement_that_forbids_it():
    _, causes = _told(_run((_READ, _error()), (_STATUS, _error()), (_XML, _error())))
    assert causes == [(_STATUS, 1, (_READ, _XML))]


def test_another_path_method_or_status_is_another_cause():
    run = _run(
        (_READ, _error()), (_XML, _error("/robot/pose/")), (_INPUT, _error(method="PUT")), (_SERVICES, _closed())
    )
    assert [blocks for _, _, blocks in _told(run)[1]] == [(), (), (), ()]


def test_values_in_a_path_make_no_other_cause():
    _, causes = _told(_run((_READ, _error("/robot/x/1.5?a=1")), (_XML, _error("/robot/x/-2.25?a=2"))))
    assert causes == [(_READ, 1, (_XML,))]


def test_a_must_keeps_the_finding_even_where_a_should_met_it_first():
    run = _run(("rest-formats/vary", _closed()), (_READ, _closed()))
    assert _told(run)[1] == [(_READ, 1, ("rest-formats/vary",))]


def test_a_request_by_hand_tests_its_own_rule_unless_an_ordinary_one_fails_as_well():
    by_hand = {"raw": b"GET /robot/sensors/ HTTP/1.1\r\n\r\n"}
    missing, twice = "web-server/host-missing", "web-server/content-length-conflict"
    alone = _run((missing, _closed(**by_hand)), (twice, _closed(**by_hand)))
    assert {requirement for requirement, _, _ in _told(alone)[1]} == {missing, twice}
    with_ordinary = _run((missing, _closed(**by_hand)), (twice, _closed(**by_hand)), (_READ, _closed()))
    assert len(_told(with_ordinary)[1]) == 1


def test_what_breaks_its_own_rule_as_well_fails():
    run = _run((_READ, _closed()), (_XML, _closed()), (_XML, _GOOD))
    seen, causes = _told(run)
    assert causes == [(_READ, 1, ()), (_XML, 2, ())]
    assert verdict_of(run.contract.ledger[_XML], seen[_XML], run.claims).value == "fail"


def test_a_finding_of_several_causes_is_hidden_only_when_all_are_told():
    run = Run(claims=_CLAIMS)
    for path in ("/robot/sensors/", "/robot/pose/"):
        run.judge.check(_XML, False, _error(path), "200", cause="status")
    run.judge.check(_STATUS, False, _error(), "200")
    assert {requirement for requirement, _, _ in _told(run)[1]} == {_STATUS, _XML}
    run.judge.check(_STATUS, False, _error("/robot/pose/"), "200")
    assert [requirement for requirement, _, _ in _told(run)[1]] == [_STATUS]


def test_what_an_observer_sees_holds_for_errors_as_well():
    run = _run((_READ, _error()))
    with run.judge.by_rule():
        run.judge.check(_DATE, False, _error(), "Date")
        run.judge.check(_STATUS, False, _error(), "a declared status")
    assert _told(run)[1] == [(_STATUS, 1, (_READ,)), (_DATE, 2, ())]


def test_a_class_that_waits_for_another_one_s_finding_is_inconclusive():
    ledger = Run().contract.ledger
    run = _run((_STATUS, _error()), (_READ, _error()), passed=ledger)
    seen, _ = by_cause(run.judge.evidence, ledger, run.claims)
    drawn = [verdict_of(requirement, seen[requirement.id], run.claims) for requirement in ledger.values()]
    classes = class_verdicts([item for item in drawn if item.value != "error"], run.claims)
    assert classes["http"][0] == "fail"
    value, reason = classes["rest-resources"]
    assert (value, "Not tested, because of finding 1" in reason) == ("inconclusive", True)
    assert overall(classes) == "not-conformant"


def test_the_order_is_level_then_kind_then_what_waits():
    hang = Unanswered(Request("GET", "http://r2/robot/goal/"), "no response within 2 s", NoAnswer.TIMEOUT)
    closed = (("rest-resources/velocity-type", _closed("/robot/velocity/")), (_READ, _closed()), (_XML, _closed()))
    good = (("http/date", _GOOD), ("rest-resources/pose-type", _GOOD))
    _, causes = _told(_run(*good, ("rest-resources/goal-get", hang), *closed))
    told = [requirement.removeprefix("rest-resources/") for requirement, _, _ in causes]
    assert told == ["sensors-type", "velocity-type", "goal-get", "pose-type", "http/date"]


def test_a_baseline_that_accepts_what_waits_still_does():
    run = _run((_READ, _closed()), (_XML, _closed()))
    seen, _ = by_cause(run.judge.evidence, run.contract.ledger, run.claims)
    verdict = verdict_of(run.contract.ledger[_XML], seen[_XML], run.claims)
    entry = Expectation(_XML, "known", dt.date(2030, 1, 1))
    (applied,) = apply_baseline([verdict], [entry], dt.date(2029, 1, 1))
    assert (applied.value, applied.because.number, "known" in applied.reason) == ("warn", 1, True)
    (expired,) = apply_baseline([verdict], [entry], dt.date(2031, 1, 1))
    assert expired.value == "skip"


def test_an_effect_that_a_check_found_is_no_cause_of_others():
    run = _run((_STATUS, _error()))
    run.judge.check(_READ, False, _error(), "a robot at rest", found="the robot moved by 0.3 m")
    run.judge.check(_XML, False, _closed(), "a robot at rest", found="the robot moved by 0.3 m")
    told = {(requirement, blocks) for requirement, _, blocks in _told(run)[1]}
    assert told == {(_STATUS, ()), (_READ, ()), (_XML, ())}


_HANG, _CRASH = "robustness/no-hang", "robustness/no-crash"
_REFUSALS = {
    "hang": (NoAnswer.TIMEOUT, "no response within 10 s", _HANG),
    "not sent again": (NoAnswer.CIRCUIT_OPEN, "not sent", _HANG),
    "closed": (NoAnswer.CLOSED, "the server closed the connection", _CRASH),
    "refused": (NoAnswer.REFUSED, "no connection", _CRASH),
}


@pytest.mark.parametrize("way", ["MUST", "exception"])
@pytest.mark.parametrize(("kind", "problem", "named"), _REFUSALS.values(), ids=_REFUSALS)
def test_a_missing_response_is_named_by_the_requirement_that_is_about_it(kind, problem, named, way):
    ledger = generic_ledger()
    run = Run(claims=("http", "robustness", "description"))
    run.judge = Judge(ledger)
    missing = Unanswered(Request("OPTIONS", "http://r2/fan"), problem, kind)
    for id_ in (_HANG, _CRASH, "http/date"):
        run.judge.check(id_, True, _GOOD, "a response")
    if way == "MUST":
        run.judge.check("http/allow", False, missing, "a response")
    else:
        ids = ("description/allow", "http/allow")
        record_exception(run, lambda: True, ids, dict.fromkeys(ids, 0), NoAnswerError(missing))
    seen, causes = by_cause(run.judge.evidence, ledger, run.claims)
    assert [cause.finding.requirement for cause in causes] == [named]
    assert "http/allow" in causes[0].blocks
    assert not seen["http/allow"].findings


@pytest.mark.parametrize(
    ("id_", "request_", "found"),
    [
        ("description/allow", Request("GET", "http://r2/fan"), ""),  # SHOULD: closing may be allowed
        ("http/framing", Request("GET", "http://r2/fan", raw=b"GET / HTTP/1.1"), ""),  # a rule of its own
        ("http/allow", Request("GET", "http://r2/fan"), "another response"),  # the check found something else
    ],
)
def test_what_a_check_allows_for_itself_is_no_crash(id_, request_, found):
    judge = Judge(generic_ledger())
    judge.check(id_, False, Unanswered(request_, "closed", NoAnswer.CLOSED), "a response", found=found)
    assert set(judge.failure_counts()) == {id_}
