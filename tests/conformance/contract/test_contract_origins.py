"""Every requirement says where it comes from, and asks for no more than that does."""

import re
import tomllib
from pathlib import Path

import pytest

from conformance.contract.classes import Level, Origin
from conformance.contract.pack import Contract
from conformance.contract.sections import cited_in, sections_of
from conformance.packs.table1.files import CONTRACT_DIR

LEDGER = Contract.load().ledger
CLAUSES = tomllib.loads((Path(__file__).parents[1] / "data" / "clauses.toml").read_text(encoding="utf-8"))
ANCHORS = set(sections_of((CONTRACT_DIR / "contract.md").read_text(encoding="utf-8")))
_STRENGTH = [Level.MAY, Level.SHOULD, Level.MUST]


def clauses_of(source: str) -> list[str]:
    """The clauses of norms that a source quotes, each with its norm: ``RFC 9112 2, 6.3`` is two."""
    found = []
    for part in source.split("; "):
        norm = re.match(r"RFC \d+|SOAP 1\.1|BP|XML 1\.0|Namespaces in XML", part)
        if norm:
            numbers = part[norm.end() :].strip()
            found += [f"{norm[0]} {number}".strip() for number in numbers.split(", ")]
    return found


def word_of(clause: str) -> Level:
    """The clause's own word."""
    norm, _, number = clause.partition(" ")
    if norm == "BP":
        return next(Level(word) for word, rules in CLAUSES["basic-profile"].items() if number in rules)
    return Level({**CLAUSES["rfc"], **CLAUSES["soap"]}[clause])


@pytest.mark.parametrize("item", LEDGER.values(), ids=lambda item: item.id)
def test_a_source_is_of_the_kind_that_its_origin_says(item):
    first = item.source.split("; ")[0]
    if item.origin is Origin.NORM:
        assert clauses_of(first), "quotes no clause of a norm first"
    elif item.origin is Origin.DESCRIPTION:
        assert first in {"the OpenAPI description", "the WSDL"} or (CONTRACT_DIR / first).is_file()
    elif item.origin is Origin.WEAKNESS:
        assert re.match(r"CWE-\d+|WS-Attacks, |BP R\d+", first), "names no weakness"
    else:
        assert cited_in([first]) <= ANCHORS
        assert cited_in([first]), "cites no section of the contract first"


@pytest.mark.parametrize(
    "item", [item for item in LEDGER.values() if item.origin is Origin.NORM], ids=lambda item: item.id
)
def test_no_level_is_above_the_clause_that_it_quotes(item):
    words = [word_of(clause) for clause in clauses_of(item.source)]
    assert _STRENGTH.index(item.level) <= max(map(_STRENGTH.index, words))


def test_what_the_contract_marks_as_weaker_is():
    of_contract = [item for item in LEDGER.values() if item.origin is Origin.CONTRACT]
    for level in (Level.SHOULD, Level.MAY):
        assert {item.id for item in of_contract if item.level is level} == set(CLAUSES["contract"][level])


def test_the_table_has_no_clause_that_nobody_quotes():
    quoted = {clause for item in LEDGER.values() for clause in clauses_of(item.source)}
    assert set(CLAUSES["rfc"]) | set(CLAUSES["soap"]) <= quoted
    rules = {clause.removeprefix("BP ") for clause in quoted if clause.startswith("BP ")}
    assert {rule for rules_ in CLAUSES["basic-profile"].values() for rule in rules_} <= rules
