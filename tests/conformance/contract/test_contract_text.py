"""Requirements cite sections of the contract's text that exist, and no section of it is left out."""

import re

import pytest

from conformance.contract.pack import Contract
from conformance.contract.sections import anchor_of, cited_in, sections_of
from conformance.packs.table1.files import CONTRACT_DIR
from conformance.packs.table1.limits import DeclaredLimits

TEXT = (CONTRACT_DIR / "contract.md").read_text(encoding="utf-8")
SECTIONS = sections_of(TEXT)
LEDGER = Contract.load().ledger
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
    silent = DeclaredLimits().resolved()
    assert "limits of 0.7 m/s and 2.5 rad/s" in SECTIONS["statement"].text.replace("\n", " ")
    assert (silent.linear_m_s, silent.angular_rad_s, silent.settle_s) == (0.7 / 2, 2.5 / 2, 2.0)


def test_a_result_carries_the_sections_that_its_requirements_cite(tmp_path):
    assert set(Contract.load().cited_sections) == cited_in(item.source for item in LEDGER.values())
    (tmp_path / "openapi.yaml").write_text("paths: {}", encoding="utf-8")
    assert Contract.load(tmp_path).cited_sections == {}
