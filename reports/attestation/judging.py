"""Judge a signed certificate by a policy, point by point: what was demanded, what was found, and what to do."""

import datetime as dt
from collections.abc import Iterator
from typing import NamedTuple

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
from reports.attestation.statement import CONTRACT_SUBJECT, STATEMENT_SUBJECT, Run, Statement, passed_classes, seed_of

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
        text if same else "not compared, because another suite or contract judged the robot",
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
        f"{tested} of {len(musts)} MUSTs of the required classes",
        f"at least {policy.tested:.0%} of them (tested)",
        "ask for a run that may do more (--allow-motion, --call, credentials), or demand less",
    )


def _extent(run: Run, policy: Policy) -> Iterator[Point]:
    remedy = "ask the vendor to certify again"
    yield Point(
        "efforts", run.effort in policy.efforts, run.effort, " or ".join(policy.efforts), f"{remedy} (--effort)"
    )
    moved = "the robot was allowed to move" if run.motion_allowed else "the robot was not allowed to move"
    yield Point(
        "motion", run.motion_allowed or not policy.motion, moved, "a robot that may move", f"{remedy} (--allow-motion)"
    )
    black_box = [name for name in passed_classes(run) if run.views.get(name) == "black box"]
    text = f"ROS topics not observed: {', '.join(black_box)}" if black_box else "observed where a passed class uses it"
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
        text, fresh = f"the run has {run.nonce!r}", False
    else:
        text, fresh = "the one that you gave", run.seed == seed_of(policy.nonce)
        text += "" if fresh else f", but the seed {run.seed} was not derived from it"
    yield Point("nonce", fresh, text, repr(policy.nonce), "ask the vendor to certify with --nonce and your text")
