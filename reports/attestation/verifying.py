"""Verify a certificate: its signature, the recipient's policy, and the files that belong to the certificate.

`PROVED` and `NOT_PROVED` are the texts that say what a successful verification proves and what it does not.
"""

import datetime as dt
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
from securesystemslib.dsse import Envelope
from securesystemslib.exceptions import VerificationError
from securesystemslib.signer import Key, Signature

from reports.attestation.envelope import open_envelope, statement_in, strict_json
from reports.attestation.files import compare, remarks_on
from reports.attestation.outcomes import (
    TESTED,
    demanded_entries,
    departures,
    first_names,
    musts_of,
    outcomes_of,
    statement_contradictions,
)
from reports.attestation.policy import OWN, Known, Policy
from reports.attestation.statement import (
    CONTRACT_SUBJECT,
    PAYLOAD_TYPE,
    RESULT_SUBJECT,
    STATEMENT_SUBJECT,
    Run,
    Statement,
    passed_classes,
    run_of,
    seed_of,
)
from reports.errors import EnvelopeRefusedError, ResultMissingError
from reports.given_files import read_octets

SKEW = dt.timedelta(minutes=5)
"""How far the vendor's clock may be ahead of ours."""


class Point(NamedTuple):
    """The result of one check of a policy.

    Attributes:
        name: the policy field that was checked, the fact, or the file name if a file was compared.
        met: whether the certificate meets the requirement.
        found: text that says what the certificate contains.
        demanded: text that says what the policy demands; empty if it is met.
        remedy: what the recipient can do or ask for; empty if it is met.
    """

    name: str
    met: bool
    found: str
    demanded: str = ""
    remedy: str = ""


def judge(statement: Statement, policy: Policy, known: Known, now: dt.datetime) -> list[Point]:
    """Check a verified statement against each field of a policy, and return one result per check.

    `known` describes the installed suite; `now` is the time from which the age of the run is counted.
    """
    run = statement.predicate.roaas
    points = (
        _robot(statement, policy),
        _verdict(run, policy, known),
        _suite(statement, policy, known),
        _requirements(statement, policy, known),
        _extent(run, policy),
        _time(run, policy, now),
    )
    return [
        point if not point.met else Point(point.name, met=True, found=point.found)
        for group in points
        for point in group
    ]


def _robot(statement: Statement, policy: Policy) -> Iterator[Point]:
    robot = statement.predicate.roaas.robot
    digest = statement.digest_of(STATEMENT_SUBJECT)
    for line, wanted, found, remedy in (
        ("robot", policy.robot, robot.name, "ask for the certificate of that robot"),
        ("vendor", policy.vendor, robot.vendor, "ask that vendor for the certificate"),
        ("firmware", policy.firmware, robot.version, "ask the vendor to certify that firmware"),
        ("statement", policy.statement, digest and f"sha256:{digest}", "ask the vendor for the statement of this run"),
    ):
        text = found or ("the run had no file" if line == "statement" else "not named")
        yield Point(line, wanted in {None, found}, text, repr(wanted), remedy)


def _verdict(run: Run, policy: Policy, known: Known) -> Iterator[Point]:
    yield Point(
        "verdicts",
        run.verdict in policy.verdicts,
        run.verdict,
        " or ".join(policy.verdicts),
        "ask the vendor for a run without failures and with every claimed class tested, or accept other verdicts",
    )
    yield _classes(run, _required_classes(policy, known), known)
    accepted = f": {', '.join(run.accepted)}" if run.accepted else ""
    used = run.baseline is not None or bool(run.accepted) or run.accepted_until is not None
    yield Point(
        "baseline",
        policy.baseline or not used,
        f"failures were accepted{accepted}" if used else "no failure was accepted",
        "no accepted failures",
        "ask for a run without --baseline, or accept these failures (baseline = true)",
    )
    text = "the run was interrupted" if run.interrupted else "the run is complete"
    yield Point("interrupted", not run.interrupted, text, "a complete run", "ask the vendor to certify again")


def _required_classes(policy: Policy, known: Known) -> tuple[str, ...]:
    return known.profiles.get(policy.profile, ()) if policy.classes is None else policy.classes


