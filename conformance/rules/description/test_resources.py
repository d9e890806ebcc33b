"""Lists, methods, entity tags and conditions; checkers judge what these scenarios send (RFC 9110 9, 13)."""

from collections.abc import Iterable

import pytest

from conformance.api.rest.interface import RestInterface
from conformance.api.rest.values import Values
from conformance.scenarios.lists import Paged, pages_of_lists, vary_lists
from conformance.scenarios.neighbours import neighbours
from conformance.scenarios.own_things import own_things
from conformance.scenarios.rule import Outcome, rule
from conformance.scenarios.survey import Survey
from conformance.verdict.case import Case


@rule("description/head", on=(neighbours,))
def head(_trace: Survey) -> tuple[Outcome, ...]:
    """Play the reads by HEAD; `checkers.resources` judges them."""
    return ()


@rule("description/method-refused", on=(own_things,))
def method_refused(_trace: Survey) -> tuple[Outcome, ...]:
    """Play the requests by undeclared methods; `checkers.resources` judges them."""
    return ()


@rule("description/entity-tag", on=(own_things,))
def entity_tag(_trace: Survey) -> tuple[Outcome, ...]:
    """Play the writes of single members; `checkers.entity_tags` judges the tags."""
    return ()


@rule("description/if-match", on=(own_things,))
def if_match(_trace: Survey) -> tuple[Outcome, ...]:
    """Play the writes by conditions; `checkers.entity_tags` judges them."""
    return ()


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
    for one in trace:
        yield Case(not one.fault, one.found, one.expected, one.fault, cause=f"{one.operation} {one.way}")
