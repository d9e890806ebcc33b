"""Read and verify the envelopes for a registry site: accept those that a trusted key signed, and refuse the others.

Nothing from a refused envelope is shown. The site identifies its file by digest and gives a reason in its own words.
The person who builds the site sees the details.

A certificate counts if it meets the registry's policy. Changes are found by the rules of `roaas diff`.
"""

import datetime as dt
import os
import re
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import msgspec
from securesystemslib.signer import SSlibKey

from reports.attestation.envelope import ENVELOPE_NAME, open_envelope, read_envelope
from reports.attestation.keys import public_key
from reports.attestation.policy import Known, Policy
from reports.attestation.statement import Run, Statement, passed_classes, sha256
from reports.attestation.verifying import SKEW, Point, judge, unseal
from reports.certificate.difference import Difference, difference
from reports.errors import EnvelopeRefusedError, KeyUnusableError, ReportError, ResultMissingError
from reports.given_files import read_octets

_PRIVATE = b"PRIVATE KEY-----"
_MOST_KEY = 1 << 20


@dataclass(frozen=True)
class Certificate:
    """An envelope whose signature was verified by one of the registry's trusted keys.

    Attributes:
        octets: content of the envelope's file.
        statement: the signed statement.
        key: fingerprint of the signing key.
        publishable: False if the signed content has fields that this version does not know, which might be addresses.
    """

    octets: bytes
    statement: Statement
    key: str
    publishable: bool

    @property
    def run(self) -> Run:
        """Return the facts about the conformance run from the signed statement."""
        return self.statement.predicate.roaas

    @property
    def digest(self) -> str:
        """Return the SHA-256 of the envelope's file, in hexadecimal."""
        return sha256(self.octets)


@dataclass(frozen=True)
class Refused:
    """An envelope that was refused, for example because no trusted key signed it.

    Attributes:
        digest: SHA-256 of its file, in hexadecimal; empty if the file cannot be read.
        reason: for the site; it contains nothing from the envelope.
        detail: for the person who builds the site: the file's path, and what is wrong with the file.
    """

    digest: str
    reason: str
    detail: str


def read_keys(directory: Path) -> tuple[dict[str, SSlibKey], list[str]]:
    """Return the public keys of a folder (*.pem) by fingerprint, and a sentence on each file that cannot be used.

    Raises:
        KeyUnusableError: the folder holds no public key.
    """
    keys: dict[str, SSlibKey] = {}
    unusable: list[str] = []
    for path in sorted(directory.glob("*.pem")):
        try:
            if _PRIVATE in read_octets(path, _MOST_KEY):
                unusable.append(f"{path} is a private key. It was not used; keep it somewhere else.")
                continue
            key = public_key(path)
        except ReportError as error:
            unusable.append(f"{error.message}. It was not used, so nothing that it signed is accepted.")
            continue
        keys[key.keyid] = key
    if not keys:
        said = f"{directory}: it holds no public key (*.pem) of a signer whom you trust"
        raise KeyUnusableError("; ".join([said, *unusable]))
    return keys, unusable


def read_entries(places: Iterable[Path], keys: Mapping[str, SSlibKey]) -> list[Certificate | Refused]:
    """Read the envelopes of files and folders and verify each by the trusted keys; identical files count once.

    What others put there stops nothing: a file that cannot be read is refused as one that does not verify.

    Raises:
        ResultMissingError: a file or folder does not exist, or there is no certificate at all.
    """
    paths: dict[Path, Path | None] = {}
    found: list[Certificate | Refused] = []
    for place in places:
        if not os.path.lexists(place):
            raise ResultMissingError(f"{place}: no such file")
        root = place if place.is_dir() else None
        inside = [place] if root is None else sorted(_named_like_envelopes(root))
        paths |= dict.fromkeys(inside, root)
        if not inside:
            found.append(Refused("", "the folder has no certificate", f"{place}: it holds no {ENVELOPE_NAME}"))
    if not paths:
        raise ResultMissingError("; ".join(refusal.detail for refusal in found if isinstance(refusal, Refused)))
    files: dict[bytes, Path] = {}
    for path, root in paths.items():
        try:
            files.setdefault(read_envelope(path, root), path)
        except ReportError as error:
            found.append(Refused("", "the file cannot be read", error.message))
    for octets, path in files.items():
        entry = entry_of(octets, keys)
        found.append(replace(entry, detail=f"{path}: {entry.detail}") if isinstance(entry, Refused) else entry)
    return found


def _named_like_envelopes(root: Path) -> Iterator[Path]:
    """Yield each path in a folder that has a certificate's name; also dangling links, which `rglob` leaves out."""
    for folder, folders, files in os.walk(root):
        if ENVELOPE_NAME in (*folders, *files):
            yield Path(folder) / ENVELOPE_NAME


def entry_of(octets: bytes, keys: Mapping[str, SSlibKey]) -> Certificate | Refused:
    """Verify the content of one envelope file by the trusted keys; return the certificate or the refusal."""
    reason = "it is not an envelope with one signature"
    try:
        opened = open_envelope(octets)
        reason = "it is signed by a key that this registry does not trust"
        if opened.keyid not in keys:
            raise EnvelopeRefusedError(f"foreign key: {opened.keyid[:64]!r}")  # noqa: TRY301 - refused as all others are
        reason = "its signature does not verify with the key that it names, or it is not a certificate of a run"
        statement = unseal(octets, keys[opened.keyid])
    except EnvelopeRefusedError as error:
        return Refused(sha256(octets), reason, str(error))
    return Certificate(octets, statement, opened.keyid, msgspec.json.encode(statement) == opened.payload)


SUPERSEDED = "superseded"
UNNAMED = "names no robot"
# Points of a policy that keep a certificate from counting, with the site's words. The other points concern the whole
# run (verdicts, classes), while a registry answers class by class, or a single request (nonce).
_WORDS = {
    "max_age_days": "expired",
    "requirement_sets": "judged by another set of requirements",
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
