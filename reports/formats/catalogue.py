"""List all output formats by the name that `roaas report --format` takes, with their file names.

The shortest is here too: a badge for shields.io's endpoint, green only if the robot is conformant.

junit.xml has a test suite for each conformance class and a test case for each requirement. It is valid by the
junit-10.xsd of Jenkins' xUnit plugin, without the extensions that other readers refuse. CTRF, the Common Test Report
Format, is one JSON format for many tools. Readers show its `other` without a colour, and a case without a verdict must
not look green.

| outcome | in junit.xml | in CTRF |
|---|---|---|
| passed | a passed test case | `passed` |
| accepted | skipped: the baseline accepts the failure until the date in the message | `other` |
| warning | a passed test case with the warning in its output: a SHOULD breaks no build | `passed`, with its message |
| failed | a failure | `failed` |
| error | an error | `failed` |
| skipped | skipped, with the reason | `skipped` |

The test cases of latency-junit.xml are the run itself (whether its figures are valid), each limit of a service level,
and the comparison with another robot. What is not known is an error, because it is neither a success nor a failure.

SARIF 2.1.0 (OASIS, errata 01) has a result for each case that needs attention. Of a failed requirement, the findings
that a right device may show too are a result of their own, a warning. Passed and skipped cases are left out,
because some hosts show every result as a problem, whatever its kind. A case without a verdict is of kind `open`; the
run is then another result of level `error`, so that a host that counts errors does not show an inconclusive run as
green. Failures that the baseline accepts are warnings, because hosts hide suppressed results.

GitLab's fingerprint depends only on the requirement, so that the same failure is the same entry in every run, whatever
values the robot returned. A requirement without a verdict is an entry as well.
"""

import datetime as dt
import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple
from urllib.parse import quote

from lxml import etree

from reports.certificate.page import certificate, certificate_markdown, verdict_words
from reports.formats.cases import MESSAGE, STOP, Case, Outcome, Place, cases, headline, places_of, worst_first
from reports.pages.untrusted import excerpt, on_a_line, visible

SCHEMA = "https://docs.oasis-open.org/sarif/sarif/v2.1.0/errata01/os/schemas/sarif-schema-2.1.0.json"
_DETAIL = 6000
_LEVELS = {Outcome.FAILED: "error", Outcome.ERROR: "none", Outcome.ACCEPTED: "warning", Outcome.WARNING: "warning"}
# The web page of a clause, by the form of the source in the ledger.
_PAGES = (
    (r"RFC (\d+) (\d+(?:\.\d+)*)", "https://www.rfc-editor.org/rfc/rfc{0}#section-{1}"),
    (r"RFC (\d+) Appendix ([A-Z])", "https://www.rfc-editor.org/rfc/rfc{0}#appendix-{1}"),
    (r"RFC (\d+)", "https://www.rfc-editor.org/rfc/rfc{0}"),
    (r"CWE-(\d+)", "https://cwe.mitre.org/data/definitions/{0}.html"),
    (r"BP (R\d+)", "https://www.ws-i.org/Profiles/BasicProfile-1.1.html#{0}"),
    (r"SOAP 1\.1", "https://www.w3.org/TR/2000/NOTE-SOAP-20000508/"),
    (r"WSDL 1\.1", "https://www.w3.org/TR/2001/NOTE-wsdl-20010315"),
    (r"XML Schema 1\.0 Part 2", "https://www.w3.org/TR/xmlschema-2/"),
    (r"Namespaces in XML", "https://www.w3.org/TR/xml-names/"),
    (r"XML 1\.0", "https://www.w3.org/TR/xml/"),
)
_SEVERITIES = {Outcome.FAILED: "critical", Outcome.ERROR: "major", Outcome.ACCEPTED: "minor", Outcome.WARNING: "minor"}
MOST = 10  # GitHub shows ten errors and ten warnings of a step, and silently drops the rest


