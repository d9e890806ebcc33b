"""The rules that turn evidence into verdicts; a baseline may change the verdicts afterwards.

A failed MUST is a fail, a failed SHOULD a warning, a failed MAY information. If a right device may do what each finding
of a MUST shows, it is a warning too. Not tested outranks pass: a class with an untested MUST, or without any judged
case, is inconclusive.
"""

from collections.abc import Collection, Container, Iterable, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from types import MappingProxyType

from conformance.contract.classes import Level, Prerequisite
from conformance.contract.ledger import Requirement
from conformance.contract.pack import Contract
from conformance.verdict.evidence import Evidence
from conformance.verdict.finding import Finding, count_of
from conformance.verdict.run import Run

# Why optional behaviour that a robot did not show has no verdict.
NOT_SEEN = "it was not seen in this run, so it is not judged"


class Value(StrEnum):
    """The verdict on one requirement."""

    PASS = "pass"  # noqa: S105 - no password
    FAIL = "fail"
    WARN = "warn"
    SKIP = "skip"
    NOT_CLAIMED = "not-claimed"
    ERROR = "error"


class ClassValue(StrEnum):
    """The verdict on a conformance class."""

    PASS = "pass"  # noqa: S105 - as above
    FAIL = "fail"
    INCONCLUSIVE = "inconclusive"
    NOT_CLAIMED = "not-claimed"


class Overall(StrEnum):
    """The verdict on a robot."""

    CONFORMANT = "conformant"
    NOT_CONFORMANT = "not-conformant"
    INCONCLUSIVE = "inconclusive"


class View(StrEnum):
    """How a class was observed: by the web services alone, or by ROS too."""

    BLACK_BOX = "black box"  # observed through the web services only
    ON_ROS = "seen on ROS"  # also observed by a ROS probe


@dataclass(frozen=True)
class Verdict:
    """The verdict on one requirement, with its reason and evidence.

    Attributes:
        requirement: the requirement.
        value: the verdict.
        reason: why, unless it simply passed.
        evidence: what the run recorded.
        scored: whether it counts; requirements newer than the set that scores the run do not.
        expected_failure: reason and last day of the baseline entry that accepts the failure, or None.
    """

    requirement: Requirement
    value: Value
    reason: str
    evidence: Evidence
    expected_failure: tuple[str, str] | None = None
    scored: bool = True

    @property
    def because(self) -> Finding | None:
        """Return the finding of another requirement that prevented the test, or None."""
        return self.evidence.because if self.value in {Value.SKIP, Value.WARN} else None


def verdict_of(
    requirement: Requirement,
    evidence: Evidence,
    claims: Iterable[str],
    undeclared: Mapping[str, str] = MappingProxyType({}),
) -> Verdict:
    """Return the verdict on one requirement.

    Args:
        requirement: the requirement.
        evidence: what the run recorded.
        claims: the claimed classes.
        undeclared: why requirements are not judged whose prerequisite the statement does not declare, by prerequisite.
    """

    def verdict(value: Value, reason: str = "") -> Verdict:
        return Verdict(requirement, value, reason, evidence)

    if not requirement.binds(frozenset(claims)):
        return verdict(Value.NOT_CLAIMED, f"class {requirement.class_} is not claimed")
    if evidence.unclaimed and not evidence.cases:
        return verdict(Value.NOT_CLAIMED, evidence.unclaimed)
    unseen = [f"not seen: {text}" for text in evidence.unseen]
    optional = Prerequisite.SEEN in requirement.needs
    if evidence.is_unseen or (optional and not evidence.cases and not evidence.errors):
        return verdict(Value.SKIP, "; ".join(unseen) or NOT_SEEN)
    if evidence.findings:
        found = evidence.findings.values()
        first = next((finding for finding in found if not finding.doubt), next(iter(found)))
        more = f" (and {len(evidence.findings) - 1} more)" if len(evidence.findings) > 1 else ""
        reason = f"{first.text}{more}"
        value = {Level.MUST: Value.WARN if first.doubt else Value.FAIL, Level.SHOULD: Value.WARN}.get(requirement.level)
        return verdict(value, reason) if value else verdict(Value.PASS, f"The requirement is optional. {reason}")
    because = evidence.because
    parts = evidence.parts.items()
    for value, reasons in (
        (Value.SKIP, [requirement.untestable] if requirement.untestable else []),
        (Value.ERROR, evidence.errors),
        (Value.SKIP, [f"Not tested, because of finding {because.number}: {because.brief}"] if because else []),
        (Value.SKIP, [undeclared[need] for need in requirement.needs if need in undeclared]),
        (Value.SKIP, evidence.skips),
        (Value.SKIP, [] if evidence.cases else evidence.notes or ["nothing was executed for it"]),
        (Value.SKIP, [f"nothing was executed for {part}, a part of it" for part, cases in parts if not cases]),
    ):
        if reasons:
            return verdict(value, "; ".join(reasons))
    return verdict(Value.PASS, "; ".join((*evidence.notes, *unseen)))


