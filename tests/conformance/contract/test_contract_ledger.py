"""The ledger has every class, and every requirement can be told from every other."""

import re

import pytest
from small_device import contract_of

from conformance.contract.classes import Topic
from conformance.contract.described import write_described_pack
from conformance.contract.generic import generic_classes, generic_ledger
from conformance.contract.ledger import LedgerError, load_ledger
from conformance.contract.locating import ContractError
from conformance.contract.pack import Contract
from conformance.contract.requirement_sets import load_set
from conformance.verdict.evidence import Judge

CONTRACT = Contract.load()
LEDGER, CLASSES = CONTRACT.ledger, CONTRACT.classes


def test_every_class_has_requirements_and_says_what_it_needs():
    by_class = {name: [item for item in LEDGER.values() if item.class_ == name] for name in CLASSES}
    assert all(len(items) >= 5 for items in by_class.values())
    reach = [item for item in LEDGER.values() if item.id.endswith("/reachable")]
    assert {name for item in reach for name in item.classes} == set(CLASSES) - {"describe", "rest-formats"}
    assert set(CONTRACT.profiles["full"]) == set(CLASSES)
    of_maps = {"motion", "ros-gateway", "states"}
    assert set(generic_classes()) - {"description", "robustness", "soap", "web-server"} - of_maps < set(CLASSES)


def test_generic_requirements_name_nothing_of_the_robot():
    for item in generic_ledger().values():
        assert "contract.md" not in item.source
        assert "/robot/" not in item.text


def test_texts_are_sentences_and_unlike_each_other():
    for item in LEDGER.values():
        assert item.text.endswith(".")
        assert item.source.strip()
    for class_ in CLASSES:
        texts = [item.text for item in LEDGER.values() if item.class_ == class_]
        assert len(set(texts)) == len(texts)


def test_all_files_of_the_contract_are_there():
    names = {path.name for path in CONTRACT.files}
    assert {"contract.md", "openapi.yaml", "robot.wadl", "requirements.toml", "pack.toml", "publishers.wsdl"} < names


@pytest.mark.parametrize("name", ["R2003", "R2028", "R2105", "R2201", "R2204", "R2206", "R2304", "R2401", "R2718"])
def test_rules_of_the_basic_profile_for_descriptions(name):
    item = CONTRACT.requirement(f"describe/wsdl-{name}")
    assert item is not None
    assert re.search(rf"^BP .*\b{name}\b", item.source)


def test_an_id_that_went_is_an_alias_of_the_requirement_that_asks_it_now():
    """Nothing that was asked by 1.1 is lost: each id is there, or an alias."""
    assert set(load_set(CONTRACT, "1.2").requirements) <= set(LEDGER) | set(CONTRACT.ids_by_alias)
    assert set(CONTRACT.ids_by_alias.values()) <= set(LEDGER)
    assert not set(CONTRACT.ids_by_alias) & set(LEDGER)
    assert Contract.load(only=("rest-delivery/put-body",)).ledger.keys() == {"rest-delivery/put"}


def test_what_is_hygiene_says_what_breaks():
    for item in LEDGER.values():
        assert (item.topic is Topic.HYGIENE) == (item.breaks is not None), item.id


@pytest.mark.parametrize(
    "text",
    [
        "[http.x]\nlevel = 'MUST'\ntext = 'A.'\n",
        "[http.x]\nlevel = 'WILL'\ntext = 'A.'\nsource = 's'\norigin = 'norm'\n",
        "[dance.x]\nlevel = 'MUST'\ntext = 'A.'\nsource = 's'\norigin = 'norm'\n",
        "[http.x]\nlevel = 'MUST'\ntext = 'A.'\nsource = 's'\norigin = 'norm'\nneeds = ['luck']\n",
        "[http.x]\nlevel = 'MUST'\ntext = 'A.'\nsource = 's'\norigin = 'norm'\nweight = 1\n",
        "[http.x]\nlevel = 'MUST'\ntext = 'A.'\nsource = 's'\n",
        "[http.x]\nlevel = 'MUST'\ntext = 'A.'\nsource = 's'\norigin = 'hearsay'\n",
        "[http",
    ],
)
def test_a_ledger_that_cannot_be_used(tmp_path, text):
    (tmp_path / "requirements.toml").write_text(text)
    with pytest.raises(LedgerError):
        load_ledger(tmp_path / "requirements.toml", CLASSES)


def test_a_folder_that_describes_nothing(tmp_path):
    with pytest.raises(ContractError, match="describes nothing"):
        Contract.load(tmp_path)


def test_a_class_that_a_pack_does_not_name_is_within_another(tmp_path):
    moved = [item for item in LEDGER.values() if item.id.startswith("web-server/")]
    assert {item.classes for item in moved} == {("http",)}
    assert all(CONTRACT.ids_by_alias[f"http/{item.id.partition('/')[2]}"] == item.id for item in moved)
    assert CONTRACT.requirement("web-server/host-invalid") is None, "no pack gets a new one without naming the class"
    described = Contract.load(write_described_pack(tmp_path, {"paths": {}}, {"paths": {}}))
    assert {item.classes for id_, item in described.ledger.items() if id_ in {one.id for one in moved}} == {
        ("web-server",)
    }
    assert "web-server" in described.classes
    assert "web-server" not in described.profiles["full"]


def test_a_requirement_asks_the_same_as_one_of_the_generic_suite_that_the_contract_does_not_have():
    ledger = Contract.load().ledger
    named = [other for item in ledger.values() for other in item.same_as]
    assert named
    assert set(named) <= generic_ledger().keys() - ledger.keys()
    assert len(named) == len(set(named))


def test_what_judges_one_that_asks_the_same_judges_the_contract_s_own():
    judge = Judge(Contract.load().ledger)
    judge.announce(["http/no-traceback", "robustness/no-internals"])
    judge.check("robustness/no-internals", True, None, "")
    evidence = judge.evidence["http/no-traceback"]
    assert (evidence.cases, evidence.parts) == (1, {"http/no-traceback": 1})
    assert judge.counts(["robustness/no-internals"]) == {"robustness/no-internals": 1}


def test_a_contract_has_one_of_two_generic_requirements_that_ask_the_same(tmp_path):
    document = {"openapi": "3.1.0", "info": {"title": "Door", "version": "1"}, "paths": {}}
    ledger = contract_of(tmp_path, document).ledger
    generic = generic_ledger()
    twice = {id_ for id_, item in generic.items() if item.same_as}
    assert {"http/declared-status", "http/declared-body"} <= twice
    assert twice.isdisjoint(ledger)
    assert {other for id_ in twice for other in generic[id_].same_as} <= ledger.keys()
