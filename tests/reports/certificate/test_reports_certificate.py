"""The certificate as page and as Markdown, with what it shows of traces."""

import gzip
import json

import pytest
from lxml import html

from reports.certificate.moves_drawn import grid, pictures
from reports.certificate.page import SHOWN_BODY, certificate, certificate_html, certificate_markdown


def page(result):
    return html.document_fromstring(certificate_html(result))


def text(element):
    return " ".join(element.text_content().split())


def section(page, id_):
    return page.get_element_by_id(id_).xpath("ancestor::section[1]")[0]


def words(message):
    """Return a message as the page shows it, with code in a typeface of its own and not between backticks."""
    return " ".join(message.replace("`", "").split()).rstrip(".")


def failures(result):
    return [failure for requirement in result["requirements"] for failure in requirement["failures"]]


def one(result, verdict):
    return next(r for r in result["requirements"] if r["verdict"] == verdict)


def test_everything_is_in_it(result):
    shown = text(page(result))
    for wanted in (
        "Courier 7",
        "Example Robotics, version 2.4.1",
        "✗ Not conformant",
        f"{list(result['classes'].values()).count('fail')} of 7 claimed classes failed",
        "RoAAS 0.1.0",
        f"{result['pack']['title']} {result['pack']['version']} (pack table1)",
        "2026-11-20, 22:13 UTC",
        f"{result['requests']:,} requests",
        result["suite"]["digest"],
        result["command"],
        result["environment"]["python"],
        "linear_m_s",
        "0.7",
    ):
        assert wanted in shown, wanted
    for requirement in result["requirements"]:
        assert " ".join(requirement["text"].split()) in shown
        assert requirement["id"] in shown
    for failure in failures(result):
        assert words(failure["message"]) in shown


def test_findings_come_in_their_order_under_their_causes(result):
    document = page(result)
    failed = section(document, "found-fail")
    numbers = [int(found.get("id").removeprefix("finding-")) for found in failed.find_class("finding")]
    assert numbers == sorted(
        f["number"] for r in result["requirements"] if r["verdict"] == "fail" for f in r["failures"]
    )
    headings = [text(heading) for heading in failed.find_class("cause")]
    assert headings[0].startswith("No response")
    assert headings[-1].startswith("Rule not met")
    assert len(headings) == len({failure["cause"] for failure in failures(result)})


def test_what_a_finding_blocks_is_told_with_it_and_links_back(result):
    document = page(result)
    untested = section(document, "untested")
    blocking = [cause for cause in result["causes"] if cause["blocks"]]
    assert len(blocking) > 1
    for cause in blocking:
        finding = text(document.get_element_by_id(f"finding-{cause['number']}"))
        number = len(cause["blocks"])
        assert f"{number} requirement{'s were' if number > 1 else ' was'} not tested" in finding
        for id_ in cause["blocks"]:
            assert id_ in finding
        assert untested.xpath(f".//a[@href='#finding-{cause['number']}']")
    for link in document.xpath("//a[starts-with(@href, '#')]/@href"):
        assert document.get_element_by_id(link[1:], None) is not None, f"{link} leads nowhere"


@pytest.mark.parametrize("render", [certificate_html, certificate_markdown])
def test_a_result_from_before_1_2_shows_what_was_done_expected_and_seen(older, render):
    shown = render(older)
    shown = text(html.document_fromstring(shown)) if render is certificate_html else shown.replace("\\", "")
    shown = shown.replace("`", "")
    failure = one(older, "fail")["failures"][0]
    for wanted in (failure["message"].rstrip("."), failure["expected"], f"Sent {failure['request']['method']}"):
        assert wanted in shown


def test_it_begins_with_the_verdict_and_what_to_do_first(result):
    failed = [r for r in result["requirements"] if r["verdict"] == "fail"]
    for requirement in failed:
        requirement["fix"] = f"Repair {requirement['id']}."
    document = page(result)
    heads = [head.get("id") for head in document.xpath("//h1 | //h2 | //*[@id='verdict']")]
    assert heads[:4] == [None, "verdict", "first", "classes"]
    steps = document.xpath("//ol[@class='first']/li")
    assert len(steps) == min(3, len(failed))
    for step in steps:
        link = step.xpath(".//a/@href")[0]
        finding = document.get_element_by_id(link[1:])
        assert finding.tag == "details"
        assert "How to fix it: Repair" in text(step)
        assert "Got" in text(step)
    shown = [head for head in document.xpath("//h2") if not head.xpath("ancestor::details")]
    assert [head.get("id") for head in shown] == ["first", "classes"]


