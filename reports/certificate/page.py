"""Write the certificate, a conformance result that a vendor can hand to a customer, as an HTML page and as Markdown.

This module computes the content of all forms of the certificate; the templates lay it out. The page calls itself a
certificate only if every claimed class passed.

The Markdown, for a pull request or the summary of a CI job, is of limited size: GitHub drops a job summary of more than
1 MiB, so without a limit a run with many failures would show nothing.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import segno
from markupsafe import Markup

from reports.certificate.described import WORDS, Described, description_of
from reports.certificate.moves_drawn import Grid, Picture
from reports.findings import FOLDED, QUESTIONS, Finding, by_cause, by_requirement, by_topic, findings
from reports.pages.page import html_page, markdown_page

SHOWN_FAILURES = 5
"""Findings shown for each requirement; the rest are counted."""
ALL_FAILURES = 1000
"""Findings shown for each requirement where other parts of the page link to all of them."""
SHOWN_BODY = 3000
"""Characters shown of a request's or response's body."""
SHOWN_CURL = 8000
"""Characters shown of a curl command; a longer one, as of a size attack, cannot be copied."""
FIRST = 3
"""Findings that the page begins with."""
SHOWN_IDS = 12
"""Requirements of one reason that are listed; a longer list is folded, or counted."""

VERDICT_WORDS = {
    "conformant": "Conformant",
    "not-conformant": "Not conformant",
    "inconclusive": "Inconclusive",
    "pass": "Passed",
    "fail": "Failed",
    "warn": "Warning",
    "skip": "Not tested",
    "error": "No verdict",
    "not-claimed": "Not claimed",
}
VIEWS = {
    "black box": ": judged by the responses of the web services alone.",
    "seen on ROS": ": the suite also observed the robot's ROS topics.",
}
"""What it means how a class was observed."""
_ORDER = ("fail", "error", "warn", "skip", "pass", "not-claimed")
_COLUMNS = ("pass", "fail", "warn", "error", "skip", "not-claimed")
_CLASS_ORDER = ("fail", "inconclusive", "pass", "not-claimed")
MOST_OCTETS = 512 * 1024
"""Limit of the Markdown for details of single requirements; verdicts, classes and reasons are limited in number."""
_MOST_SHOWN = 30
_MOST_NAMED = 500
_MOST_GROUPS = 30
_LIMITS = {"in_full": 10, "most_named": _MOST_NAMED}
_HEADINGS = {"fail": "What failed", "warn": "Warnings"}


@dataclass(frozen=True, slots=True)
class Seal:
    """The fingerprints that a certificate page shows.

    Attributes:
        result: SHA-256 of result.json, in hexadecimal.
        key: fingerprint of the signing key, or None if the result is not signed.
    """

    result: str
    key: str | None = None

    @property
    def text(self) -> str:
        """Return both fingerprints as one line of text, as in the QR code; `roaas verify` prints the same two."""
        return f"RoAAS result sha256:{self.result} key sha256:{self.key}"

    @property
    def code(self) -> Markup:
        """Return the QR code of both fingerprints as SVG: dark on white, with the margin that scanners need."""
        picture = segno.make(self.text, error="m").svg_inline(scale=3, light="#fff", omitsize=True)
        return Markup(picture)  # noqa: S704 - drawn here, from two digests


@dataclass(frozen=True, slots=True)
class ClassSummary:
    """One conformance class of a result with its requirements, the worst verdict first."""

    name: str
    title: str
    verdict: str
    reason: str
    requirements: tuple[Mapping[str, Any], ...]
    view: str = ""
    """How it was observed, if that makes a difference: one of `VIEWS`."""

    def count(self, verdict: str) -> int:
        """Return how many of the class's requirements have that verdict."""
        return sum(requirement["verdict"] == verdict for requirement in self.requirements)


@dataclass(frozen=True, slots=True)
class Untested:
    """The requirements of claimed classes that were not tested for one common reason.

    Attributes:
        reason: the reason, in words.
        because_of: number of the finding that kept the suite from testing them, or None.
    """

    reason: str
    because_of: int | None
    requirements: tuple[Mapping[str, Any], ...]


