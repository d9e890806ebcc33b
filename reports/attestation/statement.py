"""The signed statement: an in-toto Statement v1 whose predicate is a Simple Verification Result (SVR) v0.2.

SVR lists verified properties: the classes that passed without an accepted failure. in-toto's test-result predicate was
not used, because it has only PASSED, WARNED and FAILED for a whole run. Everything else that a policy checks is in the
predicate's extension field `roaas`; consumers ignore fields that they do not know (in-toto attestation, parsing rules).
"""

import datetime as dt
import hashlib
from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Any

import msgspec

PAYLOAD_TYPE = "application/vnd.in-toto+json"
STATEMENT_TYPE = "https://in-toto.io/Statement/v1"
PREDICATE_TYPE = "https://in-toto.io/attestation/svr/v0.2"
PROPERTY = "ROAAS_CLASS_"
"""Prefix of a class among the verified properties."""
RESULT_SUBJECT = "result.json"
PAGE_SUBJECTS = ("certificate.html", "certificate-print.html")
STATEMENT_SUBJECT = "statement"
CONTRACT_SUBJECT = "contract/"
"""Prefix of a contract file among the subjects."""

Text = str | None


class Subject(msgspec.Struct, frozen=True):
    """An artifact, identified by its SHA-256 digest in hexadecimal; the name is for readers."""

    name: str
    digest: dict[str, str]

    @property
    def sha256(self) -> str:
        """Return the digest, or an empty string if there is none of this kind."""
        return self.digest.get("sha256", "")


class Robot(msgspec.Struct, frozen=True):
    """The robot, as the vendor's statement names it."""

    name: Text = None
    vendor: Text = None
    version: Text = None


class Suite(msgspec.Struct, frozen=True):
    """The suite's version, and the contract by which the suite judged."""

    version: str
    digest: str
    contract: str


class RequirementSet(msgspec.Struct, frozen=True):
    """The requirements by which the suite judged."""

    name: str
    digest: str


