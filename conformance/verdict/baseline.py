"""A baseline of expected failures: each with a reason and a day on which it expires."""

from __future__ import annotations

import datetime as dt
import tomllib
from dataclasses import dataclass
from typing import TYPE_CHECKING

from conformance.verdict.verdicts import Verdict, broken_baseline, expected_failure

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path


class BaselineError(Exception):
    """A baseline that cannot be used; the message names the entry and the offending value."""


@dataclass(frozen=True)
class Expectation:
    """One failure that is known and accepted for a while.

    Attributes:
        requirement: id of the requirement that fails.
        reason: why that is accepted.
        expires: the last day on which it is.
    """

    requirement: str
    reason: str
    expires: dt.date


def load_baseline(path: Path, known: Iterable[str]) -> tuple[Expectation, ...]:
    """Read ``[[expected]]`` tables with requirement, reason and expires.

    Raises:
        BaselineError: it cannot be read, or an entry names no known requirement or lacks a field.
    """
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise BaselineError(f"{path} cannot be read: {error}") from error
    unknown = set(document) - {"expected"}
    if unknown:
        raise BaselineError(f"{path}: unknown {min(unknown)!r}; a baseline has [[expected]] tables")
    entries = document.get("expected", [])
    if not isinstance(entries, list):
        raise BaselineError(f"{path}: write [[expected]], with two brackets, for each entry")
    ids = set(known)
    baseline = []
    for entry in entries:
        id_ = entry.get("requirement")
        if id_ not in ids:
            raise BaselineError(f"{path}: {id_!r} is no requirement; `roaas contract list` shows them")
        if set(entry) - {"requirement", "reason", "expires"}:
            raise BaselineError(f"{path}: the entry for {id_} may have requirement, reason and expires only")
        if not isinstance(entry.get("reason"), str) or not entry["reason"].strip():
            raise BaselineError(f"{path}: the entry for {id_} has no reason")
        if type(entry.get("expires")) is not dt.date:
            raise BaselineError(f"{path}: the entry for {id_} has no expires = YYYY-MM-DD (without quotes)")
        baseline.append(Expectation(id_, entry["reason"], entry["expires"]))
    return tuple(baseline)


def apply_baseline(verdicts: Iterable[Verdict], baseline: Iterable[Expectation], today: dt.date) -> list[Verdict]:
    """Turn expected failures into warnings; an entry that has expired or no longer fails is an error."""
    expected = {entry.requirement: entry for entry in baseline}
    return [
        _applied(verdict, expected[verdict.requirement.id], today) if verdict.requirement.id in expected else verdict
        for verdict in verdicts
    ]


def _applied(verdict: Verdict, entry: Expectation, today: dt.date) -> Verdict:
    if verdict.value == "not-claimed":
        return verdict
    day = entry.expires.isoformat()
    if verdict.value in {"fail", "warn"}:
        if entry.expires >= today:
            return expected_failure(verdict, entry.reason, day)
        return Verdict(
            verdict.requirement,
            verdict.value,
            f"its baseline entry expired on {day}: {verdict.reason}",
            verdict.evidence,
        )
    if verdict.value == "pass":
        return broken_baseline(
            verdict, f"the baseline expects it to fail ({entry.reason}), and it passes: take the entry out"
        )
    return verdict