def sarif(result: Mapping[str, Any]) -> str:
    """Return a valid `roaas-result/1` document as a SARIF log (JSON text) with one run."""
    found = worst_first(cases(result))
    if any(case.outcome is Outcome.ERROR and case.name != STOP for case in found) and not any(
        case.name == "run" for case in found
    ):
        found.append(Case("run", "", Outcome.ERROR, certificate(result).headline))
    rules = [_rule(result, case) for case in found]
    run = {
        "tool": {"driver": {"name": "RoAAS", "version": result["suite"]["version"], "rules": rules}},
        "automationDetails": {"id": "roaas/"},
        "invocations": [_invocation(result, found)],
        "columnKind": "unicodeCodePoints",
        "results": [_result(result, part, index) for index, case in enumerate(found) for part in _parts(case)],
        "properties": {"verdict": result["verdict"], "suiteDigest": result["suite"]["digest"], "seed": result["seed"]},
    }
    return json.dumps({"$schema": SCHEMA, "version": "2.1.0", "runs": [run]}, indent=1) + "\n"


def _invocation(result: Mapping[str, Any], found: Sequence[Case]) -> dict[str, Any]:
    judged = result["verdict"] != "inconclusive" and not result.get("interrupted")
    open_cases = [case for case in found if case.outcome is Outcome.ERROR]
    return {
        # This is about the run, not the robot: false if there is no verdict.
        "executionSuccessful": judged,
        "startTimeUtc": result["started"],
        **({"endTimeUtc": result["finished"]} if result["finished"] else {}),
        "toolExecutionNotifications": [
            {
                "level": "note" if judged and case.name != STOP else "error",
                "message": {"text": _text(f"{case.name}: {case.message}")},
            }
            for case in open_cases
        ],
    }


def _rule(result: Mapping[str, Any], case: Case) -> dict[str, Any]:
    requirement = case.requirement
    if requirement is None:
        title = result.get("class_titles", {}).get(case.class_name)
        said = f"Class {case.class_name}: {title}" if title else f"The verdict of {case.name}"
        return {"id": case.rule, "shortDescription": {"text": _text(said)}}
    page = page_of(requirement["source"])
    source = f"Source: {requirement['source']}."
    fix = f" How to fix it: {requirement['fix']}" if "fix" in requirement else ""
    return {
        "id": case.rule,
        "shortDescription": {"text": _text(requirement["text"])},
        "help": {"text": _text(f"{requirement['text']} {source}{fix}")},
        **({"helpUri": page} if page else {}),
        "defaultConfiguration": {"level": "error" if requirement["level"] == "MUST" else "warning"},
        "properties": {"tags": [case.class_name, requirement["level"], requirement["verdict"]]},
    }


def _parts(case: Case) -> list[Case]:
    """Return a failed case with its sure findings, and one with its doubtful findings, which only warns."""
    sure = [finding for finding in case.findings if "doubt" not in finding.failure]
    doubtful = [finding for finding in case.findings if "doubt" in finding.failure]
    if case.outcome is not Outcome.FAILED or not (sure and doubtful):
        return [case]
    parts = ((Outcome.FAILED, sure), (Outcome.WARNING, doubtful))
    return [replace(case, outcome=outcome, message=headline(found), findings=found) for outcome, found in parts]


def _result(result: Mapping[str, Any], case: Case, index: int) -> dict[str, Any]:
    first, *others = places_of(result, case)
    is_doubtful = case.outcome is Outcome.WARNING and case.requirement and case.requirement["verdict"] == "fail"
    undecided = case.outcome is Outcome.ERROR and case.requirement is not None
    return {
        "ruleId": case.rule,
        "ruleIndex": index,
        "kind": "open" if undecided else "fail",
        "level": _LEVELS[case.outcome] if case.requirement else "error",
        "message": {"text": _text(case.message or case.name)},
        "locations": [{"physicalLocation": _location(first)}],
        "relatedLocations": [
            {"id": number, "physicalLocation": _location(place), "message": {"text": "What the contract asks for"}}
            for number, place in enumerate(others)
        ],
        "partialFingerprints": {"roaas/v1": case.fingerprint, **({"roaas/doubts": "1"} if is_doubtful else {})},
        "properties": {"outcome": case.outcome, "detail": visible(case.detail[:_DETAIL])},
    }


