"""Write latency-junit.xml: a latency result in the format that most CI systems read.

Its test cases are the run itself (whether its figures are valid), each limit of a service level, and the
comparison with another robot. What is not known is an error, because it is neither a success nor a failure.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from lxml import etree

from reports.pages.untrusted import excerpt

_GOOD = {"kept", "not slower", "valid"}
_FAILED = {"broken", "slower"}
_MESSAGE = 1000


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
        if self.outcome in _GOOD:
            return None
        return "failure" if self.outcome in _FAILED else "error"


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
        message = excerpt(case.reason, _MESSAGE)
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
