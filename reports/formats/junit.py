"""Write junit.xml: a conformance result in the format that most CI systems read.

It has a test suite for each conformance class and a test case for each requirement. It is valid by the junit-10.xsd of
Jenkins' xUnit plugin, without the extensions that other readers refuse.

| outcome | becomes |
|---|---|
| passed | a passed test case |
| accepted | skipped: the baseline accepts the failure until the date in the message |
| warning | a passed test case with the warning in its output: a SHOULD breaks no build |
| failed | a failure |
| error | an error |
| skipped | skipped, with the reason |
"""

from collections.abc import Mapping, Sequence
from typing import Any

from lxml import etree

from reports.formats.cases import MESSAGE, Case, Outcome, cases
from reports.pages.untrusted import excerpt, visible

_ELEMENTS = {Outcome.FAILED: "failure", Outcome.ERROR: "error", Outcome.ACCEPTED: "skipped", Outcome.SKIPPED: "skipped"}


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