def _location(place: Place) -> dict[str, Any]:
    return {"artifactLocation": {"uri": quote(place.file)}, "region": {"startLine": place.line}}


def _text(text: str) -> str:
    """Return the text on one line, with placeholders (SARIF 3.11.5) and links (3.11.6) escaped."""
    line = excerpt(text, MESSAGE)
    return line.replace("{", "{{").replace("}", "}}").replace("\\", "\\\\").replace("[", "\\[").replace("]", "\\]")


def page_of(source: str) -> str | None:
    """Return the https URL of the first source in a "; "-separated list that has a known web page, or None."""
    for part in source.split("; "):
        for pattern, page in _PAGES:
            if found := re.match(pattern, part):
                return page.format(*found.groups())
    return None


def gitlab(result: Mapping[str, Any]) -> str:
    """Return a valid `roaas-result/1` document as a GitLab code quality report (JSON text)."""
    return json.dumps([_entry(result, case) for case in worst_first(cases(result))], indent=1) + "\n"


def _entry(result: Mapping[str, Any], case: Case) -> dict[str, Any]:
    place = places_of(result, case)[0]
    return {
        "description": excerpt(f"{case.name}: {case.message}", MESSAGE),
        "check_name": case.rule,
        "fingerprint": case.fingerprint,
        "severity": _SEVERITIES[case.outcome],
        "location": {"path": place.file, "lines": {"begin": place.line}},
    }


def annotations(result: Mapping[str, Any]) -> str:
    """Return a valid `roaas-result/1` document as GitHub workflow commands, one per line."""
    found = worst_first(cases(result))
    lines = [_command(result, case) for case in found[:MOST]]
    if len(found) > MOST:
        lines.append(f"::notice title=RoAAS::{len(found) - MOST} more are in the job summary and in certificate.html")
    return "".join(f"{line}\n" for line in lines)


def _command(result: Mapping[str, Any], case: Case) -> str:
    place = places_of(result, case)[0]
    command = "error" if case.outcome in {Outcome.FAILED, Outcome.ERROR} else "warning"
    title = f"{case.name} ({case.outcome})"
    properties = f"file={_property(place.file)},line={place.line},title={_property(title)}"
    return f"::{command} {properties}::{_data(on_a_line(case.message, MESSAGE))}"


def _data(text: str) -> str:
    """Escape `%`, carriage return and line feed, so that text from a robot cannot start another workflow command."""
    return text.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


def _property(text: str) -> str:
    return _data(on_a_line(text, MESSAGE)).replace(":", "%3A").replace(",", "%2C")


_ELEMENTS = {Outcome.FAILED: "failure", Outcome.ERROR: "error", Outcome.ACCEPTED: "skipped", Outcome.SKIPPED: "skipped"}
_CTRF_VERSION = "0.0.0"
_CTRF_STATUSES = {
    Outcome.PASSED: "passed",
    Outcome.WARNING: "passed",
    Outcome.FAILED: "failed",
    Outcome.ERROR: "failed",
    Outcome.ACCEPTED: "other",
    Outcome.SKIPPED: "skipped",
}
_LATENCY_GOOD = {"kept", "not slower", "valid"}
_LATENCY_FAILED = {"broken", "slower"}
_LATENCY_MESSAGE = 1000


def junit(result: Mapping[str, Any]) -> str:
    """Return a valid `roaas-result/1` document as JUnit XML text with an XML declaration (UTF-8)."""
    found = cases(result)
    names = (result["statement"]["robot"].get("name"), result.get("api", {}).get("title"), result["target"].get("rest"))
    root = etree.Element(
        "testsuites",
        name=excerpt(f"RoAAS: {next(filter(None, names), 'robot')}", 200),
        tests=str(len(found)),
        failures=_count(found, "failure"),
        errors=_count(found, "error"),
        time=f"{result['duration_s']:.3f}",
    )
    judged: dict[str, list[Case]] = {}
    for case in found:
        judged.setdefault(case.class_name, []).append(case)
    for name in dict.fromkeys([*[case.class_name for case in found[:1]], *result["classes"], *judged]):
        root.append(_suite(name or "roaas", judged.get(name, []), result))
    etree.indent(root)
    document: bytes = etree.tostring(root, xml_declaration=True, encoding="UTF-8")
    return document.decode()


