"""Requirements cite sections of the contract and clauses of norms that exist, and ask for no more than those do."""

import re
import tomllib
from pathlib import Path

import pytest

from conformance.contract.classes import Level, Origin
from conformance.contract.generic import generic_ledger
from conformance.contract.pack import Contract, anchor_of, cited_in, sections_of
from conformance.packs.table1.limits import DeclaredLimits
from conformance.papers_robot.statement import CONTRACT_DIR

TEXT = (CONTRACT_DIR / "contract.md").read_text(encoding="utf-8")
SECTIONS = sections_of(TEXT)
LEDGER = Contract.load().ledger
# With the generic requirements that the paper's pack leaves out.
NORMS = LEDGER | {id_: item for id_, item in generic_ledger().items() if item.class_ == "web-server"}
# What binds no robot by itself: what a vendor says, and how is judged.
_ABOUT_JUDGING = {"classes", "levels-and-origins", "statement", "judging-by-windows", "what-changed"}
# What every web API has to keep: requirements of the generic suite, which cite the norms themselves.
_OF_NORMS = {"json"}


@pytest.mark.parametrize(
    ("title", "anchor"), [("Goals", "goals"), ("ROS side", "ros-side"), ("What? `a/b`, and_c", "what-ab-and_c")]
)
def test_an_anchor_is_githubs(title, anchor):
    assert anchor_of(title) == anchor


def test_no_two_sections_have_one_anchor():
    assert len(SECTIONS) == len(re.findall(r"^#+ ", TEXT, re.MULTILINE))


def test_every_section_that_is_cited_exists():
    for item in LEDGER.values():
        missing = cited_in([item.source]) - set(SECTIONS)
        assert not missing, (item.id, missing)
        named = re.findall(r"[\w-]+\.(?:yaml|xsd|wsdl|wadl|md)", item.source)
        assert all((CONTRACT_DIR / name).is_file() for name in named), item.id
        assert "contract," not in item.source, (item.id, "cites no section")
        assert item.source.count("contract.md") == len(cited_in([item.source])), item.id
    inside = set(re.findall(r"\]\(#([\w-]+)\)", TEXT))
    assert inside <= set(SECTIONS)


def test_every_section_is_cited():
    filled = {anchor for anchor, section in SECTIONS.items() if section.text} - {next(iter(SECTIONS))}
    assert filled - cited_in(item.source for item in LEDGER.values()) == _ABOUT_JUDGING | _OF_NORMS


def test_the_text_agrees_with_what_judges():
    assert f"Version {Contract.load().version}." in TEXT
    assert Contract.load().openapi["info"]["version"] == Contract.load().version
    assert all(f"| `{name}` |" in SECTIONS["classes"].text for name in Contract.load().classes)
    silent = DeclaredLimits().resolve()
    assert "limits of 0.7 m/s and 2.5 rad/s" in SECTIONS["statement"].text.replace("\n", " ")
    assert (silent.linear_m_s, silent.angular_rad_s, silent.settle_s) == (0.7 / 2, 2.5 / 2, 2.0)


def test_a_result_carries_the_sections_that_its_requirements_cite(tmp_path):
    assert set(Contract.load().cited_sections) == cited_in(item.source for item in LEDGER.values())
    (tmp_path / "openapi.yaml").write_text("paths: {}", encoding="utf-8")
    assert Contract.load(tmp_path).cited_sections == {}


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
    known = {**CLAUSES["rfc"], **CLAUSES["soap"]}
    assert clause in known, f"add {clause} to tests/conformance/data/clauses.toml, with its own word"
    return Level(known[clause])


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
    "item", [item for item in NORMS.values() if item.origin is Origin.NORM], ids=lambda item: item.id
)
def test_no_level_is_above_the_clause_that_it_quotes(item):
    words = [word_of(clause) for clause in clauses_of(item.source)]
    assert _STRENGTH.index(item.level) <= max(map(_STRENGTH.index, words))


def test_what_the_contract_marks_as_weaker_is():
    of_contract = [item for item in LEDGER.values() if item.origin is Origin.CONTRACT]
    for level in (Level.SHOULD, Level.MAY):
        assert {item.id for item in of_contract if item.level is level} == set(CLAUSES["contract"][level])


def test_the_table_has_no_clause_that_nobody_quotes():
    quoted = {clause for item in NORMS.values() for clause in clauses_of(item.source)}
    assert set(CLAUSES["rfc"]) | set(CLAUSES["soap"]) <= quoted
    rules = {clause.removeprefix("BP ") for clause in quoted if clause.startswith("BP ")}
    assert {rule for rules_ in CLAUSES["basic-profile"].values() for rule in rules_} <= rules
