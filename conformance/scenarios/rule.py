"""Rules: functions that judge a scenario's trace, without sending requests."""

import inspect
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any

from conformance.scenarios.scenario import NotPossibleError, Scenario
from conformance.transport.exchange import NoAnswerError
from conformance.verdict.evidence import Case, Judge


@dataclass(frozen=True)
class NotTested:
    """Outcome of a rule: the trace does not show whether the device meets the requirement; ``reason`` explains it."""

    reason: str


@dataclass(frozen=True)
class NotSeen:
    """Outcome of a rule: the device's state kept it from showing the behaviour; ``reason`` names the behaviour."""

    reason: str


@dataclass(frozen=True)
class NotClaimed:
    """Outcome of a rule: the requirement does not apply to this device; ``reason`` explains it."""

    reason: str


@dataclass(frozen=True)
class Note:
    """Outcome of a rule: a remark that changes no verdict."""

    remark: str


Outcome = Case | NotTested | NotSeen | NotClaimed | Note


@dataclass(frozen=True)
class Rule:
    """The function that judges one requirement by the traces of scenarios.

    Attributes:
        requirement: id of the requirement.
        on: the scenarios; each trace is judged.
        judge: takes a trace, and pytest fixtures by name; yields outcomes.
    """

    requirement: str
    on: tuple[Scenario, ...]
    judge: Callable[..., Iterable[Outcome]]

    @property
    def fixtures(self) -> tuple[str, ...]:
        """The names of the fixtures that the function takes besides the trace."""
        return tuple(inspect.signature(self.judge).parameters)[1:]

    def outcomes(self, trace: Any, fixture: Callable[[str], Any]) -> list[Outcome]:
        """Return the outcomes for a trace."""
        return list(self.judge(trace, **{name: fixture(name) for name in self.fixtures}))

    def outcomes_apart(
        self, trace: Any, fixture: Callable[[str], Any], report: Callable[[str, Exception], None]
    ) -> list[Outcome]:
        """Return the outcomes for a trace, operation by operation if judging it as a whole raises an exception.

        Args:
            trace: what the scenario recorded.
            fixture: returns a fixture of the run by its name.
            report: is called with an operation that could not be judged, and the exception.

        Raises:
            Exception: it was raised, and the trace is none of operations.
        """
        try:
            return self.outcomes(trace, fixture)
        except (NoAnswerError, NotPossibleError):
            raise
        except Exception:
            parts = _by_operation(trace)
            if not parts:
                raise
        found: list[Outcome] = []
        for operation, part in parts.items():
            try:
                found += self.outcomes(part, fixture)
            except Exception as error:  # noqa: BLE001 - whatever it is, it is told, and others are judged
                report(operation, error)
        return found


def _by_operation(trace: Any) -> dict[str, Any]:
    """Return the part of a trace that each operation has; empty if its parts do not name operations."""
    whole: tuple[Any, ...] = trace if isinstance(trace, tuple) else getattr(trace, "probes", ())
    if not all(hasattr(item, "operation") for item in whole):
        return {}
    parts: dict[str, tuple[Any, ...]] = {}
    for item in whole:
        parts[item.operation] = (*parts.get(item.operation, ()), item)
    return {label: part if isinstance(trace, tuple) else replace(trace, probes=part) for label, part in parts.items()}


def rule(requirement: str, *, on: tuple[Scenario, ...]) -> Callable[[Callable[..., Iterable[Outcome]]], Rule]:
    """Return a decorator that turns a function into a rule."""
    return lambda judge: Rule(requirement, on, judge)


def record(judge: Judge, requirement: str, outcomes: Iterable[Outcome]) -> None:
    """Record the outcomes of a rule as evidence."""
    for outcome in outcomes:
        match outcome:
            case Case():
                judge.record(outcome, requirement)
            case NotTested():
                judge.skip(requirement, outcome.reason)
            case NotSeen():
                judge.not_seen(requirement, outcome.reason)
            case NotClaimed():
                judge.note_unclaimed(requirement, outcome.reason)
            case Note():
                judge.note(requirement, outcome.remark)