def test_the_numbers_of_a_class_add_up(result):
    table = page(result).xpath("//table")[0]
    heads = [text(head) for head in table.xpath(".//thead//th")][2:]
    for row in table.xpath(".//tbody/tr"):
        *parts, whole = (int(cell.text_content()) for cell in row.xpath("./td")[1:])
        assert sum(parts) == whole > 0
    assert heads[-1] == "Requirements"


def test_curl_is_copied_as_it_is(result):
    commands = {pre.text_content() for pre in page(result).iter("pre") if pre.get("data-copy") == "Copy"}
    assert {failure["request"]["curl"] for failure in failures(result)} <= commands


def test_untested_is_told_with_its_reason(result):
    groups = certificate(result).untested
    assert sum(len(group.requirements) for group in groups) == [r["verdict"] for r in result["requirements"]].count(
        "skip"
    )
    shown = text(section(page(result), "untested"))
    for group in groups:
        assert group.reason[1:] in shown


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
    assert "✓ Conformant Each of the 4 claimed classes passed." in shown


def test_it_promises_no_more_than_it_can(result):
    for document in (result, conformant(result)):
        shown = text(page(document))
        for said in ("It is no proof.", "suite version 0.1.0", "no assessment of functional safety"):
            assert said in shown


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
    for said in ("<script>alert(1)</script>", "{{7*7}}", "\\u202e"):
        assert said in shown
    assert not set(shown) & set("\x00\x1b\x7f\u202e\u2066\u200b\ufeff\ufffe")
    certificate_html(hostile).encode("utf-8")


def test_long_body_is_cut_and_its_length_told(result):
    failure = failures(result)[0]
    failure["response"]["body"] = "x" * 1_000_000
    failure["request"].update(body="y" * 5000, body_length=7_000_000, curl="curl " + "z" * 500_000)
    source = certificate_html(result)
    assert len(source) < 200_000
    shown = text(html.document_fromstring(source))
    assert f"… {1_000_000 - SHOWN_BODY:,} of 1,000,000 characters are not shown" in shown
    assert "of 7,000,000 bytes are not shown" in shown
    assert "The command is 500,005 characters long" in shown


def test_many_findings_are_counted(result):
    requirement = one(result, "fail")
    requirement["failures"] = requirement["failures"] * 500
    source = certificate_html(result)
    assert "495 more findings" in source
    assert len(source) < 300_000


def test_a_finding_that_blocks_others_is_shown_among_many(result):
    requirement = one(result, "fail")
    first = requirement["failures"][0]
    requirement["failures"] = [{**first, "number": number} for number in range(100, 110)]
    result["causes"] = [{"number": 109, "kind": "rule", "requirement": "x", "text": "t", "blocks": ["http/x"]}]
    assert page(result).get_element_by_id("finding-109", None) is not None
    assert "4 more findings are" in certificate_html(result)


def test_nothing_was_executed(result):
    result.update(
        verdict="inconclusive", requirements=[], classes={}, class_reasons={}, notes=[], requests=0, finished=None
    )
    result["statement"] = {"robot": {}, "claims": [], "motion_allowed": False}
    result["target"] = {"rest": None}
    shown = text(page(result))
    for said in ("? Inconclusive No case was executed", "Unnamed robot", "Nothing was tested"):
        assert said in shown
    assert "Inconclusive" in certificate_markdown(result)


def test_interrupted_run(result):
    result.update(interrupted=True, finished=None)
    result["requirements"] = result["requirements"][:4]
    assert "The run was interrupted" in text(page(result))
    assert "The run was interrupted" in certificate_markdown(result)


@pytest.mark.parametrize("kind", ["result", "older"])
def test_failure_without_request_or_response(request, kind):
    result = request.getfixturevalue(kind)
    failure = one(result, "fail")["failures"][0]
    failure.update(request=None, response=None)
    assert "No single request shows this failure." in text(page(result))
    assert words(failure["message"]) in text(page(result))
    certificate_markdown(result)


def test_expected_failure_is_marked(result):
    requirement = one(result, "fail")
    requirement.update(verdict="warn", expected_failure={"reason": "known since 2.3", "expires": "2027-01-01"})
    assert "accepted by the baseline: known since 2.3 (until 2027-01-01)" in text(page(result))


