"""Write what code hosts show beside a change: SARIF, GitLab's code quality report, and GitHub's annotations.

SARIF 2.1.0 (OASIS, errata 01) has a result for each case that needs attention. Of a failed requirement, the findings
that a right device may show too are a result of their own, a warning. Passed and skipped cases are left out,
because some hosts show every result as a problem, whatever its kind. A case without a verdict is of kind `open`; the
run is then another result of level `error`, so that a host that counts errors does not show an inconclusive run as
green. Failures that the baseline accepts are warnings, because hosts hide suppressed results.

GitLab's fingerprint depends only on the requirement, so that the same failure is the same entry in every run, whatever
values the robot returned. A requirement without a verdict is an entry as well.
"""

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any
from urllib.parse import quote

from reports.certificate.page import certificate
from reports.formats.cases import MESSAGE, STOP, Case, Outcome, Place, cases, headline, places_of, worst_first
from reports.pages.untrusted import excerpt, on_a_line, visible

SCHEMA = "https://docs.oasis-open.org/sarif/sarif/v2.1.0/errata01/os/schemas/sarif-schema-2.1.0.json"
_DETAIL = 6000
_LEVELS = {Outcome.FAILED: "error", Outcome.ERROR: "none", Outcome.ACCEPTED: "warning", Outcome.WARNING: "warning"}
# By form of a source in the ledger: the web page of the clause.
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