@dataclass(frozen=True, slots=True)
class Group:
    """The requirements under one heading of the list of all requirements: a topic, or a class before contract 1.2."""

    title: str
    requirements: tuple[Mapping[str, Any], ...]
    folded: bool = False


@dataclass(frozen=True, slots=True)
class Certificate:
    """The content of a certificate, computed from a conformance result.

    Conformance classes are sorted with the worst verdict first; `untested` groups requirements that were not tested.
    """

    result: Mapping[str, Any]
    classes: tuple[ClassSummary, ...]
    untested: tuple[Untested, ...] = field(default=())

    @property
    def claimed(self) -> tuple[ClassSummary, ...]:
        """Return the classes that the vendor claims."""
        return tuple(c for c in self.classes if c.verdict != "not-claimed")

    @property
    def unclaimed(self) -> tuple[ClassSummary, ...]:
        """Return the classes that the vendor does not claim."""
        return tuple(c for c in self.classes if c.verdict == "not-claimed")

    @property
    def passed(self) -> tuple[ClassSummary, ...]:
        """Return the classes that passed."""
        return tuple(c for c in self.classes if c.verdict == "pass")

    @property
    def groups(self) -> tuple[Group, ...]:
        """Return all requirements by topic, the worst verdict first; by class if the result has no topics."""
        items = sorted(self.result["requirements"], key=lambda r: _ORDER.index(r["verdict"]))
        if not all("topic" in item for item in items):
            return tuple(Group(c.name, c.requirements) for c in self.classes if c.requirements)
        found = {topic: tuple(item for item in items if item["topic"] == topic) for topic in QUESTIONS}
        return tuple(Group(QUESTIONS[topic], own, topic == FOLDED) for topic, own in found.items() if own)

    @property
    def verdict_line(self) -> str:
        """Return the verdict and what it is about, such as "conformant to full (contract 1.2), seen on ROS"."""
        return str(self.result.get("verdict_line") or verdict_words(self.result)[self.result["verdict"]])

    @property
    def title(self) -> str:
        """Return what the page calls itself: a certificate of conformance to a contract, or a report."""
        if self.described:
            return "Report on a device and its own description"
        conformant = self.result["verdict"] == "conformant"
        return f"{self.subject} {'Certificate of conformance' if conformant else 'Conformance report'}"

    @property
    def described(self) -> Described | None:
        """Return the operations of a device that is judged by its own description, otherwise None."""
        return description_of(self.result)

    @property
    def robot(self) -> str:
        """Return the robot's name, or else the title of its description, or its address."""
        name = self.result["statement"]["robot"].get("name") or self.result.get("api", {}).get("title")
        return str(name or self.result["target"].get("rest") or "Unnamed robot")

    @property
    def maker(self) -> str:
        """Return the robot's vendor and version as far as they are stated, and the address of a described one."""
        robot = self.result["statement"]["robot"]
        parts = [robot.get("vendor"), f"version {robot['version']}" if robot.get("version") else None]
        parts += [self.result["target"].get("rest")] if self.described else []
        return ", ".join(part for part in parts if part)

    @property
    def headline(self) -> str:
        """Return the verdict in a sentence; also name the failures that the baseline accepts, with date and reason."""
        accepted = self.result.get("accepted_until")
        if not accepted:
            return f"{self._headline} {self.described.extent}" if self.described else self._headline
        known = [r for r in self.with_verdict("warn") if r.get("expected_failure")]
        named = "; ".join(
            f"{r['id']} until {r['expected_failure'].get('expires')} ({r['expected_failure']['reason']})" for r in known
        )
        return f"{self._headline} Known failures are accepted until {accepted}: {named}."

    @property
    def declared(self) -> str:
        """Return the figures that the vendor declares and the verdict depends on, as "name = value" text."""
        figures = self.result["statement"].get("declared", {})
        return ", ".join(f"{name} = {figure:g}" for name, figure in figures.items()) or "nothing"

    @property
    def _headline(self) -> str:
        judged = len(self.claimed)
        claimed = "" if self.described else "claimed "
        classes = f"{judged} {claimed}{'class' if judged == 1 else 'classes'}"
        verdict = self.result["verdict"]
        if verdict == "conformant":
            return f"Each of the {classes} passed." if judged > 1 else f"The {claimed}class passed."
        failed = sum(c.verdict == "fail" for c in self.classes)
        open_classes = sum(c.verdict == "inconclusive" for c in self.classes)
        if verdict == "not-conformant":
            rest = f"; {open_classes} could not be judged" if open_classes else ""
            return f"{failed} of {classes} failed{rest}."
        if not sum(requirement["cases"] for requirement in self.result["requirements"]):
            return "No case was executed, so there is no verdict on this robot."
        return f"{open_classes} of {classes} could not be judged."

    @property
    def contract(self) -> str:
        """Return title, version and pack name of the contract; for results before version 1.2 only its version."""
        if self.described:
            return f"its own description: {self.described.name}".rstrip(": ")
        pack = self.result.get("pack")
        if not pack:
            return str(self.result["suite"]["contract"])
        return f"{pack['title']} {pack['version']}".rstrip() + f" (pack {pack['name']})"

    @property
    def subject(self) -> str:
        """Return the title of the specification that a conforming robot conforms to, "RoAAS" by default."""
        return str(self.result.get("pack", {}).get("title", "RoAAS"))

    @property
    def columns(self) -> list[tuple[str, str]]:
        """Return each verdict that a requirement of a claimed class has, with its heading; they add up to all."""
        words = verdict_words(self.result) | {"warn": "Warnings"}
        return [(verdict, words[verdict]) for verdict in _COLUMNS if any(c.count(verdict) for c in self.claimed)]

    @property
    def seen_by(self) -> list[str]:
        """Return how the claimed classes were observed: keys of `VIEWS`."""
        return sorted({c.view for c in self.claimed} & set(VIEWS))

    @property
    def first(self) -> list[Finding]:
        """Return a finding each of the requirements to look at first: failures, warnings, then what is accepted."""
        found: dict[str, Finding] = {}
        for finding in (*self.findings("fail"), *self.findings("warn")):
            found.setdefault(finding.requirement["id"], finding)
        return sorted(found.values(), key=lambda one: "expected_failure" in one.requirement)[:FIRST]

    @property
    def more_findings(self) -> int:
        """Return how many findings there are beside `first`."""
        return len(self.findings("fail")) + len(self.findings("warn")) - len(self.first)

    def findings(self, verdict: str) -> list[Finding]:
        """Return the findings (failures) of requirements with that verdict, the most urgent finding first."""
        return findings(self.with_verdict(verdict), self.result)

    def with_verdict(self, verdict: str) -> tuple[Mapping[str, Any], ...]:
        """Return the requirements with that verdict, of all classes."""
        found = {r["id"]: r for c in self.classes for r in c.requirements if r["verdict"] == verdict}
        return tuple(found.values())

    def counts(self) -> Iterator[tuple[str, int]]:
        """Yield each verdict that occurs with its number of requirements, the worst verdict first."""
        for verdict in _ORDER:
            number = len(self.with_verdict(verdict))
            if number:
                yield verdict, number


