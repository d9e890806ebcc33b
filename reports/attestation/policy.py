"""Judge a signed certificate by a policy: a TOML file with the recipient's requirements, one per line."""

import datetime as dt
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, NamedTuple

import msgspec

from reports.attestation.statement import Run, Statement, passed, seed_of
from reports.errors import PolicyUnusableError

_SKEW = dt.timedelta(minutes=5)
"""How far the vendor's clock may be ahead of ours."""
OWN = "installed"
"""In a policy, this word means the suite that verifies."""


@dataclass(frozen=True)
class Known:
    """The digests and profiles of the installed suite, with which a certificate is compared.

    Attributes:
        suite: digest of the installed suite.
        requirement_sets: digest of each requirement set, by its name.
        profiles: names of the conformance classes in each profile, by the profile's name.
    """

    suite: str = ""
    requirement_sets: Mapping[str, str] = field(default_factory=dict)
    profiles: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


class Policy(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The requirements that a certificate must meet to be accepted.

    The defaults are the default policy; docs/certificates.md explains each field.

    Attributes:
        robot: required robot name, or None for any; `vendor` and `firmware` likewise.
        verdicts: accepted verdicts of the whole run.
        profile: profile whose conformance classes must have passed, unless `classes` names them.
        suites: digests of trusted suites; "installed" stands for the suite that verifies.
        requirement_sets: names of accepted requirement sets, which the verifying suite must know.
        efforts: accepted effort levels of the run.
        motion: whether the robot must have been allowed to move.
        ros: whether the suite must have observed the ROS topics of every passed class that uses ROS topics.
        baseline: whether failures that the vendor's baseline file accepts are tolerated.
        interrupted: whether an incomplete run is tolerated.
        max_age_days: greatest age of the run in days.
        nonce: nonce that the run must have been made with, or None for any.
    """

    robot: str | None = None
    vendor: str | None = None
    firmware: str | None = None
    verdicts: tuple[str, ...] = ("conformant",)
    profile: str = "full"
    classes: tuple[str, ...] | None = None
    suites: tuple[str, ...] = (OWN,)
    requirement_sets: tuple[str, ...] = ("1.2",)
    efforts: tuple[str, ...] = ("standard", "deep")
    motion: bool = True
    ros: bool = False
    baseline: bool = False
    interrupted: bool = False
    max_age_days: Annotated[float, msgspec.Meta(gt=0, le=100_000)] = 365
    nonce: str | None = None


class Point(NamedTuple):
    """The result of one check of a policy.

    Attributes:
        name: the policy field that was checked, or the file name if a file was compared.
        met: whether the certificate meets the requirement.
        found: text that says what the certificate contains.
    """

    name: str
    met: bool
    found: str


def read_policy(path: Path, known: Known) -> Policy:
    """Read a policy from a TOML file and return it.

    Raises:
        PolicyUnusableError: the file cannot be read, has an unknown field or a wrong value, or names an unknown
            profile.
    """
    try:
        policy = msgspec.convert(tomllib.loads(path.read_text(encoding="utf-8")), Policy)
    except OSError as error:
        raise PolicyUnusableError(f"{path}: {error.strerror or error}") from error
    except (UnicodeDecodeError, tomllib.TOMLDecodeError, msgspec.ValidationError) as error:
        raise PolicyUnusableError(f"{path}: {error}") from error
    if policy.classes is None and policy.profile not in known.profiles:
        raise PolicyUnusableError(f"{path}: profile = {policy.profile!r} must be one of {', '.join(known.profiles)}")
    return policy


def judge(statement: Statement, policy: Policy, known: Known, now: dt.datetime) -> list[Point]:
    """Check a verified statement against each field of a policy, and return one result per check.

    `known` describes the installed suite; `now` is the time from which the age of the run is counted.
    """
    run = statement.predicate.roaas
    return [*_robot(run, policy), *_verdict(run, policy, known), *_run(run, policy, known), *_time(run, policy, now)]


def _robot(run: Run, policy: Policy) -> Iterator[Point]:
    for line, found in (("robot", run.robot.name), ("vendor", run.robot.vendor), ("firmware", run.robot.version)):
        wanted = policy.firmware if line == "firmware" else getattr(policy, line)
        asked = "" if wanted in {None, found} else f"; the policy requires {wanted!r}"
        yield Point(line, not asked, f"{found or 'not named'}{asked}")


def _verdict(run: Run, policy: Policy, known: Known) -> Iterator[Point]:
    yield Point("verdicts", run.verdict in policy.verdicts, run.verdict)
    wanted = known.profiles.get(policy.profile, ()) if policy.classes is None else policy.classes
    there = passed(run)
    missing = [name for name in wanted if name not in there]
    text = f"{', '.join(there) or 'none'} passed"
    yield Point(
        "classes", not missing and bool(there), f"{text}; not passed: {', '.join(missing)}" if missing else text
    )
    accepted = f": {', '.join(run.accepted)}" if run.accepted else ""
    used = run.baseline is not None or bool(run.accepted) or run.accepted_until is not None
    yield Point(
        "baseline",
        policy.baseline or not used,
        f"failures were accepted{accepted}" if used else "no failure was accepted",
    )
    text = "the run was interrupted" if run.interrupted else "the run is complete"
    yield Point("interrupted", policy.interrupted or not run.interrupted, text)


def _run(run: Run, policy: Policy, known: Known) -> Iterator[Point]:
    trusted = {known.suite if digest == OWN else digest for digest in policy.suites} - {""}
    unknown = "" if run.suite.digest in trusted else ", which the policy does not trust"
    yield Point("suites", not unknown, f"RoAAS {run.suite.version}, {run.suite.digest}{unknown}")
    yield _requirement_set(run, policy, known)
    yield Point("efforts", run.effort in policy.efforts, run.effort)
    moved = "the robot was allowed to move" if run.motion_allowed else "the robot was not allowed to move"
    yield Point("motion", run.motion_allowed or not policy.motion, moved)
    black_box = [name for name in passed(run) if run.views.get(name) == "black box"]
    text = f"ROS topics not observed: {', '.join(black_box)}" if black_box else "observed where a passed class uses it"
    yield Point("ros", not (policy.ros and black_box), text)


def _requirement_set(run: Run, policy: Policy, known: Known) -> Point:
    found = run.requirement_set
    wrong = ""
    if found is None:
        wrong = "none: the run used an own contract"
    elif found.name not in policy.requirement_sets:
        wrong = f"{found.name}, which the policy does not accept"
    elif known.requirement_sets.get(found.name) != found.digest:
        wrong = f"{found.name}, but with other requirements than the set {found.name} of this suite"
    return Point("requirement_sets", not wrong, wrong or (found.name if found else ""))


def _time(run: Run, policy: Policy, now: dt.datetime) -> Iterator[Point]:
    if run.ended is None:
        yield Point("max_age_days", met=False, found=f"{run.finished[:40]!r} is not a time in UTC")
    else:
        age = now - run.ended
        text = f"the run ended on {run.ended:%Y-%m-%d %H:%M} UTC"
        days = f", {age.days} days ago" if age.days > 0 else ""
        yield Point("max_age_days", -_SKEW <= age <= dt.timedelta(days=policy.max_age_days), text + days)
    if policy.nonce is None:
        text, fresh = "you gave no nonce", True
    elif run.nonce != policy.nonce:
        text, fresh = f"the run has {run.nonce!r}, but you gave {policy.nonce!r}", False
    else:
        text, fresh = "the one that you gave", run.seed == seed_of(policy.nonce)
        text += "" if fresh else f", but the seed {run.seed} was not derived from it"
    yield Point("nonce", fresh, text)
