"""The suite's own judgement of what is sent again: by the observers, answer by answer, or by a requirement's checks."""

from __future__ import annotations

import tempfile
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

from conformance.api.rest.interface import RestInterface
from conformance.api.rest.observers import Observer
from conformance.contract.pack import Contract
from conformance.engine.certification import certify
from conformance.engine.pytest_run import connection_of
from conformance.engine.robot_under_test import RobotUnderTest
from conformance.statement.statement import empty_statement
from conformance.transport.client import Connection, HttpClient
from conformance.verdict.effort import Effort
from conformance.verdict.run import Run

if TYPE_CHECKING:
    from collections.abc import Collection

    from conformance.statement.statement import Statement
    from conformance.transport.exchange import Exchange


def observed_to_fail(contract: Contract, base_url: str, requirement: str, exchange: Exchange) -> bool:
    """Whether the observers of REST, which judge each answer by itself, find a requirement not met in an exchange.

    Args:
        contract: by which the exchange was judged.
        base_url: of the robot's REST interface.
        requirement: its id.
        exchange: any; one with another interface fails nothing.
    """
    run = Run(empty_statement(contract), contract)
    with closing(HttpClient(base_url, Connection())) as client:
        api = RestInterface(run, client)
        for observer in (Observer(api), *api.device.observers(api)):
            observer.answered(exchange)
    evidence = run.judge.evidence.get(requirement)
    return bool(evidence and evidence.failures)


def judged_by_checks(
    contract: Contract,
    statement: Statement,
    requirements: Collection[str],
    *,
    allow_motion: bool,
    seed: int,
    effort: str,
) -> list[dict[str, Any]]:
    """Run the checks of some requirements, and no others, on a robot.

    Args:
        contract: by which it is judged.
        statement: of the robot.
        requirements: their ids.
        allow_motion: whether the robot may be moved.
        seed: of everything random, as in the run before.
        effort: as in the run before.

    Returns:
        The requirements as in result.json, in the ledger's order.

    Raises:
        ContractError: there is no such requirement.
        OSError: a file that the statement names cannot be read.
    """
    contract = Contract.load(contract.directory, only=tuple(sorted(requirements)))
    classes = {item.class_ for item in contract.ledger.values()}
    run = Run(
        statement=statement,
        contract=contract,
        claims=tuple(name for name in contract.classes if name in classes),
        allow_motion=allow_motion,
        seed=seed,
        effort=Effort(effort),
    )
    with tempfile.TemporaryDirectory() as folder:
        certification = certify(RobotUnderTest(run, connection_of(statement.endpoints)), Path(folder))
    judged: list[dict[str, Any]] = certification.document["requirements"]
    return judged
