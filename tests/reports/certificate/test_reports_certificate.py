"""The certificate as page and as Markdown."""

import re

import pytest
from lxml import html

from reports.certificate.markdown import certificate_markdown
from reports.certificate.page import SHOWN_BODY, certificate, certificate_html


def page(result):
    return html.document_fromstring(certificate_html(result))


def text(element):
    return " ".join(element.text_content().split())


def test_everything_is_in_it(result):
    shown = text(page(result))
    for wanted in (
        "Courier 7",
        "Example Robotics, version 2.4.1",
        "✗ Not conformant",
        "2 of 7 claimed classes failed",
        "RoAAS 0.1.0",
        "2026-11-20, 22:13 UTC",
        "3,184 requests",
        result["suite"]["digest"],
        result["command"],
        "3.11.7",
        "linear_m_s",
        "0.7",
        "Without --allow-motion nothing was sent",
    ):
        assert wanted in shown, wanted
    for requirement in result["requirements"]:
        assert requirement["text"] in shown
        assert requirement["id"] in shown
        assert requirement["source"] in shown
        for failure in requirement["failures"]:
            assert failure["message"] in shown
            assert failure["expected"] in shown


def test_curl_is_copied_as_it_is(result):
    commands = {pre.text_content() for pre in page(result).iter("pre") if pre.get("data-copy") == "Copy"}
    failures = [failure for requirement in result["requirements"] for failure in requirement["failures"]]
    assert failures
    for failure in failures:
        assert failure["request"]["curl"] in commands


def test_untested_is_told_with_its_reason(result):
    groups = certificate(result).untested
    assert [len(group.requirements) for group in groups] == [2, 1, 1]
    shown = text(page(result).get_element_by_id("untested").getparent())
    for group in groups:
        assert group.reason in shown


def test_worst_comes_first(result):
    order = [c.verdict for c in certificate(result).classes]
    assert order == sorted(order, key=["fail", "inconclusive", "pass", "not-claimed"].index)


def conformant(result):
    result["verdict"] = "conformant"
    result["requirements"] = [r for r in result["requirements"] if r["verdict"] == "pass"]
    result["classes"] = {name: "pass" if v == "pass" else "not-claimed" for name, v in result["classes"].items()}
    return result


def test_only_a_conformant_robot_gets_a_certificate(result):
    assert "Certificate of conformance" not in text(page(result))
    shown = text(page(conformant(result)))
    assert "RoAAS Certificate of conformance" in shown
    assert "✓ Conformant Each of the 3 claimed classes passed." in shown


def test_it_promises_no_more_than_it_can(result):
    for document in (result, conformant(result)):
        shown = text(page(document))
        assert "It is no proof." in shown
        assert "suite version 0.1.0" in shown
        assert "no assessment of functional safety" in shown


@pytest.mark.parametrize("render", [certificate_html, certificate_markdown])
def test_what_the_statement_declares_is_shown(result, render):
    declared = {"settle_s": 0.6, "tolerance_angular_rad_s": 0.2}
    shown = render({**result, "statement": {**result["statement"], "declared": declared}})
    assert "settle_s = 0.6, tolerance_angular_rad_s = 0.2" in shown.replace("\\_", "_")


@pytest.mark.parametrize("render", [certificate_html, certificate_markdown])
def test_same_result_same_octets(result, render):
    assert render(result) == render(result)


def test_hostile_text_stays_text(hostile):
    document = page(hostile)
    assert len(document.findall(".//script")) == 1
    assert not document.findall(".//img")
    assert not [name for element in document.iter() for name in element.attrib if name.startswith("on")]
    shown = document.text_content()
    assert "<script>alert(1)</script>" in shown
    assert "{{7*7}}" in shown
    assert "\\u202e" in shown
    assert not set(shown) & set("\x00\x1b\x7f\u202e\u2066\u200b\ufeff\ufffe")
    certificate_html(hostile).encode("utf-8")


def test_hostile_text_stays_text_in_markdown(hostile):
    source = certificate_markdown(hostile)
    source.encode("utf-8")
    # What is left outside of code spans and blocks holds no tag but our own, and no mention.
    outside = re.sub(r"(?ms)^(`{3,})\n.*?\n\1$", "", source)
    outside = re.sub(r"(`+)(?!`).*?(?<!`)\1(?!`)", "", outside)
    tags = set(re.findall(r"(?<!\\)<(/?\w+)", outside))
    assert tags <= {"details", "/details", "summary", "/summary", "code", "/code"}
    assert "@octocat" not in outside


