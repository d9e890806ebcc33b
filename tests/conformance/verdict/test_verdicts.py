"""The rules by which evidence becomes verdicts."""

import pytest

from conformance.contract.classes import Level, Origin
from conformance.contract.ledger import Requirement
from conformance.verdict.evidence import Evidence, Judge
from conformance.verdict.verdicts import class_verdicts, overall, verdict_of, views

_CLAIMS = ("http",)


def _requirement(level="MUST", name="x", **fields) -> Requirement:
    return Requirement(f"http/{name}", "http", Level(level), "A text.", "RFC", Origin.NORM, **fields)


def _evidence(*, cases=0, failing=False, skips=(), errors=()) -> Evidence:
    judge = Judge({"http/x"})
    for _ in range(cases):
        judge.check("http/x", True, None, "something")
    if failing:
        judge.check("http/x", False, None, "something", found="nothing")
    evidence = judge.evidence["http/x"]
    evidence.skips.extend(skips)
    evidence.errors.extend(errors)
    return evidence


@pytest.mark.parametrize(
    ("level", "evidence", "expected"),
    [
        ("MUST", {"cases": 1}, "pass"),
        ("MUST", {"failing": True}, "fail"),
        ("SHOULD", {"failing": True}, "warn"),
        ("MAY", {"failing": True}, "pass"),
        ("MUST", {}, "skip"),
        ("MUST", {"cases": 5, "skips": ["no motion"]}, "skip"),
        ("MUST", {"cases": 5, "skips": ["no motion"], "failing": True}, "fail"),
        ("MUST", {"cases": 5, "errors": ["gone"], "skips": ["no motion"]}, "error"),
    ],
)
def test_a_requirement_is_judged_by_its_level_and_evidence(level, evidence, expected):
    assert verdict_of(_requirement(level), _evidence(**evidence), _CLAIMS).value == expected


def test_what_needs_an_undeclared_figure_is_not_judged_and_holds_its_class_back():
    requirement = _requirement(needs=("motion", "hold"))
    undeclared = {"hold": "not judged: the statement declares no hold time"}
    passing = verdict_of(requirement, _evidence(cases=3), _CLAIMS, undeclared)
    assert (passing.value, passing.reason) == ("skip", undeclared["hold"])
    assert class_verdicts([passing], _CLAIMS)["http"][0] == "inconclusive"
    assert verdict_of(requirement, _evidence(failing=True), _CLAIMS, undeclared).value == "fail"
    assert verdict_of(requirement, _evidence(cases=3), _CLAIMS).value == "pass"


@pytest.mark.parametrize(
    ("cases", "expected"), [((1, 1), "seen on ROS"), ((1, 0), "black box"), ((0, 1), "black box"), ((), None)]
)
def test_from_where_a_class_was_seen(cases, expected):
    seen = [verdict_of(_requirement(needs=("probe",)), _evidence(cases=number), _CLAIMS) for number in cases]
    assert views([verdict_of(_requirement(), _evidence(cases=1), _CLAIMS), *seen]).get("http") == expected


def test_what_is_not_claimed_is_not_judged():
    assert verdict_of(_requirement(), _evidence(failing=True), ("safety",)).value == "not-claimed"


def _class(*members) -> tuple[str, str]:
    verdicts = [verdict_of(requirement, evidence, _CLAIMS) for requirement, evidence in members]
    return class_verdicts(verdicts, _CLAIMS)["http"]


def test_a_failed_must_fails_the_class_whatever_was_skipped():
    value, reason = _class(
        (_requirement(name="a"), _evidence(skips=["no motion"])), (_requirement(name="b"), _evidence(failing=True))
    )
    assert (value, "http/b" in reason) == ("fail", True)


def test_a_skipped_must_outranks_what_passed():
    value, reason = _class(
        (_requirement(name="a"), _evidence(cases=9)), (_requirement(name="b"), _evidence(skips=["no motion"]))
    )
    assert (value, "no motion" in reason) == ("inconclusive", True)


@pytest.mark.parametrize(
    "requirement",
    [_requirement("SHOULD"), _requirement("MAY"), _requirement(needs=("probe",)), _requirement(untestable="y")],
)
def test_what_need_not_be_judged_does_not_hold_a_class_back(requirement):
    assert _class((_requirement(), _evidence(cases=1)), (requirement, _evidence()))[0] == "pass"


@pytest.mark.parametrize(("level", "expected"), [("MAY", "pass"), ("SHOULD", "inconclusive"), ("MUST", "inconclusive")])
def test_an_error_in_what_is_optional_does_not_hold_a_class_back(level, expected):
    broken = (_requirement(level), _evidence(errors=["the suite could not judge this"]))
    assert _class((_requirement(), _evidence(cases=1)), broken)[0] == expected


def test_a_warning_leaves_the_class_passed():
    assert _class((_requirement(), _evidence(cases=1)), (_requirement("SHOULD"), _evidence(failing=True)))[0] == "pass"


def test_a_class_of_which_nothing_was_executed_has_not_passed():
    assert _class((_requirement("SHOULD"), _evidence()))[0] == "inconclusive"


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        (["pass", "not-claimed"], "conformant"),
        (["pass", "fail", "inconclusive"], "not-conformant"),
        (["pass", "inconclusive"], "inconclusive"),
        (["not-claimed"], "inconclusive"),
        ([], "inconclusive"),
    ],
)
def test_the_robot_is_judged_by_its_classes(values, expected):
    assert overall({str(index): (value, "") for index, value in enumerate(values)}) == expected


def test_failures_of_one_cause_are_one_finding():
    judge = Judge({"http/x"})
    for status in range(200, 220):
        judge.check("http/x", False, None, "status 404", found=f"status {status}")
    findings = judge.evidence["http/x"].findings
    assert [finding.seen for finding in findings.values()] == [20]