def _classes(run: Run, wanted: tuple[str, ...], known: Known) -> Point:
    """Return the check that each required class was claimed, tested and passed, in these words."""
    there = passed_classes(run)
    unclaimed = [name for name in wanted if run.classes.get(name, "not-claimed") == "not-claimed"]
    text, remedies = [f"{', '.join(there) or 'none'} passed"], []
    if unclaimed:
        text.append(f"not claimed, so not tested: {', '.join(unclaimed)}")
        claimed = (name for name, verdict in run.classes.items() if verdict != "not-claimed")
        options = " ".join(f"--class {name}" for name in (*claimed, *unclaimed))
        remedies.append(f"ask the vendor to claim them and to certify again ({options}), or require fewer classes")
    for name in wanted:
        verdict = run.classes.get(name, "not-claimed")
        if name in there or name in unclaimed:
            continue
        musts = musts_of(run, known.ledger, (name,))
        if verdict == "inconclusive":
            untested = [id_ for id_, value in musts.items() if value not in TESTED]
            first = f", such as {first_names(untested)}" if untested else ""
            text.append(f"claimed, but not tested in full: {name}{first}")
            remedies.append(f"certify {name} again with what its tests need (certificate.html names it)")
        elif verdict == "fail":
            failed = [id_ for id_, value in musts.items() if value == "fail"]
            first = f" ({first_names(failed)})" if failed else ""
            text.append(f"tested, and failed: {name}{first}")
            remedies.append(f"the robot has to meet {name} first")
        else:
            text.append(f"passed only with accepted failures: {name}")
            remedies.append(f"ask for a run in which {name} passes without a baseline")
    met = bool(there) and len(text) == 1
    remedy = "; ".join(remedies) or "ask for a run in which at least one class passes"
    return Point("classes", met, "; ".join(text), f"{', '.join(wanted) or 'a class'} passed", remedy)


def _suite(statement: Statement, policy: Policy, known: Known) -> Iterator[Point]:
    run = statement.predicate.roaas
    trusted = {known.suite if digest == OWN else digest for digest in policy.suites} - {""}
    unknown = "" if run.suite.digest in trusted else ", which the policy does not trust"
    contract = (
        "give the folder of the description with --contract"
        if run.described
        else f"install RoAAS {run.suite.version}, and give its contract with --contract"
    )
    yield Point(
        "suites",
        not unknown,
        f"RoAAS {run.suite.version}, contract {run.suite.contract}, {run.suite.digest}{unknown}",
        f"a suite and contract with the digest {' or '.join(sorted(trusted)) or 'of the installed suite'}",
        f"{contract}; or trust the digest (suites)",
    )
    signed = {
        subject.name.removeprefix(CONTRACT_SUBJECT): subject.sha256
        for subject in statement.subject
        if subject.name.startswith(CONTRACT_SUBJECT)
    }
    own = {name: digest.removeprefix("sha256:") for name, digest in known.contract.items()}
    other = sorted(name for name in signed.keys() | own.keys() if signed.get(name) != own.get(name))
    same = run.suite.digest == known.suite
    text = (
        f"not the files of the installed contract: {first_names(other)}"
        if other
        else "the files of the installed contract"
    )
    yield Point(
        "contract",
        not (same and other),
        text if same else "unknown here: another suite or contract than yours judged the robot",
        "the files of the contract that the suite has",
        f"{contract}; if the vendor changed the files, do not rely on the certificate",
    )


def _requirements(statement: Statement, policy: Policy, known: Known) -> Iterator[Point]:
    run, set_ = statement.predicate.roaas, statement.predicate.roaas.requirement_set
    wrong = ""
    if set_ is None:
        wrong = "none: the run used an own contract"
    elif set_.name not in policy.requirement_sets:
        wrong = f"{set_.name}, which the policy does not accept"
    elif known.requirement_sets.get(set_.name) != set_.digest:
        wrong = f"{set_.name}, but with other requirements than the set {set_.name} of this suite"
    yield Point(
        "requirement_sets",
        not wrong,
        wrong or (set_.name if set_ else ""),
        " or ".join(policy.requirement_sets),
        "ask for a run with --requirements SET, or accept the set (requirement_sets)",
    )
    problems, same = statement_contradictions(statement), run.suite.digest == known.suite
    is_known = set_ is not None and known.requirement_sets.get(set_.name) == set_.digest and bool(known.ledger)
    count, name = 0, set_.name if set_ is not None and is_known else ""
    if not run.outcomes:
        problems.append("the certificate does not list its requirements: a former version of RoAAS signed it")
    elif is_known or same:
        problems += departures(run, known.ledger, name, same=same)
        count = len(demanded_entries(run, known.ledger, name, same=same))
    else:
        problems.append("not known: the installed suite has no such ledger")
    there = sum(1 for _ in outcomes_of(run))
    text = f"all {count} requirements of the {'suite' if same else f'set {name}'}"
    text += "" if same else f", and {there - count} beyond it" if there > count else ""
    yield Point(
        "requirements",
        not problems,
        "; ".join(problems[:5]) or text,
        "each requirement of the ledger once, at its level, and no contradiction",
        "do not rely on the certificate; ask the vendor for one that `roaas certify --sign` made, or that `roaas sign` "
        "of this version made from the result",
    )
    musts = musts_of(run, known.ledger, _required_classes(policy, known))
    tested = sum(verdict in TESTED for verdict in musts.values())
    yield Point(
        "tested",
        tested >= policy.tested * len(musts),
        f"{tested} of {len(musts)} MUST requirements of the required classes; the run had no occasion for the others",
        f"at least {policy.tested:.0%} of them tested",
        "ask for a run that may do more (--allow-motion, --call, credentials), or demand less",
    )