def score(verdicts: Iterable[Verdict], requirements: Container[str], name: str) -> list[Verdict]:
    """Mark requirements outside a frozen set as not counting: their failures become warnings."""
    return [
        verdict if verdict.requirement.id in requirements else _unscore(verdict, f"newer than {name}, and not scored")
        for verdict in verdicts
    ]


def _unscore(verdict: Verdict, told: str) -> Verdict:
    value = {Value.FAIL: Value.WARN, Value.ERROR: Value.SKIP}.get(verdict.value, verdict.value)
    return replace(verdict, value=value, reason=": ".join(filter(None, (told, verdict.reason))), scored=False)


def class_verdicts(verdicts: Iterable[Verdict], claims: Iterable[str]) -> dict[str, tuple[ClassValue, str]]:
    """Return verdict and reason of each class that has requirements: pass, fail, inconclusive or not-claimed."""
    by_class: dict[str, list[Verdict]] = {}
    for verdict in verdicts:
        for name in verdict.requirement.classes:
            by_class.setdefault(name, []).append(verdict)
    return {name: _class_verdict(items, name in claims) for name, items in by_class.items()}


def withheld(classes: Mapping[str, tuple[ClassValue, str]], reason: str) -> dict[str, tuple[ClassValue, str]]:
    """Return class verdicts in which no class passes, for this reason; an empty reason changes nothing."""
    passes = {ClassValue.PASS, ClassValue.INCONCLUSIVE} if reason else set()
    return {name: (ClassValue.INCONCLUSIVE, reason) if one[0] in passes else one for name, one in classes.items()}


def _class_verdict(verdicts: list[Verdict], claimed: bool) -> tuple[ClassValue, str]:  # noqa: FBT001 - private
    verdicts = [item for item in verdicts if item.scored]
    if not claimed or not verdicts:
        return ClassValue.NOT_CLAIMED, ""
    failed = [item for item in verdicts if item.value is Value.FAIL]
    if failed:
        told = f"{len(failed)} of {count_of(len(verdicts), 'requirement')} failed, first {failed[0].requirement.id}"
        return ClassValue.FAIL, told
    unjudged = [
        item
        for item in verdicts
        if (item.value is Value.ERROR and item.requirement.level is not Level.MAY) or is_unjudged(item)
    ]
    if unjudged:
        first = unjudged[0]
        all_ = count_of(len(verdicts), "requirement")
        told = f"{len(unjudged)} of {all_} could not be judged, first {first.requirement.id}"
        return ClassValue.INCONCLUSIVE, f"{told}: {first.reason}"
    if not any(item.evidence.cases for item in verdicts):
        return ClassValue.INCONCLUSIVE, "nothing was executed"
    return ClassValue.PASS, ""


