"""junit.xml."""

import copy
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from lxml import etree

from reports.formats.catalogue import junit

SHAPE = etree.XMLSchema(etree.parse(Path(__file__).parents[1] / "data" / "junit-shape.xsd"))


def parsed(result):
    root = etree.fromstring(junit(result).encode())
    SHAPE.assertValid(root)
    return root


def case(root, name):
    return root.find(f".//testcase[@name='{name}']")


def test_one_suite_for_each_class_and_one_case_for_each_requirement(result):
    root = parsed(result)
    assert [suite.get("name") for suite in root] == list(result["classes"])
    names = {element.get("name") for element in root.iter("testcase")}
    assert names >= {requirement["id"] for requirement in result["requirements"]}


@pytest.mark.parametrize(
    ("name", "outcome"),
    [
        ("rest-resources/pose-type", None),
        ("http/malformed-request", None),
        ("http/declared-status", "failure"),
        ("xml-security/responsive", "error"),
        ("rest-resources/pose-unavailable", "skipped"),
        ("rest-resources/sensors-unique", "skipped"),
        ("safety/hold", "skipped"),
    ],
)
def test_verdicts(result, name, outcome):
    next(item for item in result["requirements"] if item["id"] == "xml-security/responsive")["verdict"] = "error"
    found = [child.tag for child in case(parsed(result), name) if child.tag != "system-out"]
    assert found == ([outcome] if outcome else [])


def test_counts_are_those_of_the_cases(result):
    root = parsed(result)
    for suite in root:
        cases = suite.findall("testcase")
        assert int(suite.get("tests")) == len(cases)
        for outcome, attribute in (("failure", "failures"), ("error", "errors"), ("skipped", "skipped")):
            assert int(suite.get(attribute)) == sum(c.find(outcome) is not None for c in cases)
    assert int(root.get("failures")) == sum(int(suite.get("failures")) for suite in root)
    assert int(root.get("tests")) == sum(int(suite.get("tests")) for suite in root)


def test_failure_tells_how_to_see_it_again(result):
    failure = case(parsed(result), "rest-resources/sensors-type").find("failure")
    (told,) = next(item for item in result["requirements"] if item["id"] == "rest-resources/sensors-type")["failures"]
    assert failure.get("message") == told["message"]
    for wanted in (f"[1] {told['message']}", "Send it again: curl ", "no response", "Not tested because of it: "):
        assert wanted in failure.text
    blocked = case(parsed(result), "rest-resources/sensors-unique").find("skipped").get("message")
    assert blocked.startswith("Not tested, because of finding 1: ")


def test_warning_breaks_no_build_and_is_told(result):
    assert "WARNING: Sent the bytes `" in case(parsed(result), "http/malformed-request").findtext("system-out")


def test_class_without_a_failing_requirement_is_red_as_its_verdict_says(result):
    result["classes"] |= {"rest-delivery": "fail", "strict-input": "inconclusive"}
    result["class_reasons"]["rest-delivery"] = "its prerequisite, the REST endpoint, was not given"
    root = parsed(result)
    assert case(root, "class rest-delivery").find("failure").get("message").startswith("its prerequisite")
    assert case(root, "class strict-input").find("error") is not None


def test_nothing_judged_is_an_error(result):
    result.update(verdict="inconclusive", requirements=[], classes={}, class_reasons={})
    root = parsed(result)
    assert (root.get("tests"), root.get("errors")) == ("1", "1")


def test_expected_failure_is_skipped(result):
    requirement = next(r for r in result["requirements"] if r["id"] == "http/declared-status")
    requirement.update(verdict="warn", expected_failure={"reason": "known since 2.3", "expires": "2027-01-01"})
    element = case(parsed(result), "http/declared-status")
    assert element.find("skipped").get("message") == "Accepted by the baseline until 2027-01-01: known since 2.3"
    assert element.find("failure") is None


def test_hostile_text(hostile):
    assert "\\x00" in etree.tostring(parsed(hostile), encoding="unicode")


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=50, deadline=None)
@given(body=st.text(st.characters(exclude_categories=())))
def test_any_body_is_valid_xml(result, body):
    changed = copy.deepcopy(result)
    failure = next(r for r in changed["requirements"] if r["verdict"] == "fail")["failures"][0]
    failure["response"]["body"] = failure["message"] = failure["request"]["curl"] = body
    parsed(changed)


def test_huge_body_is_cut(result):
    failure = next(r for r in result["requirements"] if r["verdict"] == "fail")["failures"][0]
    failure["response"]["body"] = "x" * 1_000_000
    failure["request"]["curl"] = "y" * 1_000_000
    document = junit(result)
    assert len(document) < 60_000
    assert "of 1000000 characters are not shown" in document


def test_a_device_without_a_statement_has_its_descriptions_name_and_reasons(described_result):
    described_result["statement"]["robot"] = {}
    unseen = next(item for item in described_result["requirements"] if item["verdict"] == "not-claimed")
    root = parsed(described_result)
    told = root.get("name"), case(root, unseen["id"]).find("skipped").get("message")
    assert told == (f"RoAAS: {described_result['api']['title']}", unseen["reason"])
