"""Ledger, checks, mutants and the coverage page agree."""

from pathlib import Path

import pytest

from conformance.contract.classes import Level
from conformance.contract.pack import Contract
from conformance.packs.table1.mutants import MUTANTS
from conformance.selftest import coverage

ROOT = Path(coverage.__file__).parents[2]


def test_ledger_checks_and_mutants_agree():
    assert coverage.disagreements() == []


def test_page_is_up_to_date():
    there = (ROOT / "docs" / "coverage.md").read_text(encoding="utf-8")
    assert there == coverage.page(), "run: roaas contract coverage --out docs/coverage.md"


def test_every_must_and_should_has_a_mutant():
    shown = {id_ for mutant in MUTANTS for id_ in mutant.catches}
    ledger = Contract.load().ledger.values()
    assert [
        item.id for item in ledger if item.level is not Level.MAY and not item.untestable and item.id not in shown
    ] == []


def test_there_are_many_and_each_has_its_own_name():
    assert len(MUTANTS) >= 80
    assert len({mutant.name for mutant in MUTANTS}) == len(MUTANTS)


@pytest.mark.parametrize("mutant", MUTANTS, ids=lambda mutant: mutant.name)
def test_mutant_is_well_made(mutant):
    assert mutant.interface in {"rest", "soap", "both"}
    assert mutant.catches
    assert mutant.says.endswith(".")
    assert callable(mutant.make())
    assert mutant.incomplete_request is None or callable(mutant.incomplete_request())


def test_each_run_gets_a_change_of_its_own():
    changes = [mutant.make() for mutant in MUTANTS if mutant.name == "pose-stamp-backwards" for _ in range(2)]
    assert changes[0] is not changes[1]


def test_a_disagreement_is_told(monkeypatch):
    monkeypatch.setattr(coverage, "checks_by_requirement", lambda: {"http/no-such": ("test_x::test_y",)})
    told = coverage.disagreements()
    assert "test_x::test_y judges 'http/no-such', which the ledger does not have" in told
    assert "http/date has no check" in told
