"""Convert a conformance result to test cases, from which every CI format is written.

Each requirement becomes a case. A class whose verdict no requirement explains (a missing prerequisite, nothing
executed) gets a case of its own, and so does a run without any verdict. So no CI system shows green by mistake. That
the robot may still move is the first case.
"""

import hashlib
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from reports.findings import Finding, findings
from reports.pages.page import counted
from reports.pages.untrusted import beginning

STOP = "stop"
"""Name of the case that says that the robot may still move."""
MESSAGE = 1000
"""Characters of a case's message that a format shows on one line."""
_SHOWN_FAILURES = 10
_SHOWN_OCTETS = 40_000
_SHOWN_BODY = 2000
_SHOWN_CURL = 8000


class Outcome(StrEnum):
    """The outcome of a test case, as CI formats distinguish outcomes."""

    FAILED = "failed"
    ERROR = "error"  # could not be judged
    ACCEPTED = "accepted"  # failed, and the baseline accepts that until a date
    WARNING = "warning"  # a SHOULD is not met, which breaks no build
    PASSED = "passed"
    SKIPPED = "skipped"


_OUTCOMES = {
    "pass": Outcome.PASSED,
    "fail": Outcome.FAILED,
    "warn": Outcome.WARNING,
    "skip": Outcome.SKIPPED,
    "error": Outcome.ERROR,
    "not-claimed": Outcome.SKIPPED,
}
_UNEXPLAINED = {Outcome.ERROR: "No verdict.", Outcome.SKIPPED: "Not tested."}


@dataclass(frozen=True, slots=True)
class Case:
    """One test case: of a requirement, a class or the run.

    Attributes:
        name: id of the requirement, `class NAME`, `run`, or `stop`.
        class_name: the conformance class; empty for the run and the stop.
        outcome: its outcome.
        message: the reason for the outcome in one line, or empty.
        requirement: the requirement's entry in result.json; None for a class or the run.
        findings: the requirement's failures, the most urgent first.
    """

    name: str
    class_name: str
    outcome: Outcome
    message: str = ""
    requirement: Mapping[str, Any] | None = None
    findings: Sequence[Finding] = ()

    @property
    def detail(self) -> str:
        """Return the requirement, its checks and its findings as text; empty for skipped cases, a class or the run."""
        if self.requirement is None or self.outcome is Outcome.SKIPPED:
            return ""
        rule = f"{self.requirement['level']}: {self.requirement['text']}\nSource: {self.requirement['source']}"
        cases = self.requirement["cases"]
        by = ", ".join(self.requirement["checks"]) or "no check"
        evidence = f"{cases} case{'' if cases == 1 else 's'} by {by}"
        if self.outcome is Outcome.PASSED:
            return f"{rule}\n{evidence}"
        return "\n\n".join([rule, evidence, *_in_full(self.findings)])

    @property
    def rule(self) -> str:
        """Return the case's name with `/` for spaces, an id that is the same in every run."""
        return self.name.replace(" ", "/")

    @property
    def fingerprint(self) -> str:
        """Return the SHA-256 of the case's rule id as 64 hexadecimal digits, which is the same in every run."""
        return hashlib.sha256(f"roaas/1 {self.rule}".encode()).hexdigest()


def cases(result: Mapping[str, Any]) -> list[Case]:
    """Return the test cases of a valid `roaas-result/1` document, class by class."""
    found = [case for name in classes(result) for case in _of_class(result, name)]
    if "stop_undelivered" in result:
        found.insert(0, Case(STOP, "", Outcome.ERROR, result["stop_undelivered"]))
    if not found or (
        result["verdict"] != "conformant"
        and not any(case.outcome in {Outcome.FAILED, Outcome.ERROR, Outcome.ACCEPTED} for case in found)
    ):
        found.append(Case("run", "", Outcome.ERROR, "Nothing was judged."))
    return found


def worst_first(found: Sequence[Case]) -> list[Case]:
    """Return only the cases that failed, were not judged, were accepted or have a warning, in this order.

    That the robot may still move comes first. Cases with the same outcome are sorted by the number of their most urgent
    finding.
    """
    order = [Outcome.FAILED, Outcome.ERROR, Outcome.ACCEPTED, Outcome.WARNING]
    shown = (case for case in found if case.outcome in order)
    return sorted(shown, key=lambda case: (case.name != STOP, order.index(case.outcome), _first(case)))


def _first(case: Case) -> float:
    """Return the number of the case's first finding, as a sort key; infinity for a case without a finding."""
    return case.findings[0].number or 0 if case.findings else math.inf


def classes(result: Mapping[str, Any]) -> list[str]:
    """Return the names of all conformance classes in a result, including classes without a verdict."""
    return list(dict.fromkeys([*result["classes"], *(r["class"] for r in result["requirements"])]))


