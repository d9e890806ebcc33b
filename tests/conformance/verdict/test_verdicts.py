"""The rules by which evidence becomes verdicts, and what the verdict's first line says."""

import pytest

from conformance.contract.classes import Level, Origin, Prerequisite
from conformance.contract.ledger import Requirement
from conformance.contract.pack import Contract
from conformance.verdict.effort import Effort, Tally
from conformance.verdict.evidence import Evidence, Judge
from conformance.verdict.run import Run
from conformance.verdict.verdicts import ClassValue, Overall, class_verdicts, overall, verdict_line, verdict_of, views

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


def test_what_a_right_device_may_do_only_warns_until_something_else_is_found():
    judge = Judge({"http/x"})
    judge.check("http/x", False, None, "status 404", found="status 200", doubt="it may archive the thing")
    doubtful = verdict_of(_requirement(), judge.evidence["http/x"], _CLAIMS)
    assert (doubtful.value, class_verdicts([doubtful], _CLAIMS)["http"][0]) == ("warn", "pass")
    assert "a right device may do the same: it may archive the thing." in doubtful.reason
    judge.check("http/x", False, None, "status 404", found="status 200")
    sure = verdict_of(_requirement(), judge.evidence["http/x"], _CLAIMS)
    assert (sure.value, len(sure.evidence.findings)) == ("fail", 2)
    assert "may archive" not in sure.reason


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


_MERGED = _requirement(aliases=("http/part",), also=("safety",))


def _parts(*names, failing=()):
    judge = Judge({_MERGED.id: _MERGED})
    judge.announce(("http/x", "http/part"))
    for name in names:
        judge.check(name, name not in failing, None, "something", found="nothing")
    return verdict_of(_MERGED, judge.evidence["http/x"], _CLAIMS)


def test_a_requirement_passes_when_each_part_of_it_was_judged():
    """What was judged by two ids stays judged under one."""
    assert _parts("http/x", "http/part").value == "pass"
    assert _parts("http/x", "http/part", failing=("http/part",)).value == "fail"
    half = _parts("http/x")
    assert (half.value, half.reason) == ("skip", "nothing was executed for http/part, a part of it")


def test_a_requirement_of_two_classes_is_judged_for_either_and_fails_both():
    failed = _parts("http/x", failing=("http/x",))
    assert {name: value for name, (value, _) in class_verdicts([failed], ("http", "safety")).items()} == {
        "http": "fail",
        "safety": "fail",
    }
    assert verdict_of(_MERGED, _evidence(cases=1), ("safety",)).value == "pass"
    assert verdict_of(_MERGED, _evidence(cases=1), ("describe",)).value == "not-claimed"


def test_a_class_whose_effects_nobody_saw_on_ros_is_a_black_box():
    """A delivery that is listed and never published passes without a probe."""
    delivery = Requirement("d/put", "d", Level.MUST, "A text.", "contract.md#x", Origin.CONTRACT)
    on_list = Requirement("e/seen", "e", Level.MUST, "A.", "c", Origin.CONTRACT, needs=(Prerequisite.OBSERVER,))
    on_ros = Requirement("e/ros", "e", Level.MUST, "B.", "c", Origin.CONTRACT, needs=(Prerequisite.PROBE,))
    claims = ("d", "e")

    def seen(probe):
        cases = {delivery: 1, on_list: 1, on_ros: int(probe)}
        return views([verdict_of(item, Evidence(cases=number), claims) for item, number in cases.items()], {"d"})

    assert seen(probe=False) == {"d": "black box", "e": "black box"}
    assert seen(probe=True) == {"d": "seen on ROS", "e": "seen on ROS"}


def test_what_the_state_did_not_allow_is_not_tested_and_holds_no_class_back():
    unseen, seen = _evidence(), _evidence(cases=1)
    for evidence in (unseen, seen):
        evidence.unseen.append("POST /start was answered only 409: its state did not allow it")
    verdicts = [verdict_of(_requirement(name=name), one, _CLAIMS) for name, one in (("a", unseen), ("b", seen))]
    assert [one.value for one in verdicts] == ["skip", "pass"]
    assert all(one.reason.startswith("not seen: POST /start") for one in verdicts)
    assert class_verdicts(verdicts, _CLAIMS)["http"][0] == "pass"


def test_a_class_of_which_nothing_was_seen_is_inconclusive():
    unseen = _evidence()
    unseen.unseen.append("POST /start was answered only 409: its state did not allow it")
    assert class_verdicts([verdict_of(_requirement(), unseen, _CLAIMS)], _CLAIMS)["http"][0] == "inconclusive"


_ALL = tuple(Contract.load().classes)
_VERSION = Contract.load().version
_TWO = ("http", "safety")
_PASSED = {"http": (ClassValue.PASS, "")}


@pytest.mark.parametrize(
    ("claims", "value", "expected"),
    [
        (_ALL, Overall.CONFORMANT, f"conformant to full (contract {_VERSION}), black box"),
        (_ALL[:1], Overall.NOT_CONFORMANT, f"not conformant to {_ALL[0]} only (contract {_VERSION}), black box"),
        (
            ("safety", "http"),
            Overall.INCONCLUSIVE,
            f"inconclusive for safety, http only (contract {_VERSION}), black box",
        ),
    ],
)
def test_a_verdict_says_to_what(claims, value, expected):
    assert verdict_line(Run(claims=claims), value, []) == expected


def test_what_was_cut_stands_in_the_first_line():
    slow = Run(claims=_ALL, effort=Effort().slowed_to(240))
    assert verdict_line(slow, Overall.CONFORMANT, []).endswith("black box, on 5 % of the cases: 240 ms an answer")
    cut = Run(claims=_ALL, tally=Tally(planned=100, cut_short={"test_x": 30}))
    assert cut.less == "on 70 % of the cases: time ran out"
    assert Run(claims=_ALL, tally=Tally(planned=1000, cut_short={"test_x": 3})).less == ""


def test_too_few_cases_are_no_verdict_unless_the_robot_failed():
    assert Run(effort=Effort().slowed_to(240)).enough
    assert not Run(effort=Effort().slowed_to(2000)).enough
    assert overall(_PASSED) is Overall.CONFORMANT
    assert overall(_PASSED, enough=False) is Overall.INCONCLUSIVE
    assert overall({"http": (ClassValue.FAIL, "")}, enough=False) is Overall.NOT_CONFORMANT


def test_a_busy_machine_changes_no_case():
    """The same robot, beside others: some answers come late, and the shortest time stays."""
    assert Effort().slowed_to(90, 3).cases(200) == Effort().slowed_to(2, 1).cases(200)
    assert Effort().slowed_to(300, 240).speed.name == "far"
