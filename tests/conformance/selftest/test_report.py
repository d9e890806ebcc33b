"""What a self-test says in the end."""

import json

from conformance.contract.pack import Contract
from proof.selftest.certifying import Outcome
from proof.selftest.controls import ControlResult
from proof.selftest.mutant_run import MutantResult
from proof.selftest.report import Report
from proof.table1.mutants import MUTANTS

CONTRACT = Contract.load()


def outcome(code, **verdicts):
    reasons = {id_.replace("_", "/", 1): "said" for id_, value in verdicts.items() if value != "pass"}
    return Outcome(code, {id_.replace("_", "/", 1): value for id_, value in verdicts.items()}, reasons, 10, 1.0)


def test_a_survivor_and_a_false_positive_are_reported(tmp_path):
    mutant = MUTANTS[0]
    report = Report(
        CONTRACT,
        "reference",
        [MutantResult(mutant, survived=mutant.catches, reasons={mutant.catches[0]: "pass: pass"})],
    )
    report.control_results = [ControlResult("plain", "", 3, outcome(1, http_date="fail"))]
    assert not report.holds
    assert f"SURVIVED {mutant.name}" in report.summary()
    assert "FALSE POSITIVE plain, seed 3, exit code 1: http/date: said" in report.summary()
    report.write(tmp_path)
    assert json.loads((tmp_path / "selftest.json").read_text())["holds"] is False


def test_nothing_tried_is_no_proof():
    assert not Report(CONTRACT, "reference").holds
    assert Report(
        CONTRACT, "reference", control_results=[ControlResult("plain", "", 0, outcome(0, http_date="pass"))]
    ).holds
    assert not Report(
        CONTRACT, "reference", control_results=[ControlResult("plain", "", 0, outcome(4, http_date="skip"))]
    ).holds


def test_what_is_not_installed_is_said():
    found = [
        ControlResult("reference", "nginx", 0, None, "not installed: apt install nginx"),
        ControlResult("plain", "", 0, outcome(0, http_date="pass")),
    ]
    report = Report(CONTRACT, "reference", control_results=found)
    assert report.holds
    assert "not tried: reference (nginx): not installed: apt install nginx" in report.summary()
