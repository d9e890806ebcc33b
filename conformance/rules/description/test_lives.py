"""What an API creates or writes can be read, and is gone when it was deleted (RFC 9110 15.3.2, 9.3.4, 9.3.5)."""

from collections.abc import Iterable
from http import HTTPStatus

from conformance.scenarios.lifecycles import Life, lifecycles
from conformance.scenarios.rule import Outcome, rule
from conformance.verdict.case import Case

_DONE = frozenset({HTTPStatus.OK, HTTPStatus.NO_CONTENT})


@rule("description/created-is-there", on=(lifecycles,))
def created_is_there(trace: tuple[Life, ...]) -> Iterable[Outcome]:
    """Judge whether what was created is found under its identifier, with this identifier."""
    for life in trace:
        there = life.found.response.status not in {HTTPStatus.NOT_FOUND, HTTPStatus.GONE}
        expected = f"the thing that {life.create} has created with status {life.created.response.status}"
        yield Case(there, life.found, expected, cause=life.read)
        if there and life.id and life.found_id:
            expected = f"the thing with the identifier {life.id}, which {life.create} has created"
            same = life.id.casefold() == life.found_id.casefold()
            yield Case(same, life.found, expected, f"the thing with the identifier {life.found_id}", cause=life.read)


@rule("description/written-is-read", on=(lifecycles,))
def written_is_read(trace: tuple[Life, ...]) -> Iterable[Outcome]:
    """Judge whether what was written is read."""
    for write in (write for life in trace for write in life.writes):
        expected = f"what {write.operation} wrote with status {write.sent.response.status}"
        yield Case(not write.other, write.found, expected, "; ".join(write.other), cause=write.operation)


@rule("description/deleted-is-gone", on=(lifecycles,))
def deleted_is_gone(trace: tuple[Life, ...]) -> Iterable[Outcome]:
    """Judge whether what was deleted is not served any more, by itself or in the list."""
    for life in trace:
        if life.deleted is None or life.gone is None or life.deleted.response.status not in _DONE:
            continue
        yield Case(not life.gone.response.ok, life.gone, f"status 404 or 410 after {life.delete}", cause=life.read)
        if life.listing is not None and not life.gone.response.ok:
            expected = f"a list without the thing {life.found_id} after {life.delete}"
            yield Case(not life.is_listed, life.listing, expected, "a list with it", cause=f"{life.read} list")
