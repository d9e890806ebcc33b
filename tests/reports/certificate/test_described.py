"""The page of a device that is judged by its own description."""

import json
import re

import pytest
from lxml import html

from reports.certificate.described import description_of
from reports.certificate.page import Seal, certificate_html, certificate_markdown, certificate_print
from reports.formats.catalogue import badge


def shown(page):
    return " ".join(html.document_fromstring(page).text_content().split())


def every_form(result):
    seal = Seal("0" * 64, "1" * 64)
    pages = [shown(certificate_html(result)), shown(certificate_print(result, seal))]
    return [*pages, certificate_markdown(result), badge(result)]


@pytest.mark.parametrize(
    ("verdict", "words"),
    [("conformant", "keeps its own description"), ("not-conformant", "does not keep its own description")],
)
def test_every_form_says_whether_it_keeps_its_description_and_none_speaks_of_conformance(
    described_result, verdict, words
):
    described_result["verdict"] = verdict
    for form in every_form(described_result):
        assert words in form.lower()
        assert not re.search(r"certificate of conformance|conformance report|\bconformant\b|conforms to", form.lower())
        assert ("does not keep" in form.lower()) == (verdict == "not-conformant")


def test_the_page_says_how_much_was_called(described_result):
    called, whole = described_result["api"]["coverage"]["operations"]
    page = shown(certificate_html(described_result))
    assert f"{called} of {whole} operations were called. This report says nothing of the others." in page
    for reached, all_ in described_result["api"]["coverage"].values():
        assert f"{reached} of {all_}" in page


def test_each_operation_is_told_once(described_result):
    page = html.document_fromstring(certificate_html(described_result))
    table = [
        " ".join(row.text_content().split())
        for row in page.xpath("//table[contains(@class, 'operations')]//th[@scope='row']")
    ]
    uncalled = [item.text_content() for item in page.xpath("//ul[@class='labels']/li/code")]
    assert sorted(table + uncalled) == sorted(one["operation"] for one in described_result["api"]["operations"])
    assert set(uncalled) == {one["operation"] for one in described_result["api"]["operations"] if not one["called"]}


def test_findings_come_first_and_each_link_leads_somewhere(described_result):
    page = html.document_fromstring(certificate_html(described_result))
    first = page.xpath("//table[contains(@class, 'operations')]")[0]
    assert all(row.xpath(".//a") for row in first.xpath(".//tbody/tr"))
    numbers = {n for one in described_result["api"]["operations"] for n in one["findings"]}
    section = page.xpath("//section[@aria-labelledby='operations' or @aria-labelledby='uncalled']//a/@href")
    assert {link.removeprefix("#finding-") for link in section} == {str(n) for n in numbers}
    for link in page.xpath("//a[starts-with(@href, '#')]/@href"):
        assert page.get_element_by_id(link[1:], None) is not None, f"{link} leads nowhere"


def test_an_operation_with_a_finding_of_the_web_server_is_not_without_one(described_result):
    clean = next(one for one in described_result["api"]["operations"] if one["called"] and not one["findings"])
    failed = next(r for r in described_result["requirements"] if r["failures"])
    failure = {**failed["failures"][0], "number": 77, "subject": f"{clean['operation']}?a=b"}
    described_result["web_server"] = {"text": "x", "requirements": [{**failed, "failures": [failure]}]}
    page = html.document_fromstring(certificate_html(described_result))
    row = page.xpath(f"//tr[.//th[normalize-space() = '{clean['operation']}']]")[0]
    assert row.xpath(".//a/@href") == ["#finding-77"]


def test_a_requirement_with_many_findings_shows_all_that_the_matrix_links_to(described_result):
    failed = next(r for r in described_result["requirements"] if r["id"] == "robustness/no-server-error")
    example = failed["failures"][0]
    failed["failures"] += [{**example, "number": number} for number in range(100, 112)]
    described_result["api"]["operations"][0]["findings"] = list(range(100, 112))
    page = html.document_fromstring(certificate_html(described_result))
    assert all(page.get_element_by_id(f"finding-{number}", None) is not None for number in range(100, 112))


@pytest.mark.parametrize(
    ("declared", "seen", "expected"),
    [
        (["200"], {"200": 3}, [("200", 3, True)]),
        (["200"], {"503": 3}, [("503", 3, False), ("200", 0, True)]),
        (["2XX", "default"], {"204": 1, "418": 1}, [("204", 1, True), ("418", 1, True)]),
        (["4xx"], {"404": 1}, [("404", 1, True)]),
        ([], {}, []),
    ],
)
def test_a_status_is_declared_by_itself_its_class_or_default(described_result, declared, seen, expected):
    entry = described_result["api"]["operations"][0] | {"called": True, "declared": declared, "statuses": seen}
    entry["seen_declared"] = [key for key in declared if seen and expected[-1][1]]
    row = description_of({"api": {**described_result["api"], "operations": [entry]}}).rows[0]
    assert [(one.code, one.count, one.declared) for one in row.statuses] == expected


def test_a_device_without_a_single_called_operation_has_a_page(described_result):
    described_result["api"]["operations"] = [
        one | {"called": False, "findings": []} for one in described_result["api"]["operations"]
    ]
    described_result["api"]["coverage"] = {"operations": [0, 3], "parameters": [0, 0], "statuses": [0, 5]}
    page = shown(certificate_html(described_result))
    assert "0 of 3 operations were called" in page
    assert "Parameters sent" not in page


def test_the_badge_has_the_words(described_result):
    assert json.loads(badge(described_result))["message"].startswith("does not keep its own description (")


def test_what_a_user_asks_of_a_moving_device_comes_first(described_result):
    described_result["motion"] = [
        {"question": "Does it stop when told?", "answer": answer, "figure": "0.3 s", "picture": ""}
        for answer in ("yes", "no", "not seen")
    ]
    page = html.document_fromstring(certificate_html(described_result))
    assert [head.get("id") for head in page.xpath("//h2")][:2] == ["answers", "first"]
    shown = [" ".join(one.text_content().split()) for one in page.xpath("//ul[@class='answers']/li")]
    assert [one.split(" Does")[0][2:] for one in shown] == ["Yes", "No", "Not seen"]
