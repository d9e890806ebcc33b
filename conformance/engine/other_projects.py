"""The pytest plugin for other projects: ``pytest -p roaas_pytest --pyargs conformance --robot-rest URL``.

It imports the suite only if there is a check to run.
"""

import pytest

from conformance.commandline.secret_file import IN_URL, names_user
from conformance.contract.pack import Contract
from conformance.engine.checks_plugin import ChecksPlugin
from conformance.engine.robot_under_test import RobotUnderTest


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options of the plugin."""
    group = parser.getgroup("robot", "RoAAS: conformance of a robot's web services")
    group.addoption("--robot-statement", metavar="FILE", help="implementation conformance statement (TOML)")
    group.addoption("--robot-contract", metavar="PACK", help="contract pack to judge by: its name or its folder")
    group.addoption("--robot-rest", metavar="URL", help="base URL of the robot's REST interface")
    group.addoption("--robot-publishers-wsdl", metavar="URL", help="WSDL of the publishers service, URL or file")
    group.addoption("--robot-subscribers-wsdl", metavar="URL", help="WSDL of the subscribers service, URL or file")
    group.addoption("--robot-class", action="append", metavar="NAME", help="conformance class to judge (repeatable)")
    group.addoption("--robot-allow-motion", action="store_true", help="the robot may be moved")
    group.addoption("--robot-effort", default="standard", help="quick, standard or deep")
    group.addoption("--robot-seed", type=int, default=0, help="seed of all random cases")
    group.addoption("--robot-timeout", dest="robot_timeout_s", type=float, help="deadline of one request, s")


def pytest_configure(config: pytest.Config) -> None:
    """Register the checks for the robot that the options name."""
    if names_user(config.invocation_params.args):
        raise pytest.UsageError(IN_URL)

    def connect() -> RobotUnderTest:
        from conformance.engine.robot_from_options import robot_from_options  # noqa: PLC0415 - see the module's docstring

        return robot_from_options(config)

    def contract() -> Contract:
        from conformance.contract.pack import DEFAULT_PACK, Contract  # noqa: PLC0415 - see the module's docstring

        return Contract.load(config.getoption("robot_contract") or DEFAULT_PACK)

    config.pluginmanager.register(ChecksPlugin(connect, contract), "roaas-checks")
