"""Rules: what judges a trace, and never talks to a device."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from conformance.scenarios.scenario import Scenario
    from conformance.transport.exchange import Attempt
    from conformance.verdict.evidence import Judge


@dataclass(frozen=True)
class Case:
    """One case of a requirement.

    Attributes:
        holds: whether the device keeps it.
        exchange: the evidence, or None.
        expected: what the requirement asks for here, as a noun phrase.
        observed: what the trace shows instead; empty: the response is described.
        cause: failures of one cause are one finding; empty: told by the texts.
        subject: what was tested; empty: method and target of the request.
    """

    holds: bool
    exchange: Attempt | None
    expected: str
    observed: str = ""
    cause: str = ""
    subject: str = ""


@dataclass(frozen=True)
class NotTested:
    """The trace does not show whether the device keeps a requirement; ``reason`` says why."""

    reason: str


@dataclass(frozen=True)
class Note:
    """A remark that changes no verdict."""

    remark: str


Outcome = Case | NotTested | Note


@dataclass(frozen=True)
class Rule:
    """One requirement's judgement of the traces of scenarios.

    Attributes:
        requirement: its id.
        on: the scenarios, each of which shows whether it is kept.
        judge: takes the trace, and fixtures by their names; yields cases, or why there are none.
    """

    requirement: str
    on: tuple[Scenario, ...]
    judge: Callable[..., Iterable[Outcome]]

    @property
    def fixtures(self) -> tuple[str, ...]:
        """The names of the fixtures that it judges with, beside the trace."""
        return tuple(inspect.signature(self.judge).parameters)[1:]

    def outcomes(self, trace: Any, fixture: Callable[[str], Any]) -> list[Outcome]:
        """Return what the rule says of a trace."""
        return list(self.judge(trace, **{name: fixture(name) for name in self.fixtures}))


def rule(requirement: str, *, on: tuple[Scenario, ...]) -> Callable[[Callable[..., Iterable[Outcome]]], Rule]:
    """Return a decorator that makes a rule of a function."""
    return lambda judge: Rule(requirement, on, judge)


def record(judge: Judge, requirement: str, outcomes: Iterable[Outcome]) -> None:
    """Put down what a rule says as evidence."""
    for one in outcomes:
        match one:
            case Case():
                judge.check(
                    requirement,
                    one.holds,
                    one.exchange,
                    one.expected,
                    found=one.observed,
                    cause=one.cause,
                    subject=one.subject,
                )
            case NotTested():
                judge.skip(requirement, one.reason)
            case Note():
                judge.note(requirement, one.remark)
