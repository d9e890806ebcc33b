"""``roaas selftest`` and ``roaas contract`` as a user meets them."""

import json
import signal
import subprocess
import sys

import pytest
from click.testing import CliRunner

from conformance.cli.contract import contract
from conformance.cli.selftest import selftest
from conformance.contract.pack import Contract


def run(command, *words):
    return CliRunner().invoke(command, list(words))


def test_mutants_are_listed():
    done = run(selftest, "--list", "--faults", "wsdl-*")
    assert done.exit_code == 0
    assert "wsdl-float" in done.output
    assert "pose-stale" not in done.output


def test_a_pattern_that_fits_nothing_is_an_error_of_usage():
    done = run(selftest, "--faults", "no-such-*")
    assert done.exit_code == 2
    assert "no-such-*" in done.output


def test_without_ros_it_says_what_to_do(monkeypatch):
    monkeypatch.setattr("conformance.selftest.robots.find_spec", lambda _: None)
    done = run(selftest, "--faults", "pose-gone", "--seeds", "0", "--no-compare")
    assert done.exit_code == 3
    assert "--target baroque" in done.output


def test_a_mutant_is_caught_and_a_good_one_is_not_blamed(tmp_path):
    words = "--target baroque --faults sensors-twice --seeds 0 --no-variants --no-compare --short --out"
    done = run(selftest, *words.split(), str(tmp_path))
    assert done.exit_code == 0, done.output
    document = json.loads((tmp_path / "selftest.json").read_text())
    assert document["format"] == "roaas-selftest/1"
    assert document["faults"][0]["caught"] == ["rest-resources/sensors-unique"]
    assert "sensors-twice" in (tmp_path / "selftest.md").read_text()


@pytest.mark.parametrize("faults", [("--generated", "40"), ("--short", "--no-compare")])
def test_an_interrupted_self_test_keeps_what_it_has(tmp_path, faults):
    words = [*faults, "--target", "plain", "--seeds", "0", "--parallel", "1", "--out", str(tmp_path)]
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


def test_requirements_are_listed():
    done = run(contract, "list", "--class", "safety", "--level", "MUST")
    assert "safety/watchdog" in done.output
    assert "http/" not in done.output
    assert json.loads(run(contract, "list", "--json", "--class", "http").stdout)[0]["id"] == "http/reachable"


def test_the_contract_is_exported_and_not_over_what_is_there(tmp_path):
    assert run(contract, "export", str(tmp_path / "there")).exit_code == 0
    assert {path.name for path in (tmp_path / "there").iterdir()} == {path.name for path in Contract.load().files}
    assert run(contract, "export", str(tmp_path / "there")).exit_code == 2
    assert run(contract, "export", str(tmp_path / "there"), "--force").exit_code == 0


@pytest.mark.parametrize("words", [(), ("--help",)])
def test_the_group_explains_itself(words):
    assert "coverage" in run(contract, *words).output
