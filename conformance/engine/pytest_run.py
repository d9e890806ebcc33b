"""Make a robot from pytest's options, for ``pytest -p roaas_pytest --pyargs conformance`` in another project."""

from pathlib import Path

import msgspec
import pytest

from conformance.contract.locating import ContractError
from conformance.contract.pack import DEFAULT_PACK, Contract
from conformance.engine.robot_under_test import RobotUnderTest
from conformance.statement.statement import Endpoints, StatementError, empty_statement, load_statement
from conformance.transport.client import Connection
from conformance.transport.credentials import Credential, Credentials, Kind
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
    effort = config.getoption("robot_effort")
    if effort not in EFFORTS:
        raise pytest.UsageError(f"--robot-effort {effort}: there are {', '.join(EFFORTS)}")
    run = Run(
        statement=statement,
        claims=statement.claimed(contract),
        contract=contract,
        allow_motion=config.getoption("robot_allow_motion"),
        seed=config.getoption("robot_seed"),
        effort=Effort(effort),
    )
    robot = RobotUnderTest(run, connection_of(where))
    robot.connect()
    if not robot.reached:
        raise pytest.UsageError(f"the robot cannot be reached: {run.unreachable}")
    return robot


def _endpoints(config: pytest.Config, declared: Endpoints) -> Endpoints:
    names = ("rest", "publishers_wsdl", "subscribers_wsdl", "timeout_s")
    options = {name: config.getoption(f"robot_{name}") for name in names}
    return msgspec.structs.replace(declared, **{key: value for key, value in options.items() if value is not None})


def connection_of(where: Endpoints) -> Connection:
    """Return connection settings with the statement's deadline, credentials and rate limit.

    Raises:
        OSError: a file with a credential cannot be read.
        StatementError: a credential is malformed.
    """
    return Connection(
        timeout_s=where.timeout_s,
        ca_file=Path(where.ca_file) if where.ca_file else None,
        token=_secret(where.token_file) if where.token_file else None,
        credentials=_credentials(where),
        certificate=_certificate(where),
        request_rate=where.request_rate,
    )


def _secret(path: str) -> str:
    return Path(path).read_text(encoding="utf-8").strip()


def _certificate(where: Endpoints) -> tuple[Path, Path | None] | None:
    if where.client_cert_file is None:
        return None
    return Path(where.client_cert_file), Path(where.client_key_file) if where.client_key_file else None


def _credentials(where: Endpoints) -> Credentials:
    """Return the credentials beside the bearer token; their secrets are in files.

    Raises:
        StatementError: one is malformed; the message shows no secret.
        OSError: a file cannot be read.
    """
    found: list[Credential] = []
    if where.basic_file:
        pair = _secret(where.basic_file)
        if ":" not in pair:
            raise StatementError(f"{where.basic_file}: expected one line user:password")
        found.append(Credential(Kind.BASIC, pair))
    if where.api_key or where.api_key_file:
        place, _, name = (where.api_key or "").partition(" ")
        if place not in {Kind.HEADER, Kind.QUERY, Kind.COOKIE} or not name.strip() or not where.api_key_file:
            raise StatementError("an API key needs api_key = 'header NAME' (or query, or cookie) and api_key_file")
        found.append(Credential(Kind(place), _secret(where.api_key_file), name.strip()))
    for number, line in enumerate(_secret(where.headers_file).splitlines() if where.headers_file else (), 1):
        name, colon, value = line.partition(":")
        if not colon or not name.strip():
            raise StatementError(f"{where.headers_file}, line {number}: expected Name: value")
        found.append(Credential(Kind.HEADER, value.strip(), name.strip()))
    return Credentials(tuple(found))
