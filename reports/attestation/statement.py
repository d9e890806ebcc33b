"""What is signed: an in-toto Statement v1 whose predicate is a Simple Verification Result (SVR) v0.2.

SVR names the properties that were verified, so a class that failed, was inconclusive or passed only because
failures are accepted is simply not among them; in-toto's test-result knows PASSED, WARNED and FAILED only, and
would have to call such a run one of the three. What a relying party asks beyond that stands in the predicate's
extension field `roaas` (a consumer ignores what it does not know: in-toto attestation, parsing rules).
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
"""What the name of a class is prefixed with among the verified properties."""
RESULT_SUBJECT = "result.json"
PAGE_SUBJECTS = ("certificate.html", "certificate-print.html")
STATEMENT_SUBJECT = "statement"
CONTRACT_SUBJECT = "contract/"
"""What the name of a file of the contract is prefixed with among the subjects."""

Text = str | None


class Subject(msgspec.Struct, frozen=True):
    """An artifact, identified by its SHA-256 digest in hexadecimal; of its name, only a reader makes use."""

    name: str
    digest: dict[str, str]

    @property
    def sha256(self) -> str:
        """The digest, or nothing where there is only one of another kind."""
        return self.digest.get("sha256", "")


class Robot(msgspec.Struct, frozen=True):
    """Whom the result is about, as the vendor's statement names it."""

    name: Text = None
    vendor: Text = None
    version: Text = None


class Suite(msgspec.Struct, frozen=True):
    """Who judged, and by which contract."""

    version: str
    digest: str
    contract: str


class RequirementSet(msgspec.Struct, frozen=True):
    """By which requirements."""

    name: str
    digest: str


class Run(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """What a relying party asks of a run; nothing of addresses and tokens.

    Attributes:
        verdict: of the whole.
        classes: the verdict of each class.
        requirements: how many have each verdict.
        outcomes: which, by level and verdict, so that two certificates can be compared; empty in those that were signed
            before this was.
        accepted: ids of the requirements whose failure the baseline accepts.
        accepted_until: until when, where a baseline is why the run ended well.
        baseline: digest of the file of accepted failures, or None.
        nonce: what the relying party asked the run to be made with, or None.
        views: from where each class was seen that a look at the ROS side could have judged further.
        intermittent: ids of the requirements that failed at times.
        started: RFC 3339, UTC.
        finished: as started.
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
        """`finished` as a time; None where it is none in UTC."""
        try:
            moment = dt.datetime.fromisoformat(self.finished)
        except ValueError:
            return None
        return moment if moment.utcoffset() == dt.timedelta() else None


class Verifier(msgspec.Struct, frozen=True):
    """The suite; `policies` are the contract's files."""

    id: str
    policies: list[Subject]


class Predicate(msgspec.Struct, frozen=True, rename="camel"):
    """SVR v0.2, with the extension."""

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
        """The digest of the subject of that name, or None where there is none."""
        return next((item.sha256 for item in self.subject if item.name == name), None)


def statement_of(result: Mapping[str, Any], octets: bytes, pages: Mapping[str, str]) -> Statement:
    """Put together what is to be signed.

    Args:
        result: a valid `roaas-result/1` document.
        octets: the file that it was read from.
        pages: the certificate that was written from it, by the names of its files.
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
    """The classes that passed without a failure that is accepted."""
    accepted = {id_.partition("/")[0] for id_ in run.accepted}
    return [name for name, verdict in run.classes.items() if verdict == "pass" and name not in accepted]


def property_name(class_: str) -> str:
    """A class as it stands among the properties: `rest-resources` as REST_RESOURCES."""
    return class_.upper().replace("-", "_")


def sha256(octets: bytes) -> str:
    """Digest in hexadecimal."""
    return hashlib.sha256(octets).hexdigest()


def seed_of(nonce: str) -> int:
    """The seed that a run with this nonce has; `roaas certify --nonce` derives it likewise."""
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
