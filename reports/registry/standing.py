"""Decide for each robot whether its latest certificate counts, and what changed since the firmware before.

A certificate counts if it meets the registry's policy. Changes are found by the rules of `roaas diff`.
"""

import datetime as dt
import re
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import msgspec

from reports.attestation.judging import SKEW, Point, judge
from reports.attestation.policy import Known, Policy
from reports.attestation.statement import Run, passed_classes, sha256
from reports.certificate.difference import Difference, difference
from reports.registry.entries import Certificate

SUPERSEDED = "superseded"
UNNAMED = "names no robot"
# Points of a policy that keep a certificate from counting, with the site's words. The other points concern the whole
# run (verdicts, classes), while a registry answers class by class, or a single request (nonce).
_WORDS = {
    "max_age_days": "expired",
    "requirement_sets": "another requirement set",
    "suites": "an unknown suite",
    "contract": "another contract",
    "requirements": "not the requirements of the suite",
    "extent": "signed by a former version",
    "cases": "too few cases",
    "operations": "too few operations",
    "left_out": "cut short by --minutes",
    "suite_errors": "errors of the suite",
    "statement": "another statement",
    "efforts": "too little effort",
    "motion": "was not allowed to move",
    "baseline": "with accepted failures",
    "interrupted": "an incomplete run",
    "ros": "ROS topics not observed",
    "robot": "another robot",
    "vendor": "another vendor",
    "firmware": "another firmware",
}
_LONG_AGO = dt.datetime.min.replace(tzinfo=dt.UTC)


@dataclass(frozen=True)
class Standing:
    """A certificate, and whether it counts on the registry site.

    Attributes:
        against: reasons why the certificate does not count, a few words each; empty if it counts.
        details: each policy check that the certificate fails, with what the certificate contains.
        until: when the certificate expires, or None if its time cannot be read.
    """

    certificate: Certificate
    against: tuple[str, ...]
    details: tuple[str, ...]
    until: dt.datetime | None

    @property
    def stands(self) -> bool:
        """Return whether the certificate counts."""
        return not self.against

    @property
    def trusted(self) -> list[str]:
        """Return the classes that passed without an accepted failure; empty if the certificate does not count."""
        return passed_classes(self.certificate.run) if self.stands else []


@dataclass(frozen=True)
class History:
    """All certificates of one robot, the latest first."""

    standings: tuple[Standing, ...]

    @property
    def current(self) -> Standing:
        """Return the latest certificate, the only one that may count."""
        return self.standings[0]

    @property
    def name(self) -> str:
        """Return the robot's name, or "Unnamed robot"."""
        return self.current.certificate.run.robot.name or "Unnamed robot"

    @property
    def vendor(self) -> str:
        """Return the robot's vendor, or an empty string."""
        return self.current.certificate.run.robot.vendor or ""

    @property
    def page(self) -> str:
        """Return the file name of the robot's page: the robot's name, and a digest that makes the file name unique."""
        letters = re.sub(r"[^a-z0-9]+", "-", self.name.lower()).strip("-")[:40].rstrip("-")
        robot = self.current.certificate.run.robot
        digest = sha256(msgspec.json.encode((robot.vendor or "", robot.name or "")))[:12]
        return f"{letters or 'robot'}-{digest}.html"

    @property
    def firmwares(self) -> tuple[Certificate, ...]:
        """Return the latest certificate of each firmware version, the latest first."""
        latest: dict[str | None, Certificate] = {}
        for standing in self.standings:
            latest.setdefault(standing.certificate.run.robot.version, standing.certificate)
        return tuple(latest.values())


def histories(
    certificates: Iterable[Certificate], judged_by: Callable[[str], tuple[Policy, Known]], now: dt.datetime
) -> list[History]:
    """Group certificates by robot (name and vendor), judge each by its policy, and return the robots sorted by name.

    A later certificate always supersedes an earlier one, whichever trusted key signed it and whatever its verdict: an
    older result may no longer hold. Only a certificate that is dated in the future supersedes none.
    """
    by_robot: dict[tuple[str, str], list[Certificate]] = defaultdict(list)
    for certificate in certificates:
        robot = certificate.run.robot
        by_robot[robot.name or "", robot.vendor or ""].append(certificate)
    found = []
    for (name, _), group in sorted(by_robot.items()):
        judged = judged_by(name)
        latest_first = sorted(group, key=lambda one: (_past(one.run.ended_at, now), one.digest), reverse=True)
        found.append(History(tuple(_standing(one, *judged, now, first=not at) for at, one in enumerate(latest_first))))
    return found


