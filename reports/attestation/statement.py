"""Build the statement to sign: an in-toto Statement v1 with a Simple Verification Result (SVR) v0.2 as predicate.

SVR lists verified properties: here, the conformance classes that passed without an accepted failure. in-toto's
test-result predicate was not used, because it has only PASSED, WARNED and FAILED for a whole run. Everything else that
a policy checks is in the predicate's extension field `roaas`; consumers ignore fields that they do not know (in-toto
attestation, parsing rules).
"""

import datetime as dt
import hashlib
from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Annotated, Any

import msgspec

PAYLOAD_TYPE = "application/vnd.in-toto+json"
STATEMENT_TYPE = "https://in-toto.io/Statement/v1"
PREDICATE_TYPE = "https://in-toto.io/attestation/svr/v0.2"
PROPERTY = "ROAAS_CLASS_"
"""Prefix of a class among the verified properties."""
RESULT_SUBJECT = "result.json"
STATEMENT_SUBJECT = "statement"
CONTRACT_SUBJECT = "contract/"
"""Prefix of a contract file among the subjects."""

_MOST_CLASSES = 200
"""A registry has a column for each class that a certificate names."""

Text = str | None


class Subject(msgspec.Struct, frozen=True):
    """A signed file, identified by its SHA-256 digest in hexadecimal.

    The name is for readers; `digest` maps the hash algorithm's name to the digest.
    """

    name: str
    digest: dict[str, str]

    @property
    def sha256(self) -> str:
        """Return the SHA-256 digest in hexadecimal, or an empty string if only other digests are given."""
        return self.digest.get("sha256", "")


class Robot(msgspec.Struct, frozen=True):
    """The robot's name, vendor and firmware version, as the vendor's statement gives them."""

    name: Text = None
    vendor: Text = None
    version: Text = None


class Suite(msgspec.Struct, frozen=True):
    """The test suite's version and digest, and the version of the contract that the robot was judged by."""

    version: str
    digest: str
    contract: str


class RequirementSet(msgspec.Struct, frozen=True):
    """The name and digest of the set of requirements that the robot was judged by."""

    name: str
    digest: str


class Extent(msgspec.Struct, frozen=True, kw_only=True):
    """How much a run tested.

    Attributes:
        claims: the conformance classes that were claimed.
        cases: share of the cases that were tried, of those that a fast robot gets at this effort, 0 to 1.
        requests: number of HTTP requests.
        operations: how many operations of the device's own description were called, and how many it has; None for a
            device that was judged by a contract pack.
        left_out: the minutes of --minutes if they ended the run before everything was tried, or None.
        suite_errors: ids of the requirements that could not be judged because of an error in the suite.
    """

    claims: list[str]
    cases: float
    requests: int
    operations: tuple[int, int] | None
    left_out: float | None
    suite_errors: list[str]


