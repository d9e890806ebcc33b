"""The ledger has every class, and every requirement can be told from every other."""

import pytest

from conformance.contract.generic import generic_classes, generic_ledger
from conformance.contract.ledger import LedgerError, load_ledger
from conformance.contract.locating import ContractError
from conformance.contract.pack import Contract

CONTRACT = Contract.load()
LEDGER, CLASSES = CONTRACT.ledger, CONTRACT.classes


def test_every_class_has_requirements_and_says_what_it_needs():
    by_class = {name: [item for item in LEDGER.values() if item.class_ == name] for name in CLASSES}
    assert all(len(items) >= 5 for items in by_class.values())
    assert all(f"{name}/reachable" in LEDGER for name in CLASSES if name not in {"describe", "rest-formats"})
    assert set(CONTRACT.profiles["full"]) == set(CLASSES)
    assert set(generic_classes()) - {"description", "robustness"} < set(CLASSES)


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
    assert f"BP {name}" in LEDGER[f"describe/wsdl-{name}"].source


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