def _past(ended: dt.datetime | None, now: dt.datetime) -> dt.datetime:
    """Return when a run ended; long ago if that is not known or in the future, so that it supersedes nothing."""
    return ended if ended is not None and ended <= now + SKEW else _LONG_AGO


def _standing(certificate: Certificate, policy: Policy, known: Known, now: dt.datetime, *, first: bool) -> Standing:
    unmet = [point for point in judge(certificate.statement, policy, known, now) if not point.met]
    counted = [point for point in unmet if point.name in _WORDS]
    return Standing(
        certificate,
        (*_own(certificate, first=first), *(_word(point, certificate, now) for point in counted)),
        tuple(f"{_word(point, certificate, now)}: {point.found}" for point in counted),
        _after(certificate.run.ended_at, policy.max_age_days),
    )


def _word(point: Point, certificate: Certificate, now: dt.datetime) -> str:
    ended = certificate.run.ended_at
    if point.name != "max_age_days" or (ended is not None and ended <= now):
        return _WORDS[point.name]
    return "not dated in UTC" if ended is None else "dated in the future"


def _own(certificate: Certificate, *, first: bool) -> Iterator[str]:
    if not first:
        yield SUPERSEDED
    if not certificate.run.robot.name:
        yield UNNAMED


def _after(finished: dt.datetime | None, days: float) -> dt.datetime | None:
    """Return the time `days` after `finished`, when a certificate expires; None if the calendar has no such day."""
    try:
        return finished + dt.timedelta(days=days) if finished else None
    except OverflowError:
        return None


@dataclass(frozen=True)
class FirmwareChange:
    """The comparison of the certificates of two successive firmware versions of one robot.

    Attributes:
        old: certificate of the older firmware.
        new: certificate of the newer firmware.
        found: the changed requirements, or None if one certificate is too old to list its requirements.
    """

    old: Certificate
    new: Certificate
    found: Difference | None

    @property
    def classes(self) -> list[tuple[str, str, str]]:
        """Return the conformance classes whose verdict changed, as (name, verdict before, verdict after)."""
        before, after = self.old.run.classes, self.new.run.classes
        names = dict.fromkeys((*before, *after))
        courses = ((name, before.get(name, "not-claimed"), after.get(name, "not-claimed")) for name in names)
        return [course for course in courses if course[1] != course[2]]


def firmware_changes(latest_first: tuple[Certificate, ...]) -> list[FirmwareChange]:
    """Return the changes between successive firmware versions, the latest first.

    The argument holds one certificate for each firmware, the latest first.
    """
    return [FirmwareChange(old, new, _difference(old.run, new.run)) for new, old in pairwise(latest_first)]


def _difference(old: Run, new: Run) -> Difference | None:
    return difference(_as_result(old), _as_result(new)) if old.outcomes and new.outcomes else None


def _as_result(run: Run) -> Mapping[str, Any]:
    """Return the certificate's facts as a partial `roaas-result/1` document that `difference` can compare."""
    accepted = set(run.accepted)
    return {
        "requirements": [
            {
                "id": id_,
                "level": level,
                "text": "",
                "verdict": verdict,
                "reason": "",
                **({"expected_failure": {}} if id_ in accepted else {}),
            }
            for level, verdicts in run.outcomes.items()
            for verdict, ids in verdicts.items()
            for id_ in ids
        ],
        "statement": {"robot": msgspec.to_builtins(run.robot), "motion_allowed": run.motion_allowed},
        "target": {},
        "suite": msgspec.to_builtins(run.suite),
        "requirement_set": msgspec.to_builtins(run.requirement_set),
        "effort": run.effort,
        "seed": run.seed,
        "baseline": {"digest": run.baseline},
        "verdict": run.verdict,
    }
