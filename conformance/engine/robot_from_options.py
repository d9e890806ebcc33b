"""Make a robot from pytest's options, for ``pytest -p roaas_pytest --pyargs conformance`` in another project."""

from pathlib import Path

import msgspec
import pytest

from conformance.commandline.endings import end_like_ctrl_c
from conformance.commandline.extras import lacking_soap
from conformance.contract.locating import ContractError
from conformance.contract.pack import DEFAULT_PACK, Contract
from conformance.engine.robot_under_test import RobotUnderTest
from conformance.statement.endpoints import Endpoints
from conformance.statement.statement import StatementError, empty_statement, load_statement
from conformance.target.connecting import connection_of
from conformance.verdict.effort import EFFORTS, Effort
from conformance.verdict.run import Run


def robot_from_options(config: pytest.Config) -> RobotUnderTest:
    """Return the connected robot that the options name.

    Raises:
        pytest.UsageError: no robot is named, an option is invalid, or the robot does not respond.
    """
    given = config.getoption("robot_statement")
    try:
        contract = Contract.load(config.getoption("robot_contract") or DEFAULT_PACK)
        statement = load_statement(Path(given), contract) if given else empty_statement(contract)
    except (StatementError, ContractError) as error:
        raise pytest.UsageError(str(error)) from error
    statement = msgspec.structs.replace(statement, endpoints=_endpoints(config, statement.endpoints))
    classes = config.getoption("robot_class")
    if classes:
        unknown = sorted(set(classes) - set(contract.classes))
        if unknown:
            raise pytest.UsageError(f"--robot-class {unknown[0]}: there are {', '.join(contract.classes)}")
        statement = msgspec.structs.replace(statement, claims=tuple(classes))
    where = statement.endpoints
    if not where.interfaces:
        raise pytest.UsageError("name a robot: --robot-rest, --robot-publishers-wsdl or --robot-subscribers-wsdl")
    problem = lacking_soap(where.interfaces)
    if problem:
        raise pytest.UsageError(problem)
    effort = config.getoption("robot_effort")
    if effort not in EFFORTS:
        raise pytest.UsageError(f"--robot-effort {effort}: there are {', '.join(EFFORTS)}")
    claims = statement.claims_of(contract)
    if statement.claims is None:
        # A pytest test passes or fails, so classes beside the verdict are left out.
        claims = tuple(name for name in claims if not contract.classes[name].beside)
    run = Run(
        statement=statement,
        claims=claims,
        contract=contract,
        allow_motion=config.getoption("robot_allow_motion"),
        seed=config.getoption("robot_seed"),
        effort=Effort(effort),
    )
    robot = RobotUnderTest(run, connection_of(where))
    end_like_ctrl_c()  # pytest ends its session, which stops the robot
    robot.connect()
    if not robot.was_reached:
        raise pytest.UsageError(f"the robot cannot be reached: {run.unreachable}")
    return robot


def _endpoints(config: pytest.Config, declared: Endpoints) -> Endpoints:
    names = ("rest", "publishers_wsdl", "subscribers_wsdl", "timeout_s")
    options = {name: config.getoption(f"robot_{name}") for name in names}
    return msgspec.structs.replace(declared, **{key: value for key, value in options.items() if value is not None})
