"""What a registry may still say of each robot: of its certificates the latest counts, where the policy lets it."""

import datetime as dt
import re
from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import msgspec

from reports.attestation.policy import Known, Point, Policy, judge
from reports.attestation.statement import passed, sha256
from reports.registry.entries import Certificate

SUPERSEDED = "superseded"
UNNAMED = "names no robot"
# The points of a policy that keep a certificate from counting, and how the site calls that. The others ask about whole
# runs (verdicts, classes: a registry answers class by class) or about one request (nonce).
_WORDS = {
    "max_age_days": "expired",
    "requirement_sets": "another requirement set",
    "suites": "an unknown suite",
    "efforts": "too little effort",
    "motion": "was not allowed to move",
    "baseline": "with accepted failures",
    "interrupted": "a part of a run",
    "ros": "seen as a black box",
    "robot": "another robot",
    "vendor": "another vendor",
    "firmware": "another firmware",
}
_LONG_AGO = dt.datetime.min.replace(tzinfo=dt.UTC)


@dataclass(frozen=True)
class Standing:
    """A certificate, and whether it counts.

    Attributes:
        against: why it does not, in a word or two each; empty: it counts.
        details: what was found, for each point of the policy that it does not meet.
        until: when it expires, or None where its time cannot be read.
    """

    certificate: Certificate
    against: tuple[str, ...]
    details: tuple[str, ...]
    until: dt.datetime | None

    @property
    def stands(self) -> bool:
        """Whether anything of it may be green."""
        return not self.against

    @property
    def trusted(self) -> list[str]:
        """The classes that it gives."""
        return passed(self.certificate.run) if self.stands else []


@dataclass(frozen=True)
class History:
    """One robot's certificates, the latest first."""

    standings: tuple[Standing, ...]

    @property
    def current(self) -> Standing:
        """The one that counts, if any does."""
        return self.standings[0]

    @property
    def name(self) -> str:
        """The robot's name."""
        return self.current.certificate.run.robot.name or "Unnamed robot"

    @property
    def vendor(self) -> str:
        """Whose it is, or empty."""
        return self.current.certificate.run.robot.vendor or ""

    @property
    def page(self) -> str:
        """File name of its page: letters of its name for the reader, and a digest so that no two robots share one."""
        letters = re.sub(r"[^a-z0-9]+", "-", self.name.lower()).strip("-")[:40].rstrip("-")
        robot = self.current.certificate.run.robot
        digest = sha256(msgspec.json.encode((robot.vendor or "", robot.name or "")))[:12]
        return f"{letters or 'robot'}-{digest}.html"

    @property
    def firmwares(self) -> tuple[Certificate, ...]:
        """The latest certificate of each firmware, the latest first."""
        latest: dict[str | None, Certificate] = {}
        for standing in self.standings:
            latest.setdefault(standing.certificate.run.robot.version, standing.certificate)
        return tuple(latest.values())


def histories(certificates: Iterable[Certificate], policy: Policy, known: Known, now: dt.datetime) -> list[History]:
    """Each robot, by name and vendor, in the order of names.

    A later certificate supersedes an earlier one whichever of the registry's keys signed it, also where it says less or
    nothing good: what was true before the last look is not known to be true.
    """
    by_robot: dict[tuple[str, str], list[Certificate]] = defaultdict(list)
    for certificate in certificates:
        robot = certificate.run.robot
        by_robot[robot.name or "", robot.vendor or ""].append(certificate)
    found = []
    for _, group in sorted(by_robot.items()):
        latest_first = sorted(group, key=lambda one: (one.run.ended or _LONG_AGO, one.digest), reverse=True)
        found.append(
            History(tuple(_standing(one, policy, known, now, first=not at) for at, one in enumerate(latest_first)))
        )
    return found


def _standing(certificate: Certificate, policy: Policy, known: Known, now: dt.datetime, *, first: bool) -> Standing:
    unmet = [point for point in judge(certificate.statement, policy, known, now) if not point.met]
    counted = [point for point in unmet if point.name in _WORDS]
    return Standing(
        certificate,
        (*_own(certificate, first=first), *(_word(point, certificate, now) for point in counted)),
        tuple(point.found for point in counted),
        _after(certificate.run.ended, policy.max_age_days),
    )


def _word(point: Point, certificate: Certificate, now: dt.datetime) -> str:
    ended = certificate.run.ended
    if point.name != "max_age_days" or (ended is not None and ended <= now):
        return _WORDS[point.name]
    return "not dated in UTC" if ended is None else "dated in the future"


def _own(certificate: Certificate, *, first: bool) -> Iterator[str]:
    if not first:
        yield SUPERSEDED
    if not certificate.run.robot.name:
        yield UNNAMED


def _after(finished: dt.datetime | None, days: float) -> dt.datetime | None:
    """The end of a certificate's life; None where the calendar has no such day."""
    try:
        return finished + dt.timedelta(days=days) if finished else None
    except OverflowError:
        return None