def _suite(name: str, own: Sequence[Case], result: Mapping[str, Any]) -> etree._Element:
    suite = etree.Element(
        "testsuite",
        name=excerpt(name, 200),
        tests=str(len(own)),
        failures=_count(own, "failure"),
        errors=_count(own, "error"),
        skipped=_count(own, "skipped"),
        timestamp=result["started"][:19],
    )
    properties = etree.SubElement(suite, "properties")
    for key, value in (
        ("verdict", result["classes"].get(name, "inconclusive")),
        ("suite", result["suite"]["version"]),
        ("contract", result["suite"]["contract"]),
        ("seed", str(result["seed"])),
        ("command", result["command"]),
    ):
        etree.SubElement(properties, "property", name=key, value=excerpt(value, 4000))
    for case in own:
        suite.append(_element(name, case))
    return suite


def _element(suite: str, case: Case) -> etree._Element:
    # The time of a single requirement is not measured; some readers need a number.
    element = etree.Element(
        "testcase", classname=excerpt(f"roaas.{suite}", 200), name=excerpt(case.name, 300), time="0"
    )
    if case.outcome in _ELEMENTS:
        outcome = etree.SubElement(element, _ELEMENTS[case.outcome], message=excerpt(case.message, MESSAGE))
        if case.outcome in {Outcome.FAILED, Outcome.ERROR}:
            outcome.set("type", "nonconformity" if case.outcome is Outcome.FAILED else "no-verdict")
            outcome.text = visible(case.detail)
            return element
    if case.detail:
        warning = f"WARNING: {case.message}\n\n" if case.outcome is Outcome.WARNING else ""
        etree.SubElement(element, "system-out").text = visible(warning + case.detail)
    return element


def _count(found: Sequence[Case], element: str) -> str:
    return str(sum(_ELEMENTS.get(case.outcome) == element for case in found))


def ctrf(result: Mapping[str, Any]) -> str:
    """Return a valid `roaas-result/1` document as a CTRF report (JSON text)."""
    tests = [_test(result, case) for case in cases(result)]
    statuses = [test["status"] for test in tests]
    start = _milliseconds(result["started"])
    counts = {name: statuses.count(name) for name in ("passed", "failed", "skipped", "pending", "other")}
    report = {
        "reportFormat": "CTRF",
        "specVersion": _CTRF_VERSION,
        "generatedBy": "roaas",
        "results": {
            "tool": {"name": "RoAAS", "version": result["suite"]["version"]},
            "summary": {
                "tests": len(tests),
                **counts,
                "start": start,
                "stop": _milliseconds(result["finished"]) if result["finished"] else start,
            },
            "tests": tests,
            "environment": _environment(result),
            "extra": {"verdict": result["verdict"], "seed": result["seed"], "effort": result["effort"]},
        },
    }
    return json.dumps(report, indent=1) + "\n"


def _test(result: Mapping[str, Any], case: Case) -> dict[str, Any]:
    place = places_of(result, case)[0]
    return {
        "name": case.name,
        "status": _CTRF_STATUSES[case.outcome],
        "rawStatus": case.outcome,
        # The time of a single requirement is not measured.
        "duration": 0,
        "suite": [case.class_name or "roaas"],
        "filePath": place.file,
        "line": place.line,
        **({"tags": [case.requirement["level"]]} if case.requirement else {}),
        **({"message": excerpt(case.message, MESSAGE)} if case.message else {}),
        **({"trace": visible(case.detail)} if case.message and case.detail else {}),
    }


def _environment(result: Mapping[str, Any]) -> dict[str, str]:
    robot = result["statement"]["robot"]
    named = {"appName": robot.get("name") or result.get("api", {}).get("title"), "appVersion": robot.get("version")}
    return {key: excerpt(value, 200) for key, value in named.items() if value}


