"""What an API creates can be read, and is gone when it was deleted (RFC 9110 15.3.2, 9.3.5)."""

from collections.abc import Iterable
from http import HTTPStatus

from conformance.scenarios.lifecycles import Life, lifecycles
from conformance.scenarios.rule import Outcome, rule
from conformance.verdict.case import Case


@rule("description/created-is-there", on=(lifecycles,))
def created_is_there(trace: tuple[Life, ...]) -> Iterable[Outcome]:
    """Judge whether what was created is found under its identifier."""
    for life in trace:
        there = life.found.response.status not in {HTTPStatus.NOT_FOUND, HTTPStatus.GONE}
        expected = f"the thing that {life.create} has created with status {life.created.response.status}"
        yield Case(there, life.found, expected, cause=life.read)


@rule("description/deleted-is-gone", on=(lifecycles,))
def deleted_is_gone(trace: tuple[Life, ...]) -> Iterable[Outcome]:
    """Judge whether what was deleted is not served any more."""
    for life in trace:
        if life.deleted is not None and life.gone is not None and life.deleted.response.status in {200, 204}:
            yield Case(not life.gone.response.ok, life.gone, f"status 404 or 410 after {life.delete}", cause=life.read)
