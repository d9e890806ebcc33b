"""Fixtures: one server in front of a robot that is not ours, shared by a module's tests."""

from collections.abc import Iterator

import pytest
from web_messages import delivery_path, twist
from web_robot import ForeignRobot, Served, eventually, running_robot

NAMES = ("robot", "a", ".example")  # by which tests ask for the robot


# Not for the session: they compute all the time, and each process that shares the tests would have them to its end.
@pytest.fixture(scope="module")
def foreign_of_module(module_domain_id: int) -> Iterator[ForeignRobot]:
    with ForeignRobot(module_domain_id, "Twist") as robot:
        yield robot


@pytest.fixture(scope="module")
def served_of_module(
    module_domain_id: int, foreign_of_module: ForeignRobot, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Served]:
    config = tmp_path_factory.mktemp("config") / "robot.toml"
    # A velocity of one test does not end in another one.
    config.write_text("[web]\nread_deadline = 1.0\nhold = 600.0\n")
    names = [f"--allowed-host={name}" for name in NAMES]
    with running_robot(module_domain_id, "--attach", f"--config={config}", *names) as served:
        # A message published before the other side is connected would be lost.
        eventually(lambda: served.call("GET", "/robot/pose/").status_code == 200)
        eventually(lambda: served.call("PUT", delivery_path()).status_code == 204)
        foreign_of_module.next("delivery")
        eventually(lambda: served.call("PUT", "/robot/velocity/", json=twist()).status_code == 200)
        foreign_of_module.next("velocity")
        yield served


@pytest.fixture
def foreign(foreign_of_module: ForeignRobot, served_of_module: Served) -> Iterator[ForeignRobot]:
    """The foreign robot, at rest before and after each test."""
    yield foreign_of_module
    if served_of_module.call("DELETE", "/robot/navigation/action/goal/").status_code == 204:
        foreign_of_module.forget_until("cancel")
    foreign_of_module.forget()


@pytest.fixture
def served(served_of_module: Served, foreign: ForeignRobot) -> Served:  # noqa: ARG001 - its clean-up is wanted
    return served_of_module