class Run(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """The facts about a conformance run that a policy checks, without addresses or tokens.

    Attributes:
        verdict: verdict of the whole run.
        classes: verdict of each conformance class, by the class's name.
        requirements: number of requirements with each verdict.
        outcomes: ids of requirements by level and verdict, so that two certificates can be compared; empty in older
            certificates.
        extent: how much the run tested; None in older certificates.
        accepted: ids of the requirements whose failure the baseline file accepts.
        accepted_until: last day on which the baseline file accepts the failures, or None.
        baseline: digest of the file of accepted failures, or None.
        nonce: the recipient's nonce that the run was made with, or None.
        views: for each class that uses ROS topics, whether the suite observed them.
        intermittent: ids of the requirements that failed in some attempts and passed in others.
        started: RFC 3339, UTC.
        finished: RFC 3339, UTC.
    """

    robot: Robot
    verdict: str
    interrupted: bool
    classes: Annotated[dict[str, str], msgspec.Meta(max_length=_MOST_CLASSES)]
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
    extent: Extent | None = None

    @property
    def described(self) -> bool:
        """Return whether the device was judged by its own description."""
        return "description" in self.classes if self.extent is None else self.extent.operations is not None

    @property
    def ended_at(self) -> dt.datetime | None:
        """Return `finished` as a datetime, or None if the text is not a time in UTC."""
        try:
            moment = dt.datetime.fromisoformat(self.finished)
        except ValueError:
            return None
        return moment if moment.utcoffset() == dt.timedelta() else None


class Verifier(msgspec.Struct, frozen=True):
    """The suite that tested the robot, by its URN, and the files of the contract pack (`policies` in SVR)."""

    id: str
    policies: list[Subject]


class Predicate(msgspec.Struct, frozen=True, rename="camel"):
    """The predicate of the statement: SVR v0.2 with the extension field `roaas` for the run's facts."""

    verifier: Verifier
    time_created: str
    properties: list[str]
    roaas: Run


class Statement(msgspec.Struct, frozen=True, rename="camel"):
    """An in-toto Statement v1: the signed files (`subject`) and the predicate about the run."""

    type: str = msgspec.field(name="_type")
    subject: list[Subject]
    predicate_type: str
    predicate: Predicate

    def digest_of(self, name: str) -> str | None:
        """Return the SHA-256 digest of the signed file with that name, or None if no such file is listed."""
        return next((item.sha256 for item in self.subject if item.name == name), None)


def statement_of(result: Mapping[str, Any], octets: bytes, files: Mapping[str, str]) -> Statement:
    """Return the in-toto statement to sign for a result file and the files that belong to it.

    Args:
        result: a valid `roaas-result/1` document.
        octets: the content of the document's file.
        files: SHA-256 in hexadecimal of each file beside it, by its path in the folder.
    """
    digests = result.get("digests") or {}
    contract = [
        _subject(f"{CONTRACT_SUBJECT}{name}", digest) for name, digest in sorted(digests.get("contract", {}).items())
    ]
    subjects = [Subject(RESULT_SUBJECT, {"sha256": sha256(octets)})]
    subjects += [Subject(name, {"sha256": digest}) for name, digest in files.items()]
    if digests.get("statement"):
        subjects.append(_subject(STATEMENT_SUBJECT, digests["statement"]))
    run = run_of(result)
    verifier = Verifier(f"urn:roaas:suite:{run.suite.version}:{run.suite.digest}", contract)
    predicate = Predicate(verifier, run.finished, [PROPERTY + property_name(name) for name in passed_classes(run)], run)
    return Statement(STATEMENT_TYPE, [*subjects, *contract], PREDICATE_TYPE, predicate)


def passed_classes(run: Run) -> list[str]:
    """Return the names of the classes that passed without a failure that the baseline file accepts."""
    accepted = {id_.partition("/")[0] for id_ in run.accepted}
    return [name for name, verdict in run.classes.items() if verdict == "pass" and name not in accepted]


def property_name(class_: str) -> str:
    """Return the name of a conformance class as an SVR property: REST_RESOURCES for `rest-resources`."""
    return class_.upper().replace("-", "_")


def sha256(octets: bytes) -> str:
    """Return the SHA-256 digest of some bytes, in hexadecimal."""
    return hashlib.sha256(octets).hexdigest()


def seed_of(nonce: str) -> int:
    """Return the random seed that `roaas certify --nonce` derives from a nonce: six bytes of a SHA-256."""
    return int.from_bytes(hashlib.sha256(b"roaas-nonce/1\0" + nonce.encode()).digest()[:6])


def _subject(name: str, digest: str) -> Subject:
    return Subject(name, {"sha256": digest.removeprefix("sha256:")})


def run_of(result: Mapping[str, Any]) -> Run:
    """Return the facts that are signed for a valid `roaas-result/1` document."""
    requirements = result["requirements"]
    api = result.get("api", {})
    robot = {"name": api.get("title"), "version": api.get("version")} | result["statement"]["robot"]
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
        extent=_extent(result),
    )


def _extent(result: Mapping[str, Any]) -> Extent:
    speed, api = result.get("speed") or {}, result.get("api")
    return Extent(
        claims=list(result["statement"]["claims"]),
        cases=round(speed.get("share_of_cases", 1.0) * speed.get("share_tried", 1.0), 4),
        requests=result.get("requests", 0),
        operations=(api["coverage"]["operations"][0], api["coverage"]["operations"][1]) if api else None,
        left_out=result["left_out"]["minutes"] if "left_out" in result else None,
        suite_errors=sorted({id_ for fault in result.get("suite_errors", ()) for id_ in fault["requirements"]}),
    )


def _outcomes(requirements: Iterable[Mapping[str, Any]]) -> dict[str, dict[str, list[str]]]:
    found: dict[str, dict[str, list[str]]] = {}
    for item in requirements:
        found.setdefault(item["level"], {}).setdefault(item["verdict"], []).append(item["id"])
    return found
