"""The pytest plugin that collects rules as checks: each plays its scenario once per run and judges the trace."""

import sys
from typing import Any

import pytest

from conformance.scenarios.rule import Rule, record
from conformance.scenarios.scenario import Recordings, Scenario
from conformance.scenarios.stage import Need
from conformance.verdict.evidence import Judge


def is_imported(rule: Rule, module: str) -> bool:
    """Return whether a rule is another module's: its function stands there, and so does the rule itself.

    Where a function of another module has only made it, the rule stands nowhere else.
    """
    home = rule.judge.__module__
    return home != module and any(item is rule for item in vars(sys.modules[home]).values())


class RulesPlugin:
    """A pytest plugin for one run.

    Args:
        recordings: the recordings of the run; a scenario is played when its first rule needs it.
    """

    def __init__(self, recordings: Recordings) -> None:
        self.recordings = recordings
        self._fixtures = dict[pytest.Collector, Any]()

    def pytest_pycollect_makeitem(
        self, collector: pytest.Module | pytest.Class, name: str, obj: object
    ) -> list[pytest.Item] | None:
        """Make one pytest item for each scenario of a rule."""
        if not isinstance(obj, Rule) or is_imported(obj, collector.obj.__name__):
            return None
        return [self._item(collector, name, obj, scenario) for scenario in obj.on]

    def _item(self, collector: pytest.Module | pytest.Class, name: str, rule: Rule, scenario: Scenario) -> pytest.Item:
        marks = [pytest.mark.requirement(rule.requirement), pytest.mark.phase(scenario.stage)]
        marks += [pytest.mark.scenario(scenario), pytest.mark.rule(rule, scenario)]
        marks += [pytest.mark.needs(*map(str, scenario.needs - {Need.MOTION}))]
        marks += [pytest.mark.motion] if Need.MOTION in scenario.needs else []
        known = self._fixtures.get(collector)  # the checks of a module have the same arguments
        item = pytest.Function.from_parent(
            collector, name=f"{name}[{scenario.name}]", callobj=self._check_of(rule, scenario), fixtureinfo=known
        )
        self._fixtures[collector] = item._fixtureinfo  # noqa: SLF001
        for mark in marks:
            item.add_marker(mark)
        return item

    def _check_of(self, rule: Rule, scenario: Scenario) -> Any:
        def check(request: pytest.FixtureRequest, judge: Judge) -> None:
            recording = self.recordings.of(scenario, request.getfixturevalue)
            if recording.trace is not None:

                def report(operation: str, error: Exception) -> None:
                    judge.fault(operation, error, [rule.requirement])

                record(judge, rule.requirement, rule.outcomes_apart(recording.trace, request.getfixturevalue, report))
            if recording.error is not None:
                # Raise the error that ended the scenario even if the trace is usable.
                raise recording.error

        return check
