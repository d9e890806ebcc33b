"""Ledger, checks, mutants and the coverage page agree; what a row of a mutant may say."""

import shutil
from pathlib import Path

import pytest

from conformance.contract.classes import Level
from conformance.contract.ledger import classes_of
from conformance.contract.locating import ContractError
from conformance.contract.pack import Contract
from proof.mutation import changes, fields
from proof.mutation.messages import Request, Response, unchanged
from proof.mutation.self_test import SelfTest
from proof.mutation.table import Mutant, read_rows
from proof.selftest import coverage
from proof.table1.mutants import MUTANTS

CONTRACT = Contract.load()
ROOT = Path(coverage.__file__).parents[2]


def test_ledger_checks_and_mutants_agree():
    assert coverage.disagreements(CONTRACT) == []


def test_page_is_up_to_date():
    there = (ROOT / "docs" / "coverage.md").read_text(encoding="utf-8")
    assert there == coverage.page(CONTRACT), "run: roaas contract coverage --out docs/coverage.md"


def test_every_must_and_should_has_a_mutant():
    shown = {id_ for mutant in MUTANTS for id_ in mutant.catches}
    ledger = CONTRACT.ledger.values()
    assert [
        item.id for item in ledger if item.level is not Level.MAY and not item.untestable and item.id not in shown
    ] == []


def test_there_are_many_and_each_has_its_own_name():
    assert len(MUTANTS) >= 80
    assert len({mutant.name for mutant in MUTANTS}) == len(MUTANTS)


def test_each_mutant_is_well_made():
    assert [mutant.name for mutant in MUTANTS if not _is_well_made(mutant)] == []


def _is_well_made(mutant):
    """What must kill a mutant is claimed in its run: an id begins with the class that judges any API."""
    claims, ids = classes_of(CONTRACT.ledger, mutant.catches), mutant.catches
    is_claimed = all(CONTRACT.ledger[CONTRACT.ids_by_alias.get(id_, id_)].binds(claims) for id_ in ids)
    is_told = mutant.interface in {"rest", "soap", "both"} and mutant.says.endswith(".") and ids
    can_cut = mutant.incomplete_request is None or callable(mutant.incomplete_request())
    return is_told and is_claimed and set(claims) <= CONTRACT.classes.keys() and callable(mutant.make()) and can_cut


def test_each_run_gets_a_change_of_its_own():
    changes = [mutant.make() for mutant in MUTANTS if mutant.name == "pose-stamp-backwards" for _ in range(2)]
    assert changes[0] is not changes[1]


def test_a_disagreement_is_told(monkeypatch):
    monkeypatch.setattr(coverage, "checks_by_requirement", lambda _: {"http/no-such": ("test_x::test_y",)})
    told = coverage.disagreements(CONTRACT)
    assert "test_x::test_y judges 'http/no-such', which the ledger does not have" in told
    assert "http/date has no check" in told


LAMP = Contract.load(ROOT / "examples" / "lamp")


def test_a_folder_packs_checks_are_found_by_file():
    assert coverage.checks_by_requirement(LAMP)["lamp/fades"] == ("test_lamp::fades",)
    assert coverage.disagreements(LAMP) == []
    page = coverage.page(LAMP)
    assert "| `lamp/fades` |" in page.partition("## Does it do what it says?")[2]
    assert "mutants by rule" in page


def test_a_pack_needs_no_mutants(monkeypatch):
    monkeypatch.setattr(coverage, "self_test_of", lambda _: SelfTest())
    assert coverage.disagreements(LAMP) == []


def test_a_pack_that_has_mutants_has_one_for_each_of_its_own_requirements(monkeypatch):
    mutant = Mutant("dark", "The lamp stays dark.", ("lamp/target",), "rest", lambda: unchanged)
    monkeypatch.setattr(coverage, "self_test_of", lambda _: SelfTest(mutants=(mutant,)))
    assert coverage.disagreements(LAMP) == [
        f"lamp/{name} is MUST, and no mutant shows that it is judged"
        for name in ("state", "fades", "in-between", "out-of-range")
    ]


def test_a_module_with_checks_that_cannot_be_imported_is_named(tmp_path):
    shutil.copytree(LAMP.directory, tmp_path / "lamp", ignore=shutil.ignore_patterns("__pycache__"))
    broken = tmp_path / "lamp" / "rules" / "lamp" / "test_broken.py"
    broken.write_text("import no_such_module\n", encoding="utf-8")
    with pytest.raises(ContractError, match=r"test_broken\.py cannot be imported"):
        coverage.checks_by_requirement(Contract.load(tmp_path / "lamp"))


_WORDS = {"things": vars(changes) | {"GOAL": "/goal/", "fields": fields}}
_REQUEST = Request("rest", "GET", "/goal/")


def _mutants(folder, row):
    path = folder / "rows.toml"
    path.write_text(f"[things.rest.http]\n{row}\n", encoding="utf-8")
    return list(read_rows(path, _WORDS))


@pytest.mark.parametrize(
    ("change", "body"),
    [
        ("altered(rest('GET', GOAL), becomes(404))", b'{"x": 1}'),
        ("altered(rest(), values(fields.field('x', -2.5)), nth=1)", b'{"x": -2.5}'),
        ("instead(rest('PUT GET', GOAL), plain(404, b'gone', JSON, ('Allow', 'GET')))", b"gone"),
        ("always(unwanted)", None),
    ],
)
def test_a_row_names_where_which_operator_and_when(tmp_path, change, body):
    (mutant,) = _mutants(tmp_path, f'broken = ["date", "It is broken.", "{change}", {{ probe = true }}]')
    assert (mutant.name, mutant.catches, mutant.interface, mutant.probe) == ("broken", ("http/date",), "rest", True)
    if body is not None:
        sent = mutant.make()(_REQUEST, lambda _: Response(200, [("Content-Type", "application/json")], b'{"x": 1}'))
        assert sent.body == body


@pytest.mark.parametrize(
    ("change", "error"),
    [
        ("altered(nowhere(), becomes(404))", KeyError),
        ("instead(lambda request: True, plain(204))", ValueError),
        ("(1).__class__", ValueError),
        ("GOAL.__class__", ValueError),
        ("altered(", SyntaxError),
    ],
)
def test_a_row_has_words_and_values_alone(tmp_path, change, error):
    with pytest.raises(error):
        _mutants(tmp_path, f'broken = ["date", "It is broken.", "{change}"]')
