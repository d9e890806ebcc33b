"""junit.xml: a conformance result in the form that CI systems read.

One test suite for each conformance class, one test case for each requirement. The form is the one that
Jenkins' xUnit plugin checks (its junit-10.xsd), without the extensions that some other reader would refuse.

| verdict | becomes |
|---|---|
| pass | a passed test case |
| fail, warn with `expected_failure` | skipped: the baseline expects it until a day, which the message names |
| warn | a passed test case that says so in its output: a SHOULD breaks no build |
| fail | a failure |
| error | an error |
| skip, not-claimed | skipped, with the reason |

A class whose verdict no test case of its own explains (a missing prerequisite, nothing executed) gets a test
case of the class's name, so that no reader sees green where the suite saw none.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from lxml import etree

from reports.pages.untrusted import beginning, excerpt, visible

_SHOWN_FAILURES = 10
_SHOWN_BODY = 2000
_SHOWN_CURL = 8000
_MESSAGE = 600


@dataclass(frozen=True, slots=True)
class _Case:
    """One test case: of a requirement or a class.

    Attributes:
        outcome: "passed", "failure", "error" or "skipped".
        message, detail: one line for it, and what belongs to it in full.
        output: what a passed case has to say.
    """

    name: str
    outcome: str
    message: str = ""
    detail: str = ""
    output: str = ""


def junit(result: Mapping[str, Any]) -> bytes:
    """Write a valid `roaas-result/1` document as JUnit XML in UTF-8."""
    suites = [(name, list(_cases(result, name))) for name in _classes(result)]
    cases = [case for _, own in suites for case in own]
    if not cases:
        cases = [_Case("run", "error", "Nothing was judged.")]
        suites = [("roaas", cases)]
    robot = result["statement"]["robot"].get("name") or result["target"].get("rest") or "robot"
    root = etree.Element(
        "testsuites",
        name=excerpt(f"RoAAS: {robot}", 200),
        tests=str(len(cases)),
        failures=_count(cases, "failure"),
        errors=_count(cases, "error"),
        time=f"{result['duration_s']:.3f}",
    )
    for name, own in suites:
        root.append(_suite(name, own, result))
    etree.indent(root)
    document: bytes = etree.tostring(root, xml_declaration=True, encoding="UTF-8")
    return document


def _classes(result: Mapping[str, Any]) -> Iterator[str]:
    yield from dict.fromkeys([*result["classes"], *(r["class"] for r in result["requirements"])])


def _cases(result: Mapping[str, Any], name: str) -> Iterator[_Case]:
    own = [_case(requirement) for requirement in result["requirements"] if requirement["class"] == name]
    verdict = result["classes"].get(name, "inconclusive")
    outcomes = {case.outcome for case in own}
    reason = result["class_reasons"].get(name, "")
    accepted = any(item["class"] == name and item.get("expected_failure") for item in result["requirements"])
    if verdict == "fail" and "failure" not in outcomes and not accepted:
        yield _Case(f"class {name}", "failure", reason or "The class failed.")
    if verdict == "inconclusive" and not outcomes & {"failure", "error"}:
        yield _Case(f"class {name}", "error", reason or "The class could not be judged.")
    yield from own


def _case(requirement: Mapping[str, Any]) -> _Case:
    name, verdict = requirement["id"], requirement["verdict"]
    told = f"{requirement['level']}: {requirement['text']}\nSource: {requirement['source']}"
    evidence = f"{requirement['cases']} cases by {', '.join(requirement['checks']) or 'no check'}"
    detail = "\n\n".join([told, evidence, *_findings(requirement["failures"])])
    expected = requirement.get("expected_failure")
    reason = requirement["untestable"] or requirement["reason"] or ""
    if expected is not None:
        until = f" until {expected['expires']}" if expected.get("expires") else ""
        return _Case(name, "skipped", f"Expected by the baseline{until}: {expected['reason']}", output=detail)
    if verdict == "fail":
        return _Case(name, "failure", _headline(requirement), detail)
    if verdict == "error":
        return _Case(name, "error", reason or "No verdict.", detail)
    if verdict in {"skip", "not-claimed"}:
        claimed = verdict == "skip"
        return _Case(name, "skipped", (reason or "Not tested.") if claimed else "The class is not claimed.")
    if verdict == "warn":
        return _Case(name, "passed", output=f"WARNING: {_headline(requirement)}\n\n{detail}")
    return _Case(name, "passed", output=f"{told}\n{evidence}")


def _headline(requirement: Mapping[str, Any]) -> str:
    failures = requirement["failures"]
    if not failures:
        return str(requirement["reason"] or requirement["text"])
    more = f" (and {len(failures) - 1} more findings)" if len(failures) > 1 else ""
    return f"{failures[0]['message']}{more}"


def _findings(failures: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    for number, failure in enumerate(failures[:_SHOWN_FAILURES], start=1):
        lines = [f"[{number}] {failure['message']}", f"expected: {failure['expected']}"]
        if failure["seen"] > 1:
            lines.append(f"seen in {failure['seen']} cases")
        if failure["request"]:
            lines.append(f"send it again: {_cut(failure['request']['curl'], _SHOWN_CURL)}")
        yield "\n".join([*lines, *_response(failure["response"])])
    if len(failures) > _SHOWN_FAILURES:
        yield f"{len(failures) - _SHOWN_FAILURES} more findings are in result.json."


def _response(response: Mapping[str, Any] | None) -> Iterator[str]:
    if response is None:
        return
    took = "" if response["elapsed_ms"] is None else f" after {response['elapsed_ms']:.1f} ms"
    if response["status"] is None:
        yield f"no response{took}: {response.get('error') or 'no reason was recorded'}"
        return
    yield f"answered {response['status']}{took}"
    if response["body"]:
        yield _cut(response["body"], _SHOWN_BODY, response.get("body_length"))


def _cut(text: str, limit: int, octets: int | None = None) -> str:
    part = beginning(text, limit, octets)
    return f"{part.text}\n… {part.omitted} of {part.total} {part.unit} are not shown" if part.cut else part.text


def _suite(name: str, cases: Sequence[_Case], result: Mapping[str, Any]) -> etree._Element:
    suite = etree.Element(
        "testsuite",
        name=excerpt(name, 200),
        tests=str(len(cases)),
        failures=_count(cases, "failure"),
        errors=_count(cases, "error"),
        skipped=_count(cases, "skipped"),
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
    for case in cases:
        suite.append(_element(name, case))
    return suite


def _element(suite: str, case: _Case) -> etree._Element:
    # No time is known for a single requirement; 0 keeps readers happy that want a number.
    element = etree.Element(
        "testcase", classname=excerpt(f"roaas.{suite}", 200), name=excerpt(case.name, 300), time="0"
    )
    if case.outcome != "passed":
        outcome = etree.SubElement(element, case.outcome, message=excerpt(case.message, _MESSAGE))
        if case.outcome != "skipped":
            outcome.set("type", "nonconformity" if case.outcome == "failure" else "no-verdict")
            outcome.text = visible(case.detail)
    if case.output:
        etree.SubElement(element, "system-out").text = visible(case.output)
    return element


def _count(cases: Sequence[_Case], outcome: str) -> str:
    return str(sum(case.outcome == outcome for case in cases))
