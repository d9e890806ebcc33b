"""Ledger, checks, faults and the coverage page agree."""

from pathlib import Path

import pytest

from conformance.contract.files import CONTRACT_DIR
from conformance.contract.ledger import load_ledger
from conformance.selftest import coverage
from conformance.selftest.mutants import FAULTS

ROOT = Path(coverage.__file__).parents[2]


def test_ledger_checks_and_faults_agree():
    assert coverage.disagreements() == []


def test_page_is_up_to_date():
    there = (ROOT / "docs" / "coverage.md").read_text(encoding="utf-8")
    assert there == coverage.page(), "run: roaas contract coverage --out docs/coverage.md"


def test_every_must_and_should_has_a_faulty_robot():
    shown = {id_ for fault in FAULTS for id_ in fault.catches}
    ledger = load_ledger(CONTRACT_DIR / "requirements.toml").values()
    assert [item.id for item in ledger if item.level != "MAY" and not item.untestable and item.id not in shown] == []


def test_there_are_many_and_each_has_its_own_name():
    assert len(FAULTS) >= 80
    assert len({fault.name for fault in FAULTS}) == len(FAULTS)


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_fault_is_well_made(fault):
    assert fault.interface in {"rest", "soap", "both"}
    assert fault.catches
    assert fault.says.endswith(".")
    assert callable(fault.make())
    assert fault.torn is None or callable(fault.torn())


def test_each_run_gets_a_change_of_its_own():
    changes = [fault.make() for fault in FAULTS if fault.name == "pose-stamp-backwards" for _ in range(2)]
    assert changes[0] is not changes[1]


def test_a_disagreement_is_told(monkeypatch):
    monkeypatch.setattr(coverage, "checks_by_requirement", lambda: {"http/no-such": ("test_x::test_y",)})
    told = coverage.disagreements()
    assert "test_x::test_y judges 'http/no-such', which the ledger does not have" in told
    assert "http/date has no check" in told
