"""Life cycles: a created or written thing can be read, stays while others change, and ends when deleted.

RFC 9110 15.3.2, 9.3.4, 9.3.5, 15.5.
"""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from http import HTTPStatus

import pytest

from conformance.api.rest.interface import RestInterface
from conformance.api.rest.things import is_marked_deleted
from conformance.api.rest.values import Values
from conformance.documents.json_text import read_json
from conformance.scenarios.ending import Deletion, Ended, begin_and_end, look_at_ended, used_things
from conformance.scenarios.keys import REFUSED_BODY, Keyed, repeated_keys
from conformance.scenarios.lifecycles import lifecycles
from conformance.scenarios.living import Kind, Life
from conformance.scenarios.no_effects import no_effects
from conformance.scenarios.rule import Outcome, rule
from conformance.scenarios.safe_reads import Watched, safe_reads
from conformance.scenarios.tables import Table, tables
from conformance.scenarios.whole_list import read_items
from conformance.scenarios.writing import Writer
from conformance.verdict.evidence import SENTENCE, Case

_DONE = frozenset({HTTPStatus.OK, HTTPStatus.NO_CONTENT})
# Ways to repeat a key that need no sentence of the description.
_OF_KEYS = frozenset({"same request", "new key", REFUSED_BODY})


def _looks(trace: tuple[Life, ...], kind: Kind) -> Iterator[Case]:
    """Yield a case for each look of a kind."""
    for look in (look for life in trace for look in life.looks if look.kind is kind):
        cause = f"{look.operation} {kind}"
        yield Case(not look.other, look.found, look.expected, look.other, cause=cause, doubt=look.doubt)


@rule("description/created-is-there", on=(lifecycles,))
def created_is_there(trace: tuple[Life, ...]) -> Iterable[Outcome]:
    """Judge whether a created thing is found under its identifier, and stays there."""
    for life in (life for life in trace if life.create):
        there = life.found.response.status not in {HTTPStatus.NOT_FOUND, HTTPStatus.GONE}
        expected = f"the thing that {life.create} has created with status {life.created.response.status}"
        yield Case(there, life.found, expected, cause=life.read)
        if there and life.id and life.found_id:
            expected = f"the thing with the identifier {life.id}, which {life.create} has created"
            same = life.id.casefold() == life.found_id.casefold()
            yield Case(same, life.found, expected, f"the thing with the identifier {life.found_id}", cause=life.read)
    yield from _looks(trace, Kind.THERE)


@rule("description/written-is-read", on=(lifecycles,))
def written_is_read(trace: tuple[Life, ...]) -> Iterable[Outcome]:
    """Judge whether written values are read again, also later."""
    for write in (write for life in trace for write in life.writes):
        expected = f"what {write.operation} wrote with status {write.sent.response.status}"
        found, cause = "; ".join(write.other), write.operation
        yield Case(not write.other, write.found, expected, found, cause=cause, doubt=write.doubt)
    yield from _looks(trace, Kind.KEPT)


@rule("description/deleted-is-gone", on=(lifecycles,))
def deleted_is_gone(trace: tuple[Life, ...]) -> Iterable[Outcome]:
    """Judge whether a deleted thing is no longer served, alone or in the list."""
    for life in trace:
        if life.deleted is None or life.gone is None or life.deleted.response.status not in _DONE:
            continue
        # A deleted thing that can be restored may still be read, if it is marked as deleted.
        if not is_marked_deleted(read_json(life.gone.response.body).value):
            expected, is_gone = f"status 404 or 410 after {life.delete}", not life.gone.response.ok
            yield Case(is_gone, life.gone, expected, cause=life.read, doubt=life.doubt)
    yield from _looks(trace, Kind.GONE)


@rule("description/refused-keeps", on=(lifecycles,))
def refused_keeps(trace: tuple[Life, ...]) -> Iterable[Outcome]:
    """Judge whether requests that were answered 4xx have changed nothing."""
    yield from _looks(trace, Kind.REFUSED)


@rule("description/deleted-is-gone", on=(used_things,))
def nothing_refers_to_what_is_gone(trace: tuple[Deletion, ...]) -> Iterable[Outcome]:
    """Judge whether a thing was deleted although another one refers to it, which breaks the reference."""
    for deletion in trace:
        shown = deletion.deleted if deletion.fault else deletion.user
        expected = "a refusal with 409, as the description says of what is in use, or no reference to it any more"
        found = f"{shown.came}: {deletion.fault}"
        yield Case(not deletion.fault, shown, expected, found, cause=deletion.operation, doubt=SENTENCE)


