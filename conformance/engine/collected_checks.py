"""The checks that judge each requirement, without a device: pytest collects them, as in a run."""

from collections import defaultdict
from dataclasses import dataclass, replace
from functools import cache

import pytest

from conformance.contract.ledger import expanded
from conformance.contract.locating import GENERIC_RULES, ContractError
from conformance.contract.pack import DEFAULT_PACK, Contract
from conformance.engine.checks_plugin import ChecksPlugin
from conformance.engine.planning import collect
from conformance.engine.robot_under_test import RobotUnderTest
from conformance.statement.statement import empty_statement
from conformance.verdict.run import Run


@dataclass(frozen=True)
class Check:
    """One check.

    Attributes:
        name: as ``module::function``.
        does: what it does, the first line of its docstring.
        scenarios: what the scenarios do whose traces it judges; empty for a check that sends its own requests.
    """

    name: str
    does: str
    scenarios: tuple[str, ...] = ()


class _Checks:
    """A pytest plugin that records the requirement ids in the markers of every check, including unknown ids."""

    def __init__(self, contract: Contract) -> None:
        self._ledger, self._everywhere = contract.ledger, contract.name == DEFAULT_PACK
        self._renamed = contract.ids_by_alias
        self.found: dict[str, dict[str, Check]] = defaultdict(dict)
        self.broken = ""

    def pytest_itemcollected(self, item: pytest.Item) -> None:
        """Record the requirement ids of one check."""
        marked = (id_ for mark in item.iter_markers("requirement") for id_ in mark.args)
        # Conventional checks of the generic suite apply only to packs whose ledger has their requirement.
        own = self._everywhere or GENERIC_RULES not in item.path.parents
        for part in expanded(marked, self._ledger):
            id_ = self._renamed.get(part, part)
            if own or id_ in self._ledger:
                check = _describe(item)
                earlier = self.found[id_].get(check.name, check)
                self.found[id_][check.name] = replace(
                    check, scenarios=tuple(dict.fromkeys([*earlier.scenarios, *check.scenarios]))
                )

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        """Record the error when a module with checks cannot be imported."""
        if report.failed and not self.broken:
            self.broken = f"{report.nodeid} cannot be imported: {report.longrepr}"


def _describe(item: pytest.Item) -> Check:
    """Return a collected check; for a rule, only its combination with this scenario."""
    name = f"{item.path.stem}::{item.name.partition('[')[0]}"
    mark = item.get_closest_marker("rule")
    if mark is None:
        return Check(name, _first_line(getattr(item, "function", None)))
    rule, scenario = mark.args
    return Check(name, _first_line(rule.judge), (scenario.summary,))


def _first_line(function: object) -> str:
    return (getattr(function, "__doc__", None) or "").strip().partition("\n")[0]


@cache
def checks_of(contract: Contract) -> dict[str, tuple[Check, ...]]:
    """Return the checks by requirement id, by module; pytest collects them from their markers, as in a run.

    Raises:
        ContractError: a module with checks cannot be imported.
    """
    checks = _Checks(contract)
    run = Run(statement=empty_statement(contract), contract=contract, claims=tuple(contract.classes))
    robot = RobotUnderTest(run)
    collect(robot, ChecksPlugin(lambda: robot, lambda: contract), checks)
    if checks.broken:
        raise ContractError(checks.broken)
    return {
        id_: tuple(sorted(there.values(), key=lambda check: check.name.partition("::")[0]))
        for id_, there in checks.found.items()
    }
