"""The parameters of lists do what they say, and pages together are the list."""

from collections.abc import Iterable

import pytest

from conformance.api.rest.interface import RestInterface
from conformance.api.rest.values import Values
from conformance.scenarios.lists import Paged, pages_of_lists, vary_lists
from conformance.scenarios.rule import Outcome, rule
from conformance.verdict.case import Case


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
