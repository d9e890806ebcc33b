"""Scenarios: what talks to a device and returns a trace, and never judges."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from typing import Any

from conformance.scenarios.stage import Leaves, Need, Stage


class NotPossibleError(Exception):
    """A scenario cannot be played on this device; the message says why. Its rules are then not tested."""


@dataclass(frozen=True)
class Scenario:
    """One scenario.

    Attributes:
        name: of the function.
        play: talks to the device and returns a trace. Its parameters are names of pytest fixtures.
        needs: what the run must have.
        leaves: how the device is left.
        stage: when its turn comes.
        summary: the first line of the function's docstring.
    """

    name: str
    play: Callable[..., Any]
    needs: frozenset[Need]
    leaves: Leaves
    stage: Stage
    summary: str

    @property
    def fixtures(self) -> tuple[str, ...]:
        """The names of the fixtures that it is played with."""
        return tuple(inspect.signature(self.play).parameters)


def scenario(
    *, needs: Collection[Need], leaves: Leaves = Leaves.AT_REST, stage: Stage = Stage.MOTION
) -> Callable[[Callable[..., Any]], Scenario]:
    """Return a decorator that makes a scenario of a function.

    The function raises NotPossibleError where the device cannot play it, and PartialTraceError where it broke off.
    """

    def made(play: Callable[..., Any]) -> Scenario:
        summary = (inspect.getdoc(play) or "").partition("\n")[0]
        return Scenario(play.__name__, play, frozenset(needs), leaves, stage, summary)

    return made


class PartialTraceError(Exception):
    """A scenario broke off: the trace up to there is judged, and the cause is the error's ``__cause__``.

    Args:
        trace: what was recorded so far.
    """

    def __init__(self, trace: Any) -> None:
        super().__init__("the scenario broke off")
        self.trace = trace


@dataclass
class Recording:
    """A scenario that was played.

    Attributes:
        trace: what it recorded; None where there is nothing to judge.
        reason: why it could not be played, or an empty text.
        error: why it broke off, or None.
    """

    trace: Any = None
    reason: str = ""
    error: Exception | None = None


@dataclass
class Recordings:
    """The recordings of one run: each scenario is played once, when its first rule needs it."""

    #: By the scenario's name.
    played: dict[str, Recording] = field(default_factory=dict)

    def of(self, scenario: Scenario, fixture: Callable[[str], Any]) -> Recording:
        """Return a scenario's recording; play it where it was not played before.

        Args:
            scenario: which.
            fixture: returns a fixture of the run by its name.
        """
        if scenario.name not in self.played:
            self.played[scenario.name] = _play(scenario, fixture)
        return self.played[scenario.name]


def _play(scenario: Scenario, fixture: Callable[[str], Any]) -> Recording:
    try:
        return Recording(scenario.play(**{name: fixture(name) for name in scenario.fixtures}))
    except NotPossibleError as impossible:
        return Recording(reason=str(impossible))
    except PartialTraceError as partial:
        cause = partial.__cause__
        return Recording(partial.trace, error=cause if isinstance(cause, Exception) else partial)
    except Exception as error:  # noqa: BLE001 - each rule of the scenario meets it, and a verdict comes of it
        return Recording(error=error)
