"""A baseline: a file of expected failures, each with a reason and an expiry date."""

import datetime as dt
import json
from collections.abc import Collection, Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Final, NamedTuple

import msgspec

from conformance.contract.ledger import Requirement
from conformance.contract.toml_file import Text, TomlFileError, read_toml
from conformance.verdict.verdicts import Value, Verdict


class BaselineError(TomlFileError):
    """Raised for an invalid baseline file; the message names the entry and the offending value."""


class Expectation(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A failure that is known and accepted until a date.

    Attributes:
        requirement: id of the failing requirement.
        reason: why the failure is accepted.
        expires: last day on which it is accepted.
        intermittent: whether the requirement may also pass, because the failure does not occur in every run.
        operations: the only operations of a description that may fail; empty means all.
    """

    requirement: Text
    reason: str
    expires: dt.date
    intermittent: bool = False
    operations: tuple[Text, ...] = ()


class Accepted(NamedTuple):
    """The effects of a baseline on a run.

    Attributes:
        until: last day on which it accepts all failures; empty if it does not accept all.
        stale: ids of entries whose requirements pass.
    """

    until: str = ""
    stale: tuple[str, ...] = ()


#: Begins the reason of a failure that an entry does not accept.
ENTRY: Final = "its baseline entry"
# Most operations that an entry names.
_NAMED: Final = 5
#: The baseline that accepts nothing.
NOTHING: Final = Accepted()


class _File(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    expected: tuple[Expectation, ...] = ()


def load_baseline(
    path: Path, known: Iterable[str], renamed: Mapping[str, str] = MappingProxyType({})
) -> tuple[Expectation, ...]:
    """Read a baseline file: ``[[expected]]`` tables, whose keys are those of Expectation.

    Args:
        path: the file.
        known: ids of the contract's requirements.
        renamed: the present id by each older one; an entry with an older id names it in its reason.

    Raises:
        BaselineError: the file cannot be read, or an entry is incomplete or names an unknown requirement.
    """
    baseline = read_toml(path, _File, BaselineError).expected
    ids = set(known)
    baseline = tuple(_with_present_id(entry, renamed) for entry in baseline)
    for entry in baseline:
        if not entry.reason.strip():
            raise BaselineError(f"{path}: {entry.requirement} has no reason: write why its failure is accepted")
        if entry.requirement not in ids:
            raise BaselineError(f"{path}: {entry.requirement!r} is no requirement; `roaas contract list` shows them")
    return baseline


def _with_present_id(entry: Expectation, renamed: Mapping[str, str]) -> Expectation:
    """Return an entry with its requirement's present id."""
    new = renamed.get(entry.requirement)
    if new is None:
        return entry
    reason = f"{entry.reason}; {entry.requirement} is {new} now"
    return msgspec.structs.replace(entry, requirement=new, reason=reason)


def apply_baseline(verdicts: Iterable[Verdict], baseline: Iterable[Expectation], today: dt.date) -> list[Verdict]:
    """Turn expected failures into warnings.

    A failure of an operation that its entry does not name stays one. An entry becomes an error when it has expired, or
    when its requirement passes and it is not intermittent.
    """
    expected = {entry.requirement: entry for entry in baseline}
    return [
        _apply(verdict, expected[verdict.requirement.id], today) if verdict.requirement.id in expected else verdict
        for verdict in verdicts
    ]


def stale_entries(verdicts: Iterable[Verdict], baseline: Iterable[Expectation]) -> tuple[str, ...]:
    """Return the ids of baseline entries whose requirement passes although the entry expects a failure."""
    passed = {verdict.requirement.id for verdict in verdicts if verdict.value is Value.PASS}
    return tuple(entry.requirement for entry in baseline if entry.requirement in passed and not entry.intermittent)


def baseline_text(
    failed: Iterable[tuple[Requirement, Collection[str]]], old: Iterable[Expectation], today: dt.date
) -> str:
    """Return a baseline file of the present failures; an older baseline's reasons and dates are kept.

    Args:
        failed: the failed requirements, each with the operations that break it. An entry names few of them: what fails
            at many is a fault of the whole device, of which no run sees all.
        old: entries of the older baseline.
        today: the last day of new entries, so that somebody has to choose a later one.
    """
    known = {entry.requirement: entry for entry in old}
    tables = ["# Failures that are accepted for a while: write a reason to each, and the last day on which it holds.\n"]
    for requirement, operations in failed:
        entry = known.get(requirement.id)
        reason, expires = (entry.reason, entry.expires) if entry else ("", today)
        often = "intermittent = true\n" if entry and entry.intermittent else ""
        is_named = len(operations) <= _NAMED and (entry is None or entry.operations)
        only = f"operations = {json.dumps(sorted(operations))}\n" if operations and is_named else ""
        tables.append(
            f"# {' '.join(requirement.text.split())}\n[[expected]]\nrequirement = {json.dumps(requirement.id)}\n"
            f"reason = {json.dumps(reason, ensure_ascii=False)}\nexpires = {expires.isoformat()}\n{often}{only}"
        )
    return "\n".join(tables)


def accepted_until(verdicts: Iterable[Verdict]) -> str:
    """Return the last day on which the baseline accepts all failures; empty if it accepts none."""
    return min((verdict.expected_failure[1] for verdict in verdicts if verdict.expected_failure), default="")


def _failing(verdict: Verdict) -> set[str]:
    """Return the operations that break a requirement without doubt."""
    sure = [finding for finding in verdict.evidence.findings.values() if not finding.doubt]
    return {label for finding in sure for label in finding.operations}


def _apply(verdict: Verdict, entry: Expectation, today: dt.date) -> Verdict:
    day = entry.expires.isoformat()
    # A requirement that another finding kept from being tested counts as failed by that finding.
    if verdict.value in {Value.FAIL, Value.WARN} or verdict.because is not None:
        if entry.expires < today:
            return replace(verdict, reason=f"{ENTRY} expired on {day}: {verdict.reason}")
        if entry.operations and (others := sorted(_failing(verdict) - {*entry.operations})):
            return replace(verdict, reason=f"{ENTRY} does not name {', '.join(others)}: {verdict.reason}")
        told = f"expected until {day} ({entry.reason}): {verdict.reason}"
        return replace(verdict, value=Value.WARN, reason=told, expected_failure=(entry.reason, day))
    if verdict.value is Value.PASS and entry.intermittent and entry.expires >= today:
        told = f"not seen in this run; as an intermittent failure, expected until {day} ({entry.reason})"
        return replace(verdict, reason="; ".join(filter(None, (told, verdict.reason))))
    if verdict.value is Value.PASS:
        told = f"the baseline expects it to fail ({entry.reason}), and it passes: take the entry out"
        return replace(verdict, value=Value.ERROR, reason=told)
    return verdict
