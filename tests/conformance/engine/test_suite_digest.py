"""Two runs with the same digest asked the same: it covers what judges, and nothing else."""

import shutil

import pytest
from small_device import contract_of, described

from conformance.contract.pack import Contract
from conformance.contract.requirement_sets import judged_by, load_set
from conformance.engine.suite import JUDGING, contract_digests, suite_digest, suite_facts
from conformance.papers_robot.statement import CONTRACT_DIR
from conformance.verdict.verdicts import holds_back

_OTHERS = ("fleet", "cli", "explaining", "packs", "commandline", "history")


@pytest.fixture
def package(tmp_path):
    """A suite with one module in each room."""
    for room in (*JUDGING, *_OTHERS):
        (tmp_path / room).mkdir()
        (tmp_path / room / "module.py").write_text("x = 1\n")
    return tmp_path


def test_the_rooms_that_judge_are_all_there_are_but_these():
    rooms = {path.parent.name for path in CONTRACT_DIR.parents[1].glob("*/__init__.py")}
    assert rooms - set(JUDGING) == set(_OTHERS)


@pytest.mark.parametrize("room", _OTHERS)
def test_what_does_not_judge_is_not_in_it(package, room):
    before = suite_digest(Contract.load(), package)
    (package / room / "module.py").write_text("x = 2\n")
    assert suite_digest(Contract.load(), package) == before


@pytest.mark.parametrize("room", JUDGING)
def test_what_judges_is_in_it(package, room):
    before = suite_digest(Contract.load(), package)
    (package / room / "module.py").write_text("x = 2\n")
    assert suite_digest(Contract.load(), package) != before


def test_where_a_module_lies_is_in_it(package):
    before = suite_digest(Contract.load(), package)
    (package / "rules" / "module.py").rename(package / "rules" / "other.py")
    (package / "api" / "module.py").rename(package / "rules" / "module.py")
    (package / "rules" / "other.py").rename(package / "api" / "module.py")
    assert suite_digest(Contract.load(), package) == before, "the same modules at the same places"
    (package / "api" / "inner").mkdir()
    (package / "api" / "module.py").rename(package / "api" / "inner" / "module.py")
    assert suite_digest(Contract.load(), package) != before


def test_the_contract_is_in_it(package, tmp_path_factory):
    own = tmp_path_factory.mktemp("own")
    shutil.copy(CONTRACT_DIR / "openapi.yaml", own)
    before = suite_digest(Contract.load(own), package)
    (own / "openapi.yaml").write_text((own / "openapi.yaml").read_text() + "\n")
    assert suite_digest(Contract.load(own), package) != before


def test_a_pack_without_frozen_sets_has_the_one_of_its_ledger(tmp_path):
    contract = contract_of(tmp_path / "pack", described({}))
    scored = judged_by(contract, None)
    assert scored is not None
    assert suite_facts(str(contract.directory))["requirement_sets"] == {"unfrozen": scored.digest}
    assert "1.2" in suite_facts()["requirement_sets"]


def test_a_verifier_knows_the_whole_ledger():
    contract, found = Contract.load(), suite_facts()
    assert list(found["ledger"]) == list(contract.ledger)
    decides = {id_ for id_, item in found["ledger"].items() if item["decides"]}
    assert decides == {id_ for id_, item in contract.ledger.items() if holds_back(item)}
    frozen = load_set(contract, "1.2").requirements
    assert {id_ for id_, item in found["ledger"].items() if "1.2" in item["sets"]} == set(frozen)
    assert found["contract"] == contract_digests(contract)
