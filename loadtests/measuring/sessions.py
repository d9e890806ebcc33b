"""Which users a process runs: those that a pacer wakes, or those of a scenario."""

from collections.abc import Sequence
from typing import Any

from loadtests.clients.robot import Robot
from loadtests.measuring.scenario import ScenarioSession
from loadtests.measuring.user_session import Session
from loadtests.settings.settings import Scenario


def new_session(
    environment: Any,
    robots: Sequence[Robot],
    operations: tuple[str, ...],
    seed: int,
    *,
    library: bool,
    scenario: Scenario | None,
) -> Session | ScenarioSession:
    """Return a process's users; the arguments are those of `Session` and `ScenarioSession`.

    Raises:
        GeneratorError: the scenario cannot be used.
    """
    if scenario is None:
        return Session(environment, robots, operations, seed, library=library)
    return ScenarioSession(environment, robots[0], operations, scenario)
