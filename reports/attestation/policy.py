"""Read a policy: a TOML file with what a recipient demands of a signed certificate, one demand per line."""

import difflib
import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Final, Literal

import msgspec

from reports.attestation.outcomes import Entry
from reports.errors import PolicyUnusableError, ReportError
from reports.given_files import read_octets

_MOST_BYTES = 1 << 20
_Share = Annotated[float, msgspec.Meta(ge=0, le=1)]
_Days = Annotated[float, msgspec.Meta(gt=0, le=100_000)]
_Verdicts = tuple[Literal["conformant", "not-conformant", "inconclusive"], ...]
_Efforts = tuple[Literal["quick", "standard", "deep"], ...]
OWN = "installed"
"""In a policy, this word means the suite that verifies."""


@dataclass(frozen=True)
class Known:
    """The digests and profiles of the installed suite, with which a certificate is compared.

    Attributes:
        suite: digest of the installed suite.
        requirement_sets: digest of each requirement set, by its name.
        ledger: the requirements of the contract, by id.
        contract: digest of each file of the contract, by its name.
        profiles: names of the conformance classes in each profile, by the profile's name.
    """

    suite: str = ""
    requirement_sets: Mapping[str, str] = field(default_factory=dict)
    ledger: Mapping[str, Entry] = field(default_factory=dict)
    contract: Mapping[str, str] = field(default_factory=dict)
    profiles: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


class Policy(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The requirements that a certificate must meet to be accepted.

    The defaults are the default policy; docs/certificates.md explains each field.

    Attributes:
        robot: required robot name, or None for any; `vendor` and `firmware` likewise.
        statement: required digest of the vendor's statement, or None for any.
        verdicts: accepted verdicts of the whole run.
        profile: profile whose conformance classes must have passed, unless `classes` names them.
        suites: digests of trusted suites; "installed" stands for the suite that verifies.
        requirement_sets: names of accepted requirement sets, which the verifying suite must know.
        efforts: accepted effort levels of the run.
        motion: whether the robot must have been allowed to move.
        ros: whether the suite must have observed the ROS topics of every passed class that uses ROS topics.
        baseline: whether failures that the vendor's baseline file accepts are tolerated.
        interrupted: always False: an interrupted run is never accepted.
        tested: least share of the MUSTs of the required classes that were tested, 0 to 1.
        operations: least share of the operations of a device's own description that were called, 0 to 1.
        cases: least share of the cases that were tried, of those that a fast robot gets, 0 to 1.
        max_age_days: greatest age of the run in days.
        nonce: nonce that the run must have been made with, or None for any.
    """

    robot: str | None = None
    vendor: str | None = None
    firmware: str | None = None
    statement: str | None = None
    verdicts: _Verdicts = ("conformant",)
    profile: str = "full"
    classes: tuple[str, ...] | None = None
    suites: tuple[str, ...] = (OWN,)
    requirement_sets: tuple[str, ...] = ("1.2",)
    efforts: _Efforts = ("standard", "deep")
    motion: bool = True
    ros: bool = False
    baseline: bool = False
    interrupted: Literal[False] = False
    tested: _Share = 0.4
    operations: _Share = 0.5
    cases: _Share = 0.04
    max_age_days: _Days = 365
    nonce: str | None = None


#: The default policy for a device that was judged by its own description: one that only read will do.
OF_DESCRIBED: Final = Policy(
    classes=("description", "robustness", "http"), requirement_sets=("unfrozen",), motion=False
)


# What a value must be, in words, by its type; all other values are strings.
_WORDS: Final[Mapping[Any, str]] = {
    bool: "true or false",
    Literal[False]: "false, as no policy accepts an interrupted run",
    _Share: "a number from 0 to 1",
    _Days: "a positive number up to 100000",
    _Verdicts: "a list of conformant, not-conformant and inconclusive",
    _Efforts: "a list of quick, standard and deep",
    tuple[str, ...]: "a list of strings",
    tuple[str, ...] | None: "a list of strings",
}


def _fault(table: Mapping[str, Any], said: str) -> str:
    """Return what is wrong with a policy, in words for its author; ``said`` is what msgspec says of it."""
    for key in table:
        if key not in Policy.__struct_fields__:
            near = difflib.get_close_matches(key, Policy.__struct_fields__, 1)
            hint = f"did you mean {near[0]!r}?" if near else f"known are {', '.join(Policy.__struct_fields__)}"
            return f"unknown key {key!r}; {hint}"
    place = re.search(r"\$\.(\w+)", said)
    if place is None:
        return said
    key = place[1]
    return f"{key} = {table[key]!r} must be {_WORDS.get(Policy.__annotations__[key], 'a string')}"


def read_policy(path: Path, known: Known) -> Policy:
    """Read a policy from a TOML file and return it.

    Raises:
        PolicyUnusableError: the file cannot be read, has an unknown field or a wrong value, or names an unknown
            profile.
    """
    table: dict[str, Any] = {}
    try:
        table = tomllib.loads(read_octets(path, _MOST_BYTES).decode("utf-8"))
        policy = msgspec.convert(table, Policy)
    except ReportError as error:
        raise PolicyUnusableError(error.message) from error
    except msgspec.ValidationError as error:
        raise PolicyUnusableError(f"{path}: {_fault(table, str(error))}") from error
    except (ValueError, RecursionError) as error:
        raise PolicyUnusableError(f"{path} is no TOML: {error}") from error
    if policy.classes is None and policy.profile not in known.profiles:
        raise PolicyUnusableError(f"{path}: profile = {policy.profile!r} must be one of {', '.join(known.profiles)}")
    return policy
