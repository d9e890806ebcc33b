"""Lists, methods, entity tags and conditions; checkers judge the exchanges of these scenarios (RFC 9110 9, 13)."""

from collections.abc import Iterable

import pytest

from conformance.api.rest.interface import RestInterface
from conformance.api.rest.values import Values
from conformance.scenarios.lists import Paged, pages_of_lists, vary_lists
from conformance.scenarios.neighbours import neighbours
from conformance.scenarios.own_things import ANOTHER, own_things
from conformance.scenarios.rule import Outcome, Rule, rule
from conformance.scenarios.scenario import Scenario
from conformance.scenarios.survey import Survey
from conformance.verdict.evidence import Case


def _player(name: str, scenario: Scenario) -> Rule:
    """Return the rule that plays requests; checkers of resources, tags and contents judge each of the run."""
    return rule(f"description/{name}", on=(scenario,))(lambda _trace: ())


head = _player("head", neighbours)
method_refused, entity_tag = _player("method-refused", own_things), _player("entity-tag", own_things)
if_match, digest = _player("if-match", own_things), _player("digest", own_things)
problem_status = _player("problem-status", own_things)
patch, read_only = _player("patch", own_things), _player("read-only", own_things)


@pytest.mark.phase("late")
@pytest.mark.needs("rest")
@pytest.mark.requirement(
    "description/list-limit", "description/list-filter", "description/list-order", "description/list-total"
)
def test_parameters_of_lists(api: RestInterface, values: Values) -> None:
    """Send each list the values of its parameters; checkers judge these responses, like those of all other checks."""
    vary_lists(api, values)


@rule("description/list-pages", on=(pages_of_lists,))
def list_pages(trace: tuple[Paged, ...]) -> Iterable[Outcome]:
    """Judge whether the parts of a list are the list, each item once."""
    for paging in trace:
        cause, fault = f"{paging.operation} {paging.way}", paging.fault
        yield Case(not fault, paging.found, paging.expected, fault, cause=cause, doubt=paging.doubt)


@rule("description/list-pages", on=(own_things,))
def list_pages_below(trace: Survey) -> Iterable[Outcome]:
    """Judge the same of lists below a thing."""
    return list_pages.judge(tuple(paging for paging in trace.paged if paging.way != ANOTHER))


@rule("description/own-identifier", on=(own_things,))
def own_items(trace: Survey) -> Iterable[Outcome]:
    """Judge whether what was created below a thing is not below another one."""
    return list_pages.judge(tuple(paging for paging in trace.paged if paging.way == ANOTHER))