def views(verdicts: Iterable[Verdict], acting: Container[str] = ()) -> dict[str, View]:
    """Return how each class was observed that a ROS probe could judge further.

    Args:
        verdicts: verdicts of the run.
        acting: classes whose requests have effects on ROS that requirements of another class are about: they were seen
            there if what needs an observer was judged in a run with a probe.
    """
    verdicts = [one for one in verdicts if one.value is not Value.NOT_CLAIMED]
    seen: dict[str, View] = {}
    for verdict in verdicts:
        for name in verdict.requirement.classes if Prerequisite.PROBE in verdict.requirement.needs else ():
            on_ros = verdict.evidence.cases > 0 and seen.get(name) is not View.BLACK_BOX
            seen[name] = View.ON_ROS if on_ros else View.BLACK_BOX
    watched = View.ON_ROS in seen.values() and any(
        Prerequisite.OBSERVER in one.requirement.needs and one.evidence.cases for one in verdicts
    )
    others = {name for one in verdicts for name in one.requirement.classes if name in acting}
    return dict.fromkeys(sorted(others), View.ON_ROS if watched else View.BLACK_BOX) | seen


def is_unjudged(verdict: Verdict) -> bool:
    """Return whether a requirement was not judged, and its class is inconclusive without it."""
    return verdict.value is Value.SKIP and not verdict.evidence.is_unseen and holds_back(verdict.requirement)


def holds_back(requirement: Requirement) -> bool:
    """Return whether a class is inconclusive until this requirement is judged.

    Requirements that only a ROS probe can judge, or that depend on something that did not occur, do not hold back.
    """
    return (
        requirement.level is Level.MUST
        and requirement.untestable is None
        and not {Prerequisite.PROBE, Prerequisite.SEEN}.intersection(requirement.needs)
    )


def overall(classes: Mapping[str, tuple[ClassValue, str]], *, enough: bool = True) -> Overall:
    """Return the verdict on the robot: conformant, not-conformant or inconclusive.

    Args:
        classes: verdict and reason of each class.
        enough: whether so many cases were tried that a robot can be conformant by them.
    """
    values = {value for value, _ in classes.values()} - {ClassValue.NOT_CLAIMED}
    if ClassValue.FAIL in values:
        return Overall.NOT_CONFORMANT
    if ClassValue.INCONCLUSIVE in values or not values or not enough:
        return Overall.INCONCLUSIVE
    return Overall.CONFORMANT


_WORDS = {
    Overall.CONFORMANT: "conformant to",
    Overall.NOT_CONFORMANT: "not conformant to",
    Overall.INCONCLUSIVE: "inconclusive for",
}
# Verdicts on a device that is judged by its description alone, and so conforms to no contract.
_OF_DESCRIPTION = {
    Overall.CONFORMANT: "keeps its own description",
    Overall.NOT_CONFORMANT: "does not keep its own description",
    Overall.INCONCLUSIVE: "inconclusive",
}


def claims_text(contract: Contract, claims: Collection[str]) -> str:
    """Return the claimed classes in words: a profile's name, or the classes' names and "only"."""
    profile = next((name for name, classes in contract.profiles.items() if set(classes) == set(claims)), "")
    return profile or f"{', '.join(claims) or 'nothing'} only"


def view_of(verdicts: Iterable[Verdict]) -> View:
    """Return how the robot was seen: on ROS if a probe observed every class that it could observe."""
    found = set(views(verdicts).values())
    return View.ON_ROS if found == {View.ON_ROS} else View.BLACK_BOX


def verdict_line(run: Run, value: Overall, verdicts: Iterable[Verdict]) -> str:
    """Return the verdict in a line, such as "conformant to full (contract 1.2), seen on ROS"."""
    if run.stop_undelivered and value is Overall.INCONCLUSIVE:
        return f"inconclusive: {run.stop_undelivered}"
    if run.refused and value is Overall.INCONCLUSIVE:
        return "inconclusive, because the device refused the credentials"
    if run.unshown and value is Overall.INCONCLUSIVE:
        return f"inconclusive, because {run.unshown}"
    if not run.contract.is_claimed:
        said = _OF_DESCRIPTION[value]
        said = f"{said}, as far as --minutes {run.limit.minutes:g} allowed" if run.limit.is_struck else said
        return f"{said}, {run.less}" if run.less else said
    contract = f" (contract {run.contract.label})" if run.contract.label else ""
    said = f"{_WORDS[value]} {claims_text(run.contract, run.claims)}{contract}, {view_of(verdicts)}"
    return f"{said}, {run.less}" if run.less else said
