"""``roaas selftest`` and ``roaas contract`` as a user meets them, and what a self-test says in the end."""

import json
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from conformance.cli.contract import contract
from conformance.contract.pack import Contract
from proof.cli.selftest import selftest
from proof.selftest.certifying import Outcome
from proof.selftest.controls import ControlResult
from proof.selftest.mutant_run import MutantResult
from proof.selftest.report import Report
from proof.table1.mutants import MUTANTS
from roaas import FrontDoor


def run(command, *words):
    return CliRunner().invoke(command, list(words), obj=FrontDoor())


LAMP = str(Path(__file__).parents[3] / "examples" / "lamp")


@pytest.mark.parametrize(
    ("command", "words", "code", "said"),
    [
        (selftest, "--list --faults wsdl-*", 0, "wsdl-float"),
        (selftest, "--faults no-such-*", 2, "no-such-*"),
        (selftest, f"--contract {LAMP} --target candle", 2, "no good device 'candle': lamp"),
        (contract, f"coverage --contract {LAMP}", 0, "`test_lamp::fades`"),
    ],
    ids=["mutants are listed", "no such mutant", "no such device", "coverage of a small pack"],
)
def test_what_a_command_says(command, words, code, said):
    done = run(command, *words.split())
    assert (done.exit_code, said in done.output) == (code, True), done.output
    assert "pose-stale" not in done.output


def test_without_ros_it_says_what_to_do(monkeypatch):
    monkeypatch.setattr("proof.selftest.robots.find_spec", lambda _: None)
    done = run(selftest, "--faults", "pose-gone", "--seeds", "0", "--no-compare")
    assert (done.exit_code, "--target baroque" in done.output) == (3, True), done.output


def test_a_mutant_is_killed(tmp_path):
    words = "--target baroque --faults sensors-twice --seeds 0 --no-variants --no-compare --short --out"
    done = run(selftest, *words.split(), str(tmp_path))
    assert done.exit_code == 0, done.output
    document = json.loads((tmp_path / "selftest.json").read_text())
    assert document["format"] == "roaas-selftest/1"
    assert document["faults"][0]["caught"] == ["rest-resources/sensors-type"]
    assert "sensors-twice" in (tmp_path / "selftest.md").read_text()


@pytest.mark.parametrize("faults", [("--generated", "40"), ("--no-compare",)])
def test_an_interrupted_self_test_keeps_what_it_has(tmp_path, faults):
    words = ["--contract", LAMP, *faults, "--seeds", "0", "--no-variants", "--parallel", "1", "--out", str(tmp_path)]
    command = [sys.executable, "-m", "roaas", "selftest", *words]
    with subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True) as process:
        first = process.stderr.readline()
        process.send_signal(signal.SIGINT)
        rest = process.stderr.read()
        assert process.wait(60) == 130, first + rest
    assert first.startswith("[1/")
    assert "Traceback" not in rest
    document = json.loads((tmp_path / "selftest.json").read_text())
    done = len(document["generated"]["mutants"] if "generated" in document else document["faults"])
    assert 1 <= done < int(first.partition("]")[0].removeprefix("[1/"))
    assert "interrupted" in document["notes"][0]


def test_a_small_packs_mutants_are_made_by_rule_and_judged(tmp_path):
    words = ["--contract", LAMP, "--generated", "2", "--faults", "failing:*Lamp:answer", "--parallel", "1"]
    done = run(selftest, *words, "--out", str(tmp_path))
    assert (done.exit_code, "Mutants by rule killed: 2 of 2" in done.output) == (0, True), done.output
    document = json.loads((tmp_path / "selftest.json").read_text())
    assert {mutant["outcome"] for mutant in document["generated"]["mutants"]} == {"caught"}
    assert "--target lamp --contract lamp" in (tmp_path / "selftest.md").read_text()


def test_a_small_packs_controls_run_without_mutants(tmp_path):
    words = ["--contract", LAMP, "--controls-only", "--seeds", "1", "--no-variants", "--out", str(tmp_path)]
    done = run(selftest, *words)
    assert done.exit_code == 0, done.output
    assert "1 of 1 A/A controls (good devices) found conformant" in done.output


def test_a_pack_that_does_not_say_how_its_device_starts_is_told_what_it_needs(tmp_path):
    (tmp_path / "openapi.yaml").write_text(Path(LAMP, "openapi.yaml").read_text())
    done = run(selftest, "--contract", str(tmp_path), "--generated", "1")
    assert (done.exit_code, "selftest.py" in done.output) == (2, True), done.output
    assert (
        "status:GET /lamp:answer-418"
        in run(selftest, "--contract", str(tmp_path), "--generated", "900", "--list").output
    )


def test_requirements_are_listed():
    done = run(contract, "list", "--class", "safety", "--level", "MUST")
    assert "safety/watchdog" in done.output
    assert "http/" not in done.output
    listed = json.loads(run(contract, "list", "--json", "--class", "http").stdout)
    assert "http/head" in {item["id"] for item in listed}


def test_the_contract_is_exported_and_not_over_what_is_there(tmp_path):
    assert run(contract, "export", str(tmp_path / "there")).exit_code == 0
    assert {path.name for path in (tmp_path / "there").iterdir()} == {path.name for path in Contract.load().files}
    assert run(contract, "export", str(tmp_path / "there")).exit_code == 2
    assert run(contract, "export", str(tmp_path / "there"), "--force").exit_code == 0


@pytest.mark.parametrize("words", [(), ("--help",)])
def test_the_group_explains_itself(words):
    assert "coverage" in run(contract, *words).output


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