def test_page_loads_nothing(result):
    document = page(result)
    policy = document.xpath("//meta[@http-equiv='Content-Security-Policy']/@content")[0]
    assert policy.startswith("default-src 'none'")
    assert not document.xpath("//link | //iframe | //object | //embed | //base | //form")
    assert all(str(link).startswith("#") for link in document.xpath("//@href | //@src"))
    assert "@import" not in certificate_html(result)
    assert "url(" not in certificate_html(result)


def test_long_list_of_untested_requirements_is_folded(result):
    skipped = one(result, "skip")
    result["requirements"] += [{**skipped, "id": f"rest-resources/more-{number}"} for number in range(31)]
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


@pytest.mark.parametrize(("number", "shown"), [(1, "1 warning "), (2, "2 warnings ")])
def test_warnings_are_counted_in_their_number(result, number, shown):
    for requirement in result["requirements"]:
        requirement["verdict"] = "pass"
    for requirement in result["requirements"][:number]:
        requirement["verdict"] = "warn"
    tally = text(page(result).find_class("tally")[0])
    assert shown in f"{tally} "
    assert f"{len(result['requirements']) - number} passed" in tally


def test_by_which_requests_a_requirement_was_judged(result):
    result["requirements"][0]["occasions"] = {"GET JSON": 1234, "SOAP": 5, "after a refusal": 6}
    assert "By GET JSON: 1,234, SOAP: 5, after a refusal: 6" in text(page(result)).replace("\u202f", ",")


_WALK = {
    "states": ["ready", "run", "running"],
    "operations": {"POST /a": ["ready"], "POST /b": ["running"]},
    "steps": [
        {"operation": "POST /a", "state": "ready", "taken": True},
        {"operation": "POST /a", "state": "run", "taken": True},
        {"operation": "POST /a", "state": "running", "taken": False},
        {"operation": "POST /b", "state": "ready", "taken": False},
    ],
}
_FAILED = {
    "requirements": [{"class": "states", "failures": [{"message": "Expected 4xx for POST /a in run. Got status 200."}]}]
}


def _written(folder, traces):
    (folder / "traces.json.gz").write_bytes(gzip.compress(json.dumps(traces).encode()))
    return grid(folder, _FAILED)


def test_each_operation_has_each_state(tmp_path):
    shown = _written(tmp_path, {"walked": _WALK})
    assert {name: [cell.sign for cell in cells] for name, cells in shown.rows.items()} == {
        "POST /a": ["✓ taken", "✗ taken", "✓ refused"],
        "POST /b": ["✓ refused", "·", "·"],
    }
    assert shown.wrong == 1


@pytest.mark.parametrize(
    "walk", [[], {}, {**_WALK, "steps": [3]}, {**_WALK, "operations": 7}, {**_WALK, "states": None}]
)
def test_what_is_no_walk_gives_no_grid(tmp_path, walk):
    assert _written(tmp_path, {"walked": walk}) is None


RESULT = {"requirements": [{"class": "motion", "failures": [{"message": "Expected (turn 0.2)."}]}]}


def reading(at, **told):
    return {"sent": at, "received": at + 0.01, **told}


def drive(what, wanted, readings):
    sent = {"sent": 0.0, "targets": wanted, "exchange": {"response": {"status": 200}}}
    return {"what": what, "wanted": wanted, "commands": [sent], "under_way": readings, "after": []}


def drawn(tmp_path, *drives):
    (tmp_path / "traces.json.gz").write_bytes(gzip.compress(json.dumps({"velocities": list(drives)}).encode()))
    return pictures(tmp_path, RESULT)


def test_a_velocity_that_an_axis_tells_is_drawn_by_that_axis(tmp_path):
    told = [reading(at / 10, values={"yaw": at / 50}, speeds={"ahead": 0.0}) for at in range(10)]
    (picture,) = drawn(tmp_path, drive("turn 0.2", {"ahead": 0.0, "turn": 0.2}, told))
    assert [line.name for line in picture.lines] == ["yaw", "ahead"]
    assert picture.lines[0].wanted == (), "a velocity is no position"
    assert picture.failed


def test_a_velocity_that_is_told_is_drawn_with_what_was_commanded(tmp_path):
    told = [reading(at / 10, values={"x": at / 50}, speeds={"ahead": 0.2}) for at in range(10)]
    (picture,) = drawn(tmp_path, drive("ahead 0.2", {"ahead": 0.2}, told))
    assert [line.name for line in picture.lines] == ["ahead"]
    assert len(picture.lines[0].wanted) == 1