@rule("description/same-values", on=(lifecycles,))
def same_values(trace: tuple[Life, ...]) -> Iterable[Outcome]:
    """Judge whether a list shows its items with the values that they have themselves."""
    yield from _looks(trace, Kind.SHOWN)


@rule("description/list-order", on=(lifecycles,))
def created_in_order(trace: tuple[Life, ...]) -> Iterable[Outcome]:
    """Judge whether a list is in order of creation, as its description says."""
    yield from (replace(case, doubt=SENTENCE) for case in _looks(trace, Kind.ORDER))


@rule("description/list-filter", on=(lifecycles,))
def chosen_by_value(trace: tuple[Life, ...]) -> Iterable[Outcome]:
    """Judge whether a filter goes by the values that things have now."""
    yield from _looks(trace, Kind.CHOSEN)


@rule("description/same-values", on=(tables,))
def same_rows(trace: tuple[Table, ...]) -> Iterable[Outcome]:
    """Judge whether a list as CSV has the rows and the numbers that it has as JSON."""
    for table in trace:
        yield Case(not table.fault, table.shown, table.expected, table.fault, cause=table.operation)


@rule("description/idempotency-key", on=(repeated_keys,))
def idempotency_key(trace: tuple[Keyed, ...]) -> Iterable[Outcome]:
    """Judge whether a key stands for one request: it is performed once, and no other request gets its response."""
    for creation in trace:
        yield Case(
            not creation.fault,
            creation.shown,
            creation.expected,
            creation.fault,
            cause=f"{creation.operation} {creation.way}",
            doubt="" if creation.way in _OF_KEYS else SENTENCE,
        )


@rule("description/safe", on=(safe_reads, no_effects))
def safe(trace: tuple[Watched, ...]) -> Iterable[Outcome]:
    """Judge whether safe requests leave values unchanged that clients write."""
    for watch in (one for one in trace if one.is_safe):
        yield Case(not watch.fault, watch.shown, watch.expected, watch.fault, cause=watch.operation)


@rule("description/refused-keeps", on=(no_effects,))
def refused_without_effect(trace: tuple[Watched, ...]) -> Iterable[Outcome]:
    """Judge whether requests that are refused for their credentials or media type change nothing."""
    for watch in (one for one in trace if not one.is_safe):
        yield Case(False, watch.shown, watch.expected, watch.fault, cause=watch.operation)


@rule("description/written-is-read", on=(safe_reads,))
def settings_stay(trace: tuple[Watched, ...]) -> Iterable[Outcome]:
    """Judge whether settings stay as they were written while other things are created, changed and deleted."""
    for watch in (one for one in trace if not one.is_safe):
        cause, doubt = f"{watch.operation} kept", "a setting may follow the things that there are"
        yield Case(not watch.fault, watch.shown, watch.expected, watch.fault, cause=cause, doubt=doubt)


@pytest.fixture(scope="session")
def begun() -> list[Ended]:
    """Return the list of things that were begun and ended, which is read again at the end."""
    return []


@pytest.mark.phase("input")
@pytest.mark.needs("rest")
@pytest.mark.requirement("description/states", "description/refused-keeps")
def test_what_goes_on(api: RestInterface, values: Values, begun: list[Ended]) -> None:
    """Begin and cancel things that have a state; `checkers.changes` judges all reads of a run."""
    begun += begin_and_end(api, values)


@pytest.mark.phase("late")
@pytest.mark.needs("rest")
@pytest.mark.requirement("description/states", "description/refused-keeps")
def test_what_has_ended(api: RestInterface, values: Values, begun: list[Ended]) -> None:
    """Read again the things that were begun, and cancel those that are done."""
    look_at_ended(api, values, begun)


@pytest.mark.phase("late")
@pytest.mark.needs("rest")
@pytest.mark.requirement("description/own-identifier")
def test_items_of_lists(api: RestInterface, values: Values) -> None:
    """Read some items of each list in a row, and the first one again; a checker judges all reads of a run."""
    read_items(Writer(api, values))
