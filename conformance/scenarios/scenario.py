"""Scenarios: functions that operate a device and return a trace, without judging it."""

import inspect
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from conformance.scenarios.stage import Leaves, Need, Stage


class NotPossibleError(Exception):
    """Raised when a scenario cannot be played on this device, with the reason. Its rules are then not tested."""


class NoOccasionError(NotPossibleError):
    """Raised when the device gave no opportunity, such as a goal in reach. The verdicts of other checks stay."""


class NotSeenError(NotPossibleError):
    """Raised when the device's state did not allow the scenario. Its rules then have no record to judge."""


class NotDeclaredError(NotPossibleError):
    """Raised when the statement lacks a declaration for the scenario. Requirements only it tests are not claimed."""


@dataclass(frozen=True)
class Scenario:
    """One scenario.

    Attributes:
        name: name of the function.
        play: operates the device and returns a trace. Its parameters are names of pytest fixtures.
        needs: what the run must have.
        leaves: the state in which the device is left.
        stage: the stage of the run that it belongs to.
        summary: first line of the function's docstring.
    """

    name: str
    play: Callable[..., Any]
    needs: frozenset[Need]
    leaves: Leaves
    stage: Stage
    summary: str

    @property
    def fixtures(self) -> tuple[str, ...]:
        """The names of the fixtures that the function takes."""
        return tuple(inspect.signature(self.play).parameters)


def scenario(
    *, needs: Collection[Need], leaves: Leaves = Leaves.AT_REST, stage: Stage = Stage.MOTION
) -> Callable[[Callable[..., Any]], Scenario]:
    """Return a decorator that turns a function into a scenario.

    The function raises NotPossibleError if the device cannot play it, and PartialTraceError if it was aborted.
    """

    def make(play: Callable[..., Any]) -> Scenario:
        summary = (inspect.getdoc(play) or "").partition("\n")[0]
        return Scenario(play.__name__, play, frozenset(needs), leaves, stage, summary)

    return make


class PartialTraceError(Exception):
    """Raised when a scenario was aborted. The trace so far is judged; ``__cause__`` is the reason.

    Args:
        trace: what was recorded so far.
    """

    def __init__(self, trace: Any) -> None:
        super().__init__("the scenario broke off")
        self.trace = trace


@contextmanager
def partial_trace(trace: Callable[[], Any]) -> Iterator[None]:
    """Raise PartialTraceError with the record so far if the block is aborted."""
    try:
        yield
    except Exception as error:
        raise PartialTraceError(trace()) from error


@dataclass
class Recording:
    """The result of playing a scenario.

    Attributes:
        trace: the trace, or None if there is nothing to judge.
        error: why it could not be played, or was aborted; or None.
    """

    trace: Any = None
    error: Exception | None = None


@dataclass
class Recordings:
    """The recordings of one run. Each scenario is played once, when its first rule needs it."""

    #: By the scenario's name.
    played: dict[str, Recording] = field(default_factory=dict)

    def of(self, scenario: Scenario, fixture: Callable[[str], Any]) -> Recording:
        """Return the recording of a scenario, after playing it if necessary.

        Args:
            scenario: the scenario.
            fixture: returns a fixture of the run by its name.
        """
        if scenario.name not in self.played:
            self.played[scenario.name] = _play(scenario, fixture)
        return self.played[scenario.name]


def _play(scenario: Scenario, fixture: Callable[[str], Any]) -> Recording:
    try:
        return Recording(scenario.play(**{name: fixture(name) for name in scenario.fixtures}))
    except PartialTraceError as partial:
        cause = partial.__cause__
        return Recording(partial.trace, error=cause if isinstance(cause, Exception) else partial)
    except Exception as error:  # noqa: BLE001 - each rule of the scenario meets it, and a verdict comes of it
        return Recording(error=error)