def _extent(run: Run, policy: Policy) -> Iterator[Point]:
    remedy = "ask the vendor to certify again"
    yield Point(
        "efforts", run.effort in policy.efforts, run.effort, " or ".join(policy.efforts), f"{remedy} (--effort)"
    )
    moved = "motion was judged" if run.motion_allowed else "motion was not judged: --allow-motion was not given"
    yield Point(
        "motion", run.motion_allowed or not policy.motion, moved, "a robot that may move", f"{remedy} (--allow-motion)"
    )
    black_box = [name for name in passed_classes(run) if run.views.get(name) == "black box"]
    text = (
        f"ROS topics not observed: {', '.join(black_box)}" if black_box else "no passed class left its ROS topics out"
    )
    yield Point(
        "ros",
        not (policy.ros and black_box),
        text,
        "classes about ROS observed by a probe",
        f"{remedy} (--ros-domain-id)",
    )
    extent = run.extent
    if extent is None:
        yield Point(
            "extent",
            met=False,
            found="the certificate does not say how much was tested: a former version of RoAAS signed it",
            demanded="share of cases and operations, what --minutes left out, errors of the suite",
            remedy="ask the vendor to sign the result again with this version (roaas sign DIR --key KEY)",
        )
        return
    yield Point(
        "cases", extent.cases >= policy.cases, f"{extent.cases:.0%} of the cases, {extent.requests} requests",
        f"at least {policy.cases:.0%} of the cases", f"{remedy} with more time, or demand less (cases)",
    )  # fmt: skip
    called, there = extent.operations or (0, 0)
    text = (
        f"{called} of {there} operations called" if extent.operations else "does not apply: judged by a contract pack"
    )
    yield Point(
        "operations", extent.operations is None or called >= policy.operations * there, text,
        f"at least {policy.operations:.0%} of the operations",
        f"{remedy} (--call allows more), or demand less (operations)",
    )  # fmt: skip
    struck = extent.left_out is not None
    text = f"--minutes {extent.left_out:g} ended it before everything was tried" if struck else "nothing left out"
    yield Point("left_out", not struck, text, "a run that no time limit cut short", f"{remedy} without --minutes")
    text = f"the suite could not judge {first_names(extent.suite_errors)}" if extent.suite_errors else "none"
    yield Point(
        "suite_errors", not extent.suite_errors, text, "no error of the suite", f"{remedy} with a newer version"
    )


def _time(run: Run, policy: Policy, now: dt.datetime) -> Iterator[Point]:
    demanded_age = f"at most {policy.max_age_days:g} days old, in UTC, and not in the future"
    if run.ended_at is None:
        text, met = f"{run.finished[:40]!r} is not a time in UTC", False
    else:
        age = now - run.ended_at
        text = f"the run ended on {run.ended_at:%Y-%m-%d %H:%M} UTC"
        text += f", {age.days} days ago" if age.days > 0 else ""
        met = -SKEW <= age <= dt.timedelta(days=policy.max_age_days)
    yield Point("max_age_days", met, text, demanded_age, "ask the vendor to certify again")
    if policy.nonce is None:
        text, fresh = "you gave no nonce", True
    elif run.nonce != policy.nonce:
        text, fresh = f"the run has {run.nonce!r}" if run.nonce else "the run was made without one", False
    else:
        text, fresh = "the one that you gave", run.seed == seed_of(policy.nonce)
        text += "" if fresh else f", but the seed {run.seed} was not derived from it"
    yield Point("nonce", fresh, text, repr(policy.nonce), "ask the vendor to certify with --nonce and your text")


