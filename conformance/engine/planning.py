"""``roaas certify --plan``: the order of scenarios and checks, without sending anything."""

import os
from pathlib import Path
from types import ModuleType

import pytest

from conformance.contract.locating import GENERIC_RULES, module_of
from conformance.contract.pack import Contract
from conformance.engine.checks_plugin import ChecksPlugin, is_check
from conformance.engine.robot_under_test import RobotUnderTest
from conformance.scenarios.plan import Step, plan_lines
from conformance.verdict.finding import count_of

_SUITE = Path(__file__).parents[1]
_UNUSED = ("terminal", "cacheprovider", "doctest", "logging", "junitxml", "unraisableexception", "threadexception")


def pytest_options() -> list[str]:
    """Return the options that make pytest run the checks and ignore the current folder's configuration."""
    return [
        f"--config-file={os.devnull}",
        f"--rootdir={_SUITE}",
        f"--confcutdir={_SUITE}",  # otherwise pytest would list every folder above the suite
        "--import-mode=importlib",
        "--noconftest",  # otherwise pytest would also run the conftest files above the checks; see conftests()
        "--capture=no",
        "-Wignore",
        "--assert=plain",
        *(f"-pno:{name}" for name in _UNUSED),
    ]


def conftests(contract: Contract) -> list[ModuleType]:
    """Return the modules ``conftest.py`` in a pack's own checks, as pytest plugins."""
    own = [path for folder in contract.rules if folder != GENERIC_RULES for path in folder.rglob("conftest.py")]
    return [module_of(path) for path in sorted(own)]


def collect_checks(robot: RobotUnderTest, plugin: ChecksPlugin | None = None) -> list[pytest.Item]:
    """Return the checks of a run in their order; the robot need not be connected."""
    seen: list[pytest.Item] = []

    class _Collected:
        """A pytest plugin that stores the collected items."""

        def pytest_collection_finish(self, session: pytest.Session) -> None:
            """Store the items."""
            seen.extend(item for item in session.items if is_check(item))

    collect(robot, plugin or ChecksPlugin(lambda: robot, lambda: robot.run.contract), _Collected())
    return seen


def collect(robot: RobotUnderTest, *plugins: object) -> None:
    """Collect the checks of a run with pytest, with further plugins."""
    with pytest.MonkeyPatch.context() as environment:
        environment.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")
        environment.delenv("PYTEST_ADDOPTS", raising=False)
        folders = map(str, robot.run.contract.rules)
        pytest.main([*folders, *pytest_options(), "--collect-only"], plugins=[*conftests(robot.run.contract), *plugins])


def plan_of(robot: RobotUnderTest) -> list[str]:
    """Return the plan of a run as lines of text; the robot need not be connected."""
    plugin = ChecksPlugin(lambda: robot, lambda: robot.run.contract)
    seen: list[Step] = [plugin.step_of(item) for item in collect_checks(robot, plugin)]
    scenarios = {step.scenario.name for step in seen if step.scenario}
    moving = sum(step.moves for step in seen)
    counts = count_of(len(seen), "check"), count_of(len(scenarios), "scenario"), count_of(moving, "check")
    first = "{}, {}; {} may move the device.".format(*counts)
    motion = "" if robot.run.allow_motion else " They are skipped without --allow-motion."
    return [first + motion, *filter(None, [robot.estimate(measured=False)]), *plan_lines(seen)]
