"""A baseline accepts known failures for a while, and is itself judged."""

import datetime as dt

import pytest

from conformance.contract.classes import Level, Origin
from conformance.contract.ledger import Requirement
from conformance.verdict.baseline import (
    BaselineError,
    Expectation,
    accepted_until,
    apply_baseline,
    baseline_text,
    load_baseline,
    stale_entries,
)
from conformance.verdict.evidence import Evidence
from conformance.verdict.finding import Finding, Showing
from conformance.verdict.verdicts import Value, Verdict

_TODAY = dt.date(2026, 11, 20)


def _applied(value, expires, *, intermittent=False):
    requirement = Requirement("http/date", "http", Level.MUST, "A text.", "RFC", Origin.NORM)
    entry = Expectation("http/date", "ticket 7", dt.date.fromisoformat(expires), intermittent)
    return apply_baseline([Verdict(requirement, Value(value), "why", Evidence())], [entry], _TODAY)[0]


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        ("fail", {"2026-12-31": "warn", "2026-11-20": "warn", "2026-11-19": "fail"}),
        ("pass", {"2026-12-31": "error", "2026-11-19": "error"}),
        ("skip", {"2026-12-31": "skip"}),
        ("not-claimed", {"2026-12-31": "not-claimed"}),
    ],
)
def test_an_entry_changes_the_verdict_it_is_for(value, expected):
    assert {expires: _applied(value, expires).value for expires in expected} == expected


@pytest.mark.parametrize(
    ("value", "expires", "expected"),
    [("fail", "2026-12-31", "warn"), ("pass", "2026-12-31", "pass"), ("pass", "2026-11-19", "error")],
)
def test_an_intermittent_failure_may_also_pass(value, expires, expected):
    applied = _applied(value, expires, intermittent=True)
    assert applied.value == expected
    assert "ticket 7" in applied.reason


@pytest.mark.parametrize(
    ("named", "doubt", "expected"),
    [((), "", "warn"), (("GET /a", "GET /b"), "", "warn"), (("GET /a",), "", "fail"), (("GET /a",), "it may", "warn")],
)
def test_a_failure_of_an_operation_that_is_not_named_stays_one(named, doubt, expected):
    requirement = Requirement("http/date", "http", Level.MUST, "A text.", "RFC", Origin.NORM)
    evidence = Evidence()
    for label, unsure in (("GET /a", ""), ("GET /b", doubt)):
        finding = Finding("http/date", "RFC", label, "this", "that", None, doubt=unsure)
        evidence.findings[label] = finding
        finding.operations[label] = Showing(label)
    entry = Expectation("http/date", "ticket 7", dt.date(2026, 12, 31), operations=named)
    applied = apply_baseline([Verdict(requirement, Value.FAIL, "why", evidence)], [entry], _TODAY)[0]
    assert applied.value == expected
    assert ("does not name GET /b" in applied.reason) == (expected == "fail")


def test_accepted_is_what_all_entries_still_accept():
    verdicts = [_applied("fail", day) for day in ("2027-01-31", "2026-12-31")]
    assert accepted_until([*verdicts, _applied("skip", "2026-11-30")]) == "2026-12-31"
    assert accepted_until([_applied("fail", "2026-11-19")]) == ""


def test_an_expired_entry_is_named():
    assert "expired on 2026-11-19" in _applied("fail", "2026-11-19").reason


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("[[expected]]\nrequirement = 'http/dat'\nreason = 'x'\nexpires = 2027-01-01", "'http/dat'"),
        ("[[expected]]\nrequirement = 'http/date'\nexpires = 2027-01-01", "[[expected]] number 1: 'reason' is missing"),
        (
            "[[expected]]\nrequirement = 'http/date'\nreason = ' '\nexpires = 2027-01-01",
            "http/date has no reason: write why its failure is accepted",
        ),
        ("[[expected]]\nrequirement = 'http/date'\nreason = 'x'\nexpires = '2027-01-01'", "without quotes"),
        ("[[expect]]\nrequirement = 'http/date'", "'expect'"),
        ("[expected]\nrequirement = 'http/date'", "two brackets"),
    ],
)
def test_a_wrong_baseline_is_refused_by_name(tmp_path, text, named):
    path = tmp_path / "baseline.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(BaselineError) as error:
        load_baseline(path, {"http/date"})
    assert named in str(error.value)


def test_an_entry_with_an_id_that_went_is_one_of_the_requirement_that_asks_it_now(tmp_path):
    path = tmp_path / "baseline.toml"
    path.write_text('[[expected]]\nrequirement = "http/old"\nreason = "ticket 7"\nexpires = 2026-12-31\n')
    (entry,) = load_baseline(path, ["http/date"], {"http/old": "http/date"})
    assert (entry.requirement, entry.reason) == ("http/date", "ticket 7; http/old is http/date now")
    with pytest.raises(BaselineError, match="no requirement"):
        load_baseline(path, ["http/date"])


def test_a_written_baseline_asks_for_reasons_and_keeps_those_that_are_there(tmp_path):
    path = tmp_path / "baseline.toml"
    failed = [Requirement(f"http/{name}", "http", Level.MUST, "A text.", "RFC", Origin.NORM) for name in ("date", "x")]
    old = [Expectation("http/x", 'ticket "7"', dt.date(2027, 1, 1), intermittent=True)]
    failing = zip(failed, ({"PUT /b", "GET /a"}, {"GET /a"}), strict=True)
    path.write_text(baseline_text(failing, old, _TODAY), encoding="utf-8")
    with pytest.raises(BaselineError, match="http/date has no reason"):
        load_baseline(path, {"http/date", "http/x"})
    path.write_text(path.read_text().replace('reason = ""', 'reason = "a"'), encoding="utf-8")
    assert load_baseline(path, {"http/date", "http/x"}) == (
        Expectation("http/date", "a", _TODAY, operations=("GET /a", "PUT /b")),
        *old,
    )


@pytest.mark.parametrize(("intermittent", "stale"), [(False, ("http/date",)), (True, ())])
def test_an_entry_whose_requirement_passes_is_stale(intermittent, stale):
    requirement = Requirement("http/date", "http", Level.MUST, "A text.", "RFC", Origin.NORM)
    entry = Expectation("http/date", "ticket 7", dt.date(2026, 12, 31), intermittent)
    assert stale_entries([Verdict(requirement, Value.PASS, "", Evidence())], [entry]) == stale
    assert stale_entries([Verdict(requirement, Value.SKIP, "", Evidence())], [entry]) == ()


def test_a_failure_at_many_operations_is_accepted_at_all():
    failed = Requirement("http/date", "http", Level.MUST, "A text.", "RFC", Origin.NORM)
    many = {f"GET /{number}" for number in range(6)}
    assert "operations" not in baseline_text([(failed, many)], [], _TODAY)