def _of_class(result: Mapping[str, Any], name: str) -> Iterator[Case]:
    own = [_of_requirement(item, findings([item], result)) for item in result["requirements"] if item["class"] == name]
    verdict = result["classes"].get(name, "inconclusive")
    outcomes = {case.outcome for case in own}
    reason = result["class_reasons"].get(name, "")
    if verdict == "fail" and not outcomes & {Outcome.FAILED, Outcome.ACCEPTED}:
        yield Case(f"class {name}", name, Outcome.FAILED, reason or "The class failed.")
    if verdict == "inconclusive" and not outcomes & {Outcome.FAILED, Outcome.ERROR}:
        yield Case(f"class {name}", name, Outcome.ERROR, reason or "The class could not be judged.")
    yield from own


def _of_requirement(requirement: Mapping[str, Any], found: Sequence[Finding]) -> Case:
    outcome, message = _outcome(requirement, found)
    return Case(requirement["id"], requirement["class"], outcome, message, requirement, found)


def _outcome(requirement: Mapping[str, Any], found: Sequence[Finding]) -> tuple[Outcome, str]:
    expected = requirement.get("expected_failure")
    if expected is not None:
        until = f" until {expected['expires']}" if expected.get("expires") else ""
        return Outcome.ACCEPTED, f"Accepted by the baseline{until}: {expected['reason']}"
    verdict, reason = requirement["verdict"], requirement["untestable"] or requirement["reason"]
    outcome = _OUTCOMES[verdict]
    if outcome in {Outcome.FAILED, Outcome.WARNING}:
        return outcome, headline(found) or requirement["reason"] or requirement["text"]
    return outcome, "" if outcome is Outcome.PASSED else reason or _UNEXPLAINED[outcome]


def headline(found: Sequence[Finding]) -> str:
    """Return the first finding in words, with how many more there are; empty without one."""
    if not found:
        return ""
    more = f" (and {counted(len(found) - 1, 'more finding')})" if len(found) > 1 else ""
    return f"{found[0].text}{more}"


def _in_full(found: Sequence[Finding]) -> Iterator[str]:
    shown, octets = 0, 0
    for place, finding in enumerate(found[:_SHOWN_FAILURES], start=1):
        if octets > _SHOWN_OCTETS:
            break
        failure = finding.failure
        lines = [f"[{finding.number or place}] {finding.text}"]
        if finding.blocks:
            lines.append(f"Not tested because of it: {', '.join(finding.blocks)}.")
        if failure["request"]:
            lines.append(f"Send it again: {_cut(failure['request']['curl'], _SHOWN_CURL)}")
        text = "\n".join([*lines, *_response(failure["response"])])
        yield text
        shown, octets = place, octets + len(text.encode("utf-8", "surrogatepass"))
    if len(found) > shown:
        yield f"In result.json: {counted(len(found) - shown, 'more finding')}."


def _response(response: Mapping[str, Any] | None) -> Iterator[str]:
    if response is None:
        return
    took = "" if response["elapsed_ms"] is None else f" after {response['elapsed_ms']:.1f} ms"
    if response["status"] is None:
        yield f"No response{took}: {response.get('error') or 'no reason was recorded'}"
        return
    yield f"Response {response['status']}{took}"
    if response["body"]:
        yield _cut(response["body"], _SHOWN_BODY, response.get("body_length"))


def _cut(text: str, limit: int, octets: int | None = None) -> str:
    part = beginning(text, limit, octets)
    return f"{part.text}\n… {part.omitted} of {part.total} {part.unit} are not shown" if part.cut else part.text


_UNKNOWN = "requirements.toml"


@dataclass(frozen=True, slots=True)
class Place:
    """A line of a file.

    Attributes:
        file: path of the file relative to the directory in which the run was started, with `/`.
        line: number of the line, counted from 1.
    """

    file: str
    line: int


def places_of(result: Mapping[str, Any], case: Case) -> list[Place]:
    """Return the lines of the operation that shows the case, of the vendor's claim, and of the requirement.

    The list has at least one place; a place that result.json does not know is left out.
    """
    return list(_places(result, case))


def _line_of(lines: Mapping[str, int], case: Case) -> int | None:
    """Return the line of the first operation of the case's findings, in the description; None if it is not there."""
    for finding in case.findings:
        named = [item["operation"] for item in finding.failure.get("operations", ())]
        for label in (*named, finding.subject.partition("?")[0]):
            if label in lines:
                return lines[label]
    return None


def _places(result: Mapping[str, Any], case: Case) -> Iterator[Place]:
    known = result.get("places", {})
    statement, ledger = known.get("statement"), known.get("ledger")
    described = known.get("description")
    if described and (line := _line_of(described["lines"], case)):
        yield Place(described["file"], line)
    if statement:
        yield Place(statement["file"], statement["classes"].get(case.class_name, statement["line"]))
    stated = [item for item in (ledger, known.get("generic_ledger")) if item and case.name in item["lines"]]
    if stated:
        yield Place(stated[0]["file"], stated[0]["lines"][case.name])
    elif not (statement or (described and _line_of(described["lines"], case))):
        yield Place(ledger["file"] if ledger else _UNKNOWN, 1)
