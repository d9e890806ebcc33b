"""Write what CI systems show of tests: JUnit XML of a certification and of a load test, and CTRF.

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
"""

import datetime as dt
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from lxml import etree

from reports.formats.cases import MESSAGE, Case, Outcome, cases, places_of
from reports.pages.untrusted import excerpt, visible

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
    robot = result["statement"]["robot"].get("name") or result["target"].get("rest") or "robot"
    root = etree.Element(
        "testsuites",
        name=excerpt(f"RoAAS: {robot}", 200),
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
    named = {"appName": robot.get("name"), "appVersion": robot.get("version")}
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
