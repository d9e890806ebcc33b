"""The rules that turn evidence into verdicts; a baseline may change the verdicts afterwards.

A failed MUST is a fail, a failed SHOULD a warning, a failed MAY information. Not tested outranks pass: a class with an
untested MUST, or without any judged case, is inconclusive.
"""

from collections.abc import Container, Iterable, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from types import MappingProxyType

from conformance.contract.classes import Level, Prerequisite
from conformance.contract.ledger import Requirement
from conformance.verdict.evidence import Evidence
from conformance.verdict.finding import Finding

# Why there is no verdict on what a robot does by itself, or does not.
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
    """What observed a class: the web services alone, or ROS too."""

    BLACK_BOX = "black box"  # through its web services alone
    ON_ROS = "seen on ROS"  # by a probe as well


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

    if requirement.class_ not in claims:
        return verdict(Value.NOT_CLAIMED, f"class {requirement.class_} is not claimed")
    if evidence.unclaimed and not evidence.cases:
        return verdict(Value.NOT_CLAIMED, evidence.unclaimed)
    if Prerequisite.SEEN in requirement.needs and not evidence.cases and not evidence.errors:
        return verdict(Value.SKIP, NOT_SEEN)
    if evidence.findings:
        first = next(iter(evidence.findings.values()))
        more = f" (and {len(evidence.findings) - 1} more)" if len(evidence.findings) > 1 else ""
        reason = f"{first.text}{more}"
        value = {Level.MUST: Value.FAIL, Level.SHOULD: Value.WARN}.get(requirement.level)
        return verdict(value, reason) if value else verdict(Value.PASS, f"The requirement is optional. {reason}")
    because = evidence.because
    for value, reasons in (
        (Value.SKIP, [requirement.untestable] if requirement.untestable else []),
        (Value.ERROR, evidence.errors),
        (Value.SKIP, [f"Not tested, because of finding {because.number}: {because.brief}"] if because else []),
        (Value.SKIP, [undeclared[need] for need in requirement.needs if need in undeclared]),
        (Value.SKIP, evidence.skips),
        (Value.SKIP, [] if evidence.cases else evidence.notes or ["nothing was executed for it"]),
    ):
        if reasons:
            return verdict(value, "; ".join(reasons))
    return verdict(Value.PASS, "; ".join(evidence.notes))


def score(verdicts: Iterable[Verdict], requirements: Container[str], name: str) -> list[Verdict]:
    """Mark requirements outside a frozen set as not counting: their failures become warnings."""
    return [
        verdict if verdict.requirement.id in requirements else _unscored(verdict, f"newer than {name}, and not scored")
        for verdict in verdicts
    ]


def _unscored(verdict: Verdict, told: str) -> Verdict:
    value = {Value.FAIL: Value.WARN, Value.ERROR: Value.SKIP}.get(verdict.value, verdict.value)
    return replace(verdict, value=value, reason=": ".join(filter(None, (told, verdict.reason))), scored=False)


def class_verdicts(verdicts: Iterable[Verdict], claims: Iterable[str]) -> dict[str, tuple[ClassValue, str]]:
    """Return verdict and reason of each class that has requirements: pass, fail, inconclusive or not-claimed."""
    by_class: dict[str, list[Verdict]] = {}
    for verdict in verdicts:
        by_class.setdefault(verdict.requirement.class_, []).append(verdict)
    return {name: _class_verdict(items, name in claims) for name, items in by_class.items()}


def _class_verdict(verdicts: list[Verdict], claimed: bool) -> tuple[ClassValue, str]:  # noqa: FBT001 - private
    verdicts = [item for item in verdicts if item.scored]
    if not claimed or not verdicts:
        return ClassValue.NOT_CLAIMED, ""
    failed = [item for item in verdicts if item.value is Value.FAIL]
    if failed:
        told = f"{len(failed)} of {len(verdicts)} requirements failed, first {failed[0].requirement.id}"
        return ClassValue.FAIL, told
    unjudged = [
        item
        for item in verdicts
        if (item.value is Value.ERROR and item.requirement.level is not Level.MAY)
        or (item.value is Value.SKIP and _holds_back(item.requirement))
    ]
    if unjudged:
        first = unjudged[0]
        told = f"{len(unjudged)} of {len(verdicts)} requirements could not be judged, first {first.requirement.id}"
        return ClassValue.INCONCLUSIVE, f"{told}: {first.reason}"
    if not any(item.evidence.cases for item in verdicts):
        return ClassValue.INCONCLUSIVE, "nothing was executed"
    return ClassValue.PASS, ""


def views(verdicts: Iterable[Verdict]) -> dict[str, View]:
    """Return what observed each claimed class that a ROS probe could judge further."""
    seen: dict[str, View] = {}
    for verdict in verdicts:
        if verdict.value is Value.NOT_CLAIMED or Prerequisite.PROBE not in verdict.requirement.needs:
            continue
        on_ros = verdict.evidence.cases > 0 and seen.get(verdict.requirement.class_) is not View.BLACK_BOX
        seen[verdict.requirement.class_] = View.ON_ROS if on_ros else View.BLACK_BOX
    return seen


def _holds_back(requirement: Requirement) -> bool:
    """Return whether a class is inconclusive until this requirement is judged.

    Requirements that only a ROS probe can judge, or that depend on something that did not occur, do not hold back.
    """
    return (
        requirement.level is Level.MUST
        and requirement.untestable is None
        and not {Prerequisite.PROBE, Prerequisite.SEEN}.intersection(requirement.needs)
    )


def overall(classes: Mapping[str, tuple[ClassValue, str]]) -> Overall:
    """Return the verdict on the robot: conformant, not-conformant or inconclusive."""
    values = {value for value, _ in classes.values()} - {ClassValue.NOT_CLAIMED}
    if ClassValue.FAIL in values:
        return Overall.NOT_CONFORMANT
    if ClassValue.INCONCLUSIVE in values or not values:
        return Overall.INCONCLUSIVE
    return Overall.CONFORMANT