def _milliseconds(time: str) -> int:
    return round(dt.datetime.fromisoformat(time).timestamp() * 1000)


@dataclass(frozen=True, slots=True)
class _Case:
    """One test case: its group, its name, its outcome in a word, and the reason."""

    group: str
    name: str
    outcome: str
    reason: str

    @property
    def element(self) -> str | None:
        """Return the element of a case that did not pass, or None."""
        if self.outcome in _LATENCY_GOOD:
            return None
        return "failure" if self.outcome in _LATENCY_FAILED else "error"


def latency_junit(result: Mapping[str, Any]) -> str:
    """Return a valid `roaas-latency/1` document as JUnit XML text with an XML declaration (UTF-8)."""
    cases = list(_cases(result))
    counts = {kind: str(sum(case.element == kind for case in cases)) for kind in ("failure", "error")}
    robot = result["environment"].get("robot") or {}
    name = excerpt(f"RoAAS latency: {robot.get('name') or robot.get('rest') or robot.get('soap') or 'robot'}", 200)
    totals = {"tests": str(len(cases)), "failures": counts["failure"], "errors": counts["error"]}
    root = etree.Element("testsuites", {"name": name, **totals})
    suite = etree.SubElement(root, "testsuite", {"name": "latency", **totals})
    if result.get("started"):
        suite.set("timestamp", result["started"][:19])
    for case in cases:
        element = etree.SubElement(
            suite, "testcase", classname=f"roaas.{case.group}", name=excerpt(case.name, 300), time="0"
        )
        message = excerpt(case.reason, _LATENCY_MESSAGE)
        if case.element:
            etree.SubElement(element, case.element, message=message, type=case.outcome.replace(" ", "-"))
        else:
            etree.SubElement(element, "system-out").text = message
    etree.indent(root)
    document: bytes = etree.tostring(root, xml_declaration=True, encoding="UTF-8")
    return document.decode()


def _cases(result: Mapping[str, Any]) -> Iterator[_Case]:
    sentence = result["headline"]["sentence"]
    if "stop_undelivered" in result:
        yield _Case("run", "the robot was stopped", "may still move", result["stop_undelivered"])
    yield _Case("run", "the figures are valid", "valid" if result["valid"] else "not valid", sentence)
    for level in result.get("slo", []):
        name = f"{level['operation']} over {level['interface'].upper()}: {level['limit']} at most {level['most']:g}"
        yield _Case("slo", name, level["outcome"], level["reason"])
    if result.get("against"):
        yield _Case("against", "not slower than the other robot", result["against"]["verdict"], sentence)


_COLOURS = {"conformant": "brightgreen", "not-conformant": "red", "inconclusive": "lightgrey"}


def badge(result: Mapping[str, Any]) -> str:
    """Return the JSON of a shields.io badge with the verdict of a valid `roaas-result/1` document."""
    verdict, colour = verdict_words(result)[result["verdict"]].lower(), _COLOURS[result["verdict"]]
    values = list(result["classes"].values())
    text = result.get("verdict_line") or f"{verdict} ({values.count('pass')} of {len(values)} classes)"
    if result.get("accepted_until"):
        text, colour = f"{verdict}, known failures until {result['accepted_until']}", "orange"
    if result.get("interrupted"):
        text, colour = f"{verdict}, interrupted", "red" if result["verdict"] == "not-conformant" else "lightgrey"
    return json.dumps({"schemaVersion": 1, "label": "RoAAS", "message": text, "color": colour}, indent=1) + "\n"


class Format(NamedTuple):
    """An output format: the file name that its readers expect, and the function that converts a result to its text."""

    file: str
    write: Callable[[Mapping[str, Any]], str]


FORMATS = {
    "junit": Format("junit.xml", junit),
    "sarif": Format("roaas.sarif", sarif),
    "ctrf": Format("ctrf-report.json", ctrf),
    "gitlab": Format("gl-code-quality-report.json", gitlab),
    "markdown": Format("certificate.md", certificate_markdown),
    "annotations": Format("annotations.txt", annotations),
    "badge": Format("badge.json", badge),
}