PROVED = (
    "Proved: the holder of this key vouches that this run took place and gave the result with the digest above, and "
    "the envelope was not changed since."
)
REFUSED = "The signature is valid, but a point above is refused: do not rely on this certificate."
NOT_PROVED = (
    "Not proved: that the robot is genuine, that the named suite really ran, or that another run would give the same "
    "result. You have to know who holds the key, and decide whether to trust them."
)
DESCRIBED = (
    "This device was judged by its own description: give the folder of the description too, as in "
    "--contract description (docs/certificates.md#a-device-that-was-judged-by-its-own-description)."
)


@dataclass(frozen=True)
class Verification:
    """The outcome of verifying one certificate.

    Attributes:
        statement: the signed statement.
        points: the checks of the policy, followed by those of the compared files.
        remarks: sentences on files that were not compared.
    """

    statement: Statement
    points: tuple[Point, ...]
    remarks: tuple[str, ...] = ()

    @property
    def accepted(self) -> bool:
        """Return whether the certificate passed every check."""
        return all(point.met for point in self.points)


def verify(
    octets: bytes, key: Key, policy: Policy, known: Known, *, now: dt.datetime, directory: Path | None = None
) -> Verification:
    """Verify a signed envelope by a trusted key and a policy, and optionally compare the signed files.

    Args:
        octets: the content of the envelope file.
        key: the public key that the recipient trusts.
        policy: the requirements that the certificate must meet.
        known: digests and profiles of the installed suite.
        now: the time from which the age of the run is counted.
        directory: folder with result.json and the files beside it to compare with the signed digests, or None.

    Raises:
        EnvelopeRefusedError: the envelope is not signed by the key, or is not a certificate.
        ResultMissingError: the directory has no result.json.
        ResultUnreadableError: a file of the directory cannot be read.
    """
    statement = unseal(octets, key)
    points = judge(statement, policy, known, now)
    if directory is None:
        return Verification(statement, tuple(points))
    result = _result_in(directory)
    name = _statement_name(result)
    points += (_file(*one) for one in compare(statement, directory, name))
    points.append(_agreement(statement, result))
    return Verification(statement, tuple(points), tuple(remarks_on(statement, directory, name)))


def _result_in(directory: Path) -> Any:
    """Return the content of result.json as it was parsed, without validation; None if it is not JSON."""
    path = directory / RESULT_SUBJECT
    try:
        return strict_json(read_octets(path, root=directory))
    except ResultMissingError as error:
        raise ResultMissingError(f"{path}: no such file. Name the folder that the vendor sent") from error
    except (ValueError, RecursionError):
        return None


def _statement_name(result: Any) -> str | None:
    """Return the file name of the vendor's statement, by result.json."""
    try:
        return Path(result["places"]["statement"]["file"]).name or None
    except (KeyError, TypeError):
        return None


def _file(name: str, problem: str) -> Point:
    return Point(
        name, not problem, problem or "as it was signed", "the file that was signed",
        "ask the vendor for the file of this run; if the vendor changed it, for another run",
    )  # fmt: skip


def _agreement(statement: Statement, result: Any) -> Point:
    """Return the check that the envelope says what result.json says, as far as both know the facts."""
    signed = msgspec.to_builtins(statement.predicate.roaas)
    try:
        read = msgspec.to_builtins(run_of(result))
        other = sorted(key for key in signed if signed[key] != read.get(key))
    except (KeyError, TypeError, AttributeError, IndexError, msgspec.ValidationError):
        other = ["all"]
    text = (
        f"the certificate says otherwise than result.json: {', '.join(other)}"
        if other
        else "the certificate says what result.json says"
    )
    return Point("agreement", not other, text, "a certificate that says what result.json says", "do not rely on it")


def unseal(octets: bytes, key: Key) -> Statement:
    """Verify an envelope's signature by a trusted public key, and return the signed statement.

    Raises:
        EnvelopeRefusedError: the envelope is not signed by that key, or is not as `signing.seal` writes envelopes.
    """
    opened = open_envelope(octets)
    if opened.keyid != key.keyid:
        raise EnvelopeRefusedError(
            f"foreign key: it is signed by {opened.keyid[:64]!r}, but your key is {key.keyid}. "
            "If the vendor has a new key, compare its fingerprint over a second channel, and use that key"
        )
    signature = Signature(opened.keyid, opened.signature.hex())
    try:
        Envelope(opened.payload, PAYLOAD_TYPE, {opened.keyid: signature}).verify([key], 1)
    except VerificationError as error:
        raise EnvelopeRefusedError(
            "the signature was not made by your key over this content: somebody changed it, or signed it "
            "with another key. Do not rely on it; ask the vendor for the file as `roaas sign` wrote it"
        ) from error
    return statement_in(opened)