def certificate(result: Mapping[str, Any]) -> Certificate:
    """Return a valid `roaas-result/1` document as a `Certificate`, the object that the page templates use."""
    classes = tuple(sorted(_classes(result), key=lambda c: _CLASS_ORDER.index(c.verdict)))
    return Certificate(result, classes, tuple(_untested_groups(classes)))


def _classes(result: Mapping[str, Any]) -> Iterator[ClassSummary]:
    by_class: dict[str, list[Mapping[str, Any]]] = {name: [] for name in result["classes"]}
    for requirement in result["requirements"]:
        for name in (requirement["class"], *requirement.get("also", ())):
            by_class.setdefault(name, []).append(requirement)
    titles = result.get("class_titles", {})
    for name, requirements in by_class.items():
        yield ClassSummary(
            name=name,
            title=titles.get(name, ""),
            verdict=result["classes"].get(name, "inconclusive"),
            reason=result["class_reasons"].get(name, ""),
            requirements=tuple(sorted(requirements, key=lambda r: _ORDER.index(r["verdict"]))),
            view=result.get("class_views", {}).get(name, ""),
        )


def _untested_groups(classes: tuple[ClassSummary, ...]) -> Iterator[Untested]:
    groups: dict[tuple[str, int | None], list[Mapping[str, Any]]] = {}
    told: set[str] = set()
    for summary in classes:
        if summary.verdict == "not-claimed":
            continue
        for requirement in summary.requirements:
            if requirement["verdict"] in {"skip", "error"} and requirement["id"] not in told:
                told.add(requirement["id"])
                reason = requirement["untestable"] or requirement["reason"] or "No reason was recorded."
                groups.setdefault((reason, requirement.get("because_of")), []).append(requirement)
    for (reason, because_of), requirements in groups.items():
        yield Untested(reason, because_of, tuple(requirements))


