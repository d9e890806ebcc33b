"""``roaas certify --plan``: what would be done in which order, without sending anything."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from conformance.engine.checks_plugin import ChecksPlugin, is_check
from conformance.scenarios.plan import Step, told

if TYPE_CHECKING:
    from conformance.engine.robot_under_test import RobotUnderTest

_SUITE = Path(__file__).parents[1]
_UNUSED = ("terminal", "cacheprovider", "logging", "junitxml", "unraisableexception", "threadexception")


def pytest_options() -> list[str]:
    """Return the options with which pytest runs the checks, and nothing of the folder that the user is in."""
    return [
        f"--config-file={os.devnull}",
        f"--rootdir={_SUITE}",
        "--import-mode=importlib",
        "--capture=no",
        "-Wignore",
        "--assert=plain",
        *(f"-pno:{name}" for name in _UNUSED),
    ]


def collected(robot: RobotUnderTest, plugin: ChecksPlugin | None = None) -> list[pytest.Item]:
    """Return the checks of a run on a robot, which need not be connected, in the order of their turns."""
    seen: list[pytest.Item] = []

    class _Collected:
        """Takes down the checks that were collected."""

        def pytest_collection_finish(self, session: pytest.Session) -> None:
            """Take them down."""
            seen.extend(item for item in session.items if is_check(item))

    collect(robot, plugin or ChecksPlugin(lambda: robot, lambda: robot.run.contract), _Collected())
    return seen


def collect(robot: RobotUnderTest, *plugins: object) -> None:
    """Have pytest collect the checks of a run on a robot, as the run does, with plugins that look on."""
    with pytest.MonkeyPatch.context() as environment:
        environment.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")
        environment.delenv("PYTEST_ADDOPTS", raising=False)
        folders = map(str, robot.run.contract.rules)
        pytest.main([*folders, *pytest_options(), "--collect-only"], plugins=list(plugins))


def plan_of(robot: RobotUnderTest) -> list[str]:
    """Return the plan of a run on a robot, which need not be connected, in lines."""
    plugin = ChecksPlugin(lambda: robot, lambda: robot.run.contract)
    seen: list[Step] = [plugin.step_of(item) for item in collected(robot, plugin)]
    scenarios = {step.scenario.name for step in seen if step.scenario}
    moving = sum(step.moves for step in seen)
    first = f"{len(seen)} checks, {len(scenarios)} scenarios; {moving} checks may move the device."
    motion = "" if robot.run.allow_motion else " They are skipped without --allow-motion."
    return [first + motion, *told(seen)]