class Run(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """What a policy checks of a run; it holds neither addresses nor tokens.

    Attributes:
        verdict: verdict of the whole run.
        classes: verdict of each class.
        requirements: number of requirements with each verdict.
        outcomes: ids by level and verdict, so that two certificates can be compared; empty in older certificates.
        accepted: ids of the requirements whose failure the baseline accepts.
        accepted_until: last day on which the baseline accepts all failures, if it does.
        baseline: digest of the file of accepted failures, or None.
        nonce: the relying party's nonce that the run was made with, or None.
        views: for classes that depend on it, whether ROS topics were observed.
        intermittent: ids of the requirements that failed only at times.
        started: RFC 3339, UTC.
        finished: RFC 3339, UTC.
    """

    robot: Robot
    verdict: str
    interrupted: bool
    classes: dict[str, str]
    requirements: dict[str, int]
    accepted: list[str]
    accepted_until: Text
    intermittent: list[str]
    suite: Suite
    requirement_set: RequirementSet | None
    effort: str
    seed: int
    nonce: Text
    baseline: Text
    motion_allowed: bool
    views: dict[str, str]
    started: str
    finished: str
    outcomes: dict[str, dict[str, list[str]]] = {}

    @property
    def ended(self) -> dt.datetime | None:
        """Return `finished` as a time, or None if it is not a time in UTC."""
        try:
            moment = dt.datetime.fromisoformat(self.finished)
        except ValueError:
            return None
        return moment if moment.utcoffset() == dt.timedelta() else None


class Verifier(msgspec.Struct, frozen=True):
    """The suite that verified the robot; `policies` are the contract's files."""

    id: str
    policies: list[Subject]


class Predicate(msgspec.Struct, frozen=True, rename="camel"):
    """SVR v0.2 with the extension field `roaas`."""

    verifier: Verifier
    time_created: str
    properties: list[str]
    roaas: Run


class Statement(msgspec.Struct, frozen=True, rename="camel"):
    """in-toto Statement v1."""

    type: str = msgspec.field(name="_type")
    subject: list[Subject]
    predicate_type: str
    predicate: Predicate

    def digest_of(self, name: str) -> str | None:
        """Return the digest of the subject with that name, or None."""
        return next((item.sha256 for item in self.subject if item.name == name), None)


def statement_of(result: Mapping[str, Any], octets: bytes, pages: Mapping[str, str]) -> Statement:
    """Return the statement to sign.

    Args:
        result: a valid `roaas-result/1` document.
        octets: the content of its file.
        pages: the pages written from it, by file name.
    """
    digests = result.get("digests") or {}
    contract = [
        _subject(f"{CONTRACT_SUBJECT}{name}", digest) for name, digest in sorted(digests.get("contract", {}).items())
    ]
    subjects = [Subject(RESULT_SUBJECT, {"sha256": sha256(octets)})]
    subjects += [Subject(name, {"sha256": sha256(pages[name].encode())}) for name in PAGE_SUBJECTS]
    if digests.get("statement"):
        subjects.append(_subject(STATEMENT_SUBJECT, digests["statement"]))
    run = _run(result)
    verifier = Verifier(f"urn:roaas:suite:{run.suite.version}:{run.suite.digest}", contract)
    predicate = Predicate(verifier, run.finished, [PROPERTY + property_name(name) for name in passed(run)], run)
    return Statement(STATEMENT_TYPE, [*subjects, *contract], PREDICATE_TYPE, predicate)


def passed(run: Run) -> list[str]:
    """Return the classes that passed without an accepted failure."""
    accepted = {id_.partition("/")[0] for id_ in run.accepted}
    return [name for name, verdict in run.classes.items() if verdict == "pass" and name not in accepted]


def property_name(class_: str) -> str:
    """Return the property of a class: REST_RESOURCES for `rest-resources`."""
    return class_.upper().replace("-", "_")


def sha256(octets: bytes) -> str:
    """Return the SHA-256 in hexadecimal."""
    return hashlib.sha256(octets).hexdigest()


def seed_of(nonce: str) -> int:
    """Return the seed of a run with this nonce, which `roaas certify --nonce` derives in the same way."""
    return int.from_bytes(hashlib.sha256(b"roaas-nonce/1\0" + nonce.encode()).digest()[:6])


def _subject(name: str, digest: str) -> Subject:
    return Subject(name, {"sha256": digest.removeprefix("sha256:")})


def _run(result: Mapping[str, Any]) -> Run:
    requirements = result["requirements"]
    robot = result["statement"]["robot"]
    baseline = result.get("baseline") or {}
    return Run(
        robot=Robot(robot.get("name"), robot.get("vendor"), robot.get("version")),
        verdict=result["verdict"],
        interrupted=result.get("interrupted", False),
        classes=dict(result["classes"]),
        requirements=dict(Counter(item["verdict"] for item in requirements)),
        accepted=[item["id"] for item in requirements if item.get("expected_failure")],
        accepted_until=result.get("accepted_until"),
        intermittent=[item["id"] for item in requirements if item.get("intermittent")],
        suite=msgspec.convert(result["suite"], Suite),
        requirement_set=msgspec.convert(result.get("requirement_set"), RequirementSet | None),
        effort=result["effort"],
        seed=result["seed"],
        nonce=result.get("nonce"),
        baseline=baseline.get("digest"),
        motion_allowed=result["statement"]["motion_allowed"],
        views=dict(result.get("class_views", {})),
        started=result["started"],
        finished=result["finished"] or result["started"],
        outcomes=_outcomes(requirements),
    )


def _outcomes(requirements: Iterable[Mapping[str, Any]]) -> dict[str, dict[str, list[str]]]:
    found: dict[str, dict[str, list[str]]] = {}
    for item in requirements:
        found.setdefault(item["level"], {}).setdefault(item["verdict"], []).append(item["id"])
    return found