def test_long_body_is_cut_and_its_length_told(result):
    failure = next(r for r in result["requirements"] if r["verdict"] == "fail")["failures"][0]
    failure["response"]["body"] = "x" * 1_000_000
    failure["request"].update(body="y" * 5000, body_length=7_000_000, curl="curl " + "z" * 500_000)
    source = certificate_html(result)
    assert len(source) < 200_000
    shown = text(html.document_fromstring(source))
    assert f"… {1_000_000 - SHOWN_BODY:,} of 1,000,000 characters are not shown" in shown
    assert "of 7,000,000 octets are not shown" in shown
    assert "The command is 500,005 characters long" in shown


def test_many_findings_are_counted(result):
    requirement = next(r for r in result["requirements"] if r["verdict"] == "fail")
    requirement["failures"] = requirement["failures"] * 500
    source = certificate_html(result)
    assert "495 more findings" in source
    assert len(source) < 300_000


def test_nothing_was_executed(result):
    result.update(
        verdict="inconclusive", requirements=[], classes={}, class_reasons={}, notes=[], requests=0, finished=None
    )
    result["statement"] = {"robot": {}, "claims": [], "motion_allowed": False}
    result["target"] = {"rest": None}
    shown = text(page(result))
    assert "? Inconclusive No case was executed" in shown
    assert "Unnamed robot" in shown
    assert "Nothing was tested" in shown
    assert "Inconclusive" in certificate_markdown(result)


def test_interrupted_run(result):
    result.update(interrupted=True, finished=None)
    result["requirements"] = result["requirements"][:4]
    assert "The run was interrupted" in text(page(result))
    assert "The run was interrupted" in certificate_markdown(result)


def test_failure_without_request_or_response(result):
    failure = next(r for r in result["requirements"] if r["verdict"] == "fail")["failures"][0]
    failure.update(request=None, response=None)
    assert "No single request shows it." in text(page(result))
    assert failure["message"] in text(page(result))
    certificate_markdown(result)


def test_expected_failure_is_marked(result):
    requirement = next(r for r in result["requirements"] if r["verdict"] == "fail")
    requirement.update(verdict="warn", expected_failure={"reason": "known since 2.3", "expires": "2027-01-01"})
    assert "expected by the baseline: known since 2.3 (until 2027-01-01)" in text(page(result))


def test_page_loads_nothing(result):
    document = page(result)
    policy = document.xpath("//meta[@http-equiv='Content-Security-Policy']/@content")[0]
    assert policy.startswith("default-src 'none'")
    assert not document.xpath("//link | //iframe | //object | //embed | //base | //form")
    assert all(str(link).startswith("#") for link in document.xpath("//@href | //@src"))
    assert "@import" not in certificate_html(result)
    assert "url(" not in certificate_html(result)


def test_long_list_of_untested_requirements_is_folded(result):
    skipped = next(r for r in result["requirements"] if r["verdict"] == "skip")
    result["requirements"] += [{**skipped, "id": f"rest-resources/more-{number}"} for number in range(30)]
    assert "32 requirements" in text(page(result))
    assert "and 20 more" in certificate_markdown(result)


def test_a_source_links_to_the_section_that_it_cites(result):
    for requirement in result["requirements"]:
        requirement["source"] = "paper, Table 1; contract.md#goals; contract.md#nowhere"
    result["contract_sections"] = {"goals": {"title": "Goals", "text": "- PUT: `goal` is\n  <required>."}}
    shown = page(result)
    links = [link for link in shown.iter("a") if link.get("href") == "#contract-goals"]
    assert len(links) >= len(result["requirements"])
    assert {text(link) for link in links} == {"contract, Goals"}
    heading = shown.get_element_by_id("contract-goals")
    assert heading.getnext().text_content() == "- PUT: `goal` is\n  <required>."
    assert "contract.md#nowhere" in text(shown)
    assert not [link for link in shown.iter("a") if link.get("href") == "#contract-nowhere"]