def certificate_html(
    result: Mapping[str, Any], seal: Seal | None = None, drawn: Sequence[Picture] = (), grid: Grid | None = None
) -> str:
    """Return the certificate of a result as an HTML page.

    Args:
        result: a valid `roaas-result/1` document.
        seal: the fingerprints to show.
        drawn: how the device moved.
        grid: what it took in which state.
    """
    return html_page("certificate.html.j2", seal=seal, drawn=drawn, grid=grid, **page_values(result))


def certificate_print(result: Mapping[str, Any], seal: Seal) -> str:
    """Return a one-page A4 summary of a signed certificate as HTML, for printing."""
    return html_page("certificate-print.html.j2", seal=seal, **page_values(result))


def verdict_words(result: Mapping[str, Any]) -> dict[str, str]:
    """Return the words for each verdict in a result."""
    return {**VERDICT_WORDS, **WORDS, "not-claimed": "Not judged"} if description_of(result) else VERDICT_WORDS


def page_values(result: Mapping[str, Any]) -> dict[str, Any]:
    """Return the template variables that the HTML, print and Markdown forms of the certificate share."""
    return {
        "certificate": certificate(result),
        "result": result,
        "sections": result.get("contract_sections", {}),
        "words": verdict_words(result),
        "described": description_of(result),
        "views": VIEWS,
        "by_cause": by_cause,
        "by_topic": by_topic,
        "questions": QUESTIONS,
        "folded": FOLDED,
        "by_requirement": by_requirement,
        "findings": findings,
        # The matrix of operations links to each finding.
        "shown_failures": ALL_FAILURES if description_of(result) else SHOWN_FAILURES,
        "shown_body": SHOWN_BODY,
        "shown_curl": SHOWN_CURL,
        "shown_ids": SHOWN_IDS,
    }


class _Part(NamedTuple):
    """The requirements of one verdict: Markdown blocks of those with details, and the rest, listed by id only."""

    heading: str
    in_full: Sequence[str]
    rest: Sequence[Mapping[str, Any]]


def certificate_markdown(result: Mapping[str, Any]) -> str:
    """Return a valid `roaas-result/1` document as a Markdown certificate of less than 1 MiB."""
    values = page_values(result)
    parts, left = [], MOST_OCTETS
    for verdict, heading in _HEADINGS.items():
        found = sorted(values["certificate"].with_verdict(verdict), key=lambda r: (_topic(r), _urgency(r)))
        in_full: list[str] = []
        for requirement in found[:_MOST_SHOWN]:
            block = markdown_page("requirement.md.j2", r=requirement, found=findings([requirement], result), **_LIMITS)
            left -= len(block.encode())
            if left < 0:
                break
            in_full.append(block)
        if found:
            parts.append(_Part(heading, in_full, found[len(in_full) :]))
    return markdown_page("certificate.md.j2", parts=parts, most_named=_MOST_NAMED, most_groups=_MOST_GROUPS, **values)


def _topic(requirement: Mapping[str, Any]) -> int:
    """Return the place of the requirement's topic among all topics; -1 before contract 1.2."""
    return list(QUESTIONS).index(requirement["topic"]) if "topic" in requirement else -1


def _urgency(requirement: Mapping[str, Any]) -> int:
    """Return the lowest number of the requirement's findings, or 0; a vendor should look at number 1 first."""
    return min((failure.get("number", 0) for failure in requirement["failures"]), default=0)
