"""Totals of lists: one that counts the items as it did is never blamed, and one that does not is."""

import pytest
from exchanges import broken, exchange, failed
from small_device import answers, contract_of, described
from valve_lists import BASE, STATES, TOTAL, VALVES, Seen, whole, word


@pytest.mark.parametrize("told", [4, 2])
def test_a_total_of_all_pages(told, tmp_path):
    def wrapped(items, total=4):
        return {"items": items, "total_items": total, "next": "/valves?offset=2"}

    seen = Seen(tmp_path, [whole("limit"), whole("offset")], wrapped)
    seen.read(VALVES).read(VALVES[2:], body=wrapped(VALVES[2:3], told), limit=1, offset=2).read(VALVES)
    assert (TOTAL in seen.broken) == (told != 4)


def _totalled(name, of=len):
    return lambda items: {"items": items, name: of(items)}


def test_a_total_that_counts_what_was_deleted_is_noticed(tmp_path):
    for name in ("total", "totalElements", "count"):
        seen = Seen(tmp_path / name, [whole("limit"), whole("offset")], _totalled(name)).read(VALVES).write()
        assert not seen.read(VALVES[1:], body={"items": VALVES[1:], name: 4}).broken, "it may be late"
        assert seen.read(VALVES[1:], body={"items": VALVES[1:], name: 4}, after=4.0).broken == {TOTAL}


def test_a_total_that_is_wrong_now_and_then_is_noticed(tmp_path):
    seen = Seen(tmp_path, [], _totalled("total")).read(VALVES)
    for _ in range(2):
        seen.read(VALVES).read(VALVES, body={"items": VALVES, "total": 5}, after=4.0)
    assert seen.broken == {TOTAL}


_PAGED = [(1, 0), (1, 1), (1, 2), (2, 0), (2, 1), (3, 0)]


@pytest.mark.parametrize(
    ("shown", "blamed"),
    [
        (lambda limit, offset: (limit, offset), False),
        (lambda limit, _: (limit, 0), True),
        (lambda _, offset: (9, offset), True),
        (lambda limit, offset: (min(limit, 2), offset), False),
    ],
    ids=["as it is", "always the first place", "always the same limit", "a lower limit"],
)
def test_members_that_are_named_as_paging_parameters(shown, blamed, tmp_path):
    seen = Seen(tmp_path, [whole("limit"), whole("offset")], _totalled("total"))
    for limit, offset in _PAGED:
        told, place = shown(limit, offset)
        items = VALVES[offset : offset + (min(told, limit))]
        body = {"items": items, "total": len(VALVES), "limit": told, "offset": place}
        seen.read(items, body=body, limit=limit, offset=offset)
    assert ("description/list-pages" in seen.broken) == blamed


def test_a_place_that_is_rounded_has_the_same_items(tmp_path):
    seen = Seen(tmp_path, [whole("limit"), whole("offset")], _totalled("total"))
    for offset in (0, 1, 2, 3):
        place = offset - offset % 2
        body = {"items": VALVES[place : place + 2], "total": len(VALVES), "limit": 2, "offset": place}
        seen.read(body["items"], body=body, limit=2, offset=offset)
    assert "description/list-pages" not in seen.broken


def test_a_header_and_a_filtered_total_are_judged_alike(tmp_path):
    def many(number):
        return [("X-Total-Count", str(number))]

    seen = Seen(tmp_path, [word("state", enum=STATES)])
    seen.read(VALVES, many(4)).read([VALVES[1]], many(1), state="closed")
    assert not seen.broken
    seen.read([VALVES[1]], many(4), after=4.0, state="closed").read([VALVES[1]], many(4), after=4.0, state="closed")
    assert seen.broken == {TOTAL}


def test_a_total_that_is_wrong_beside_a_part_is_noticed(tmp_path):
    for name in ("total", "count"):
        seen = Seen(tmp_path / name, [whole("limit"), whole("offset")], _totalled(name)).read(VALVES)
        for number in (4, 5, 4, 3):
            assert not seen.broken
            seen.read(VALVES[:2], body={"items": VALVES[:2], name: number}, limit=2).read(VALVES)
        assert seen.broken == {TOTAL}


@pytest.mark.parametrize("query", [{}, {"state": "open"}], ids=["all", "filtered"])
def test_a_total_that_is_the_size_of_the_page_is_noticed(query, tmp_path):
    seen = Seen(tmp_path, [whole("limit"), word("state", enum=STATES)], _totalled("total")).read(VALVES)
    every = [*VALVES, {**VALVES[0], "id": 9}]
    seen.read(every)
    of = [one for one in every if one["state"] == "open"] if query else every
    seen.read(of, **query).read(of[:1], limit=1, **query)
    assert not seen.broken, "once may be chance"
    assert seen.read(of[:2], limit=2, **query).broken == {TOTAL}


def test_a_header_that_counts_all_matches_by_its_description_is_no_size_of_a_page(tmp_path):
    for field, expected in (({"description": "How many valves match the filters."}, {TOTAL}), ({}, set())):
        headers = {"X-Total-Count": {"schema": {"type": "integer"}, **field}}
        seen = Seen(tmp_path / str(len(field)), [whole("limit")], headers=headers)
        seen.read(VALVES, [("X-Total-Count", "4")]).read(VALVES[:1], [("X-Total-Count", "1")], limit=1)
        assert seen.broken == expected


def test_a_list_that_grows_and_shrinks_by_itself_has_another_total(tmp_path):
    seen = Seen(tmp_path, [whole("limit", default=3)], _totalled("total"))
    for count in (2, 3, 3, 2, 3, 3):
        seen.read(VALVES[:count])
    assert not seen.broken


def _changed_beside(seen):
    for number in range(5):
        seen.read(VALVES[:3]).read(VALVES[:1], body={"items": VALVES[:1], "total": 3}, limit=1)
        seen.write().read(VALVES[:1], body={"items": VALVES[:1], "total": 4}, limit=1).write()
        seen.read(VALVES[: 3 + number % 2])


def _page_count(seen):
    seen.read(VALVES).read(VALVES[2:], offset=2).read(VALVES[:1], limit=1).read(VALVES[1:2], limit=1, offset=1)


def _all_unfiltered(seen):
    seen.read(VALVES)
    for _ in range(3):
        seen.read(VALVES[:1], body={"items": VALVES[:1], "total": 4}, after=4.0, state="open")


def _estimated(seen):
    for number in (3, 5, 9):
        seen.read(VALVES, body={"items": VALVES, "total": number}, after=4.0)


def _capped(seen):
    seen.read(VALVES)
    for _ in range(3):
        seen.read(VALVES[2:], body={"items": VALVES, "total": 50}, after=4.0, offset=60, limit=4)


def _late(seen):
    seen.read(VALVES).write()
    for total in (4, 4, 3):
        seen.read(VALVES[1:], body={"items": VALVES[1:], "total": total}, after=0.5)
    seen.read(VALVES[1:], after=9.0)


def _cut_by_server(seen):
    many = [{"id": number} for number in range(20)]
    seen.read(many, body={"items": many, "total": 20}).write()
    for _ in range(3):
        seen.read(many, body={"items": many, "total": 21}, after=4.0)


def test_a_list_without_parts_may_be_cut_at_many_items(tmp_path):
    for size, blamed in ((20, set()), (15, {TOTAL})):
        seen = Seen(tmp_path / str(size), [word("state", enum=STATES)], _totalled("count"))
        items = [{"id": number} for number in range(size)]
        seen.read(items).write()
        for _ in range(3):
            seen.read(items, body={"items": items, "count": size + 1}, after=4.0)
        assert seen.broken == blamed


def _cursor(seen):
    for _ in range(3):
        seen.read(VALVES[:2], body={"items": VALVES[:2], "total": 4, "next_cursor": "x"}, after=4.0)
        seen.read(VALVES[2:], body={"items": VALVES[2:], "total": 4}, after=4.0, cursor="x")


def _sliding(seen):
    for number in range(9):
        items = [{"id": number + one} for one in range(4)]
        seen.read(items, body={"items": items, "total": 4 + number % 2}, after=0.5)
        seen.read(items, body={"items": items, "total": 4}, after=0.5)


def _beyond(seen):
    for _ in range(3):
        seen.read(VALVES).read([], body={"items": [], "total": 4}, after=4.0, offset=99)


def _nothing(seen):
    seen.read(VALVES)
    for query in ({"limit": 0}, {"offset": 10**12}, {"limit": 10**12, "offset": 5}) * 3:
        seen.read([], body={"items": [], "total": 4}, after=4.0, **query)


def _from_the_end(seen):
    seen.read(VALVES)
    for _ in range(3):
        seen.read(VALVES[3:], body={"items": VALVES[3:], "total": 4}, after=4.0, offset=-1)
        seen.read(VALVES[:3], body={"items": VALVES[:3], "total": 4}, after=4.0, limit=-1)


@pytest.mark.parametrize(
    ("name", "play"),
    [
        ("total", _nothing),
        ("total", _from_the_end),
        ("count", _page_count),
        ("total", _changed_beside),
        ("total", _all_unfiltered),
        ("total", _estimated),
        ("total", _capped),
        ("total", _late),
        ("total", _cut_by_server),
        ("total", _cursor),
        ("total", _sliding),
        ("total", _beyond),
    ],
)
def test_a_total_that_means_something_else_is_not_blamed(name, play, tmp_path):
    parameters = [whole("limit"), whole("offset"), word("cursor"), word("state", enum=STATES)]
    seen = Seen(tmp_path, parameters, _totalled(name))
    play(seen)
    assert TOTAL not in seen.broken, [one for one in seen.cases if not one.holds]


_LITRES = {"id": {"type": "string"}, "litres": {"type": "number"}}
_CRATE = {
    "id": {"type": "string"},
    "bottle_count": {"type": "integer"},
    "whole_litres": {"type": "integer", "description": "The sum of the litres of the bottles."},
    "weight": {"type": "integer", "description": "The sum of the weights of all parts."},
}
_ID = {"name": "id", "in": "path", "required": True, "schema": {"type": "string"}}


def _crate_faults(tmp_path, says, steps):
    """Return the requirements that a crate breaks.

    Args:
        tmp_path: for the description.
        says: summary of the PUT of a crate.
        steps: seconds before a read of the crate and of its bottles, its numbers, and their litres; or a method.
    """
    crate = {"200": answers({"type": "object", "properties": _CRATE})}
    bottles = {"type": "array", "items": {"type": "object", "properties": _LITRES}}
    get = {"get": {"responses": {"200": answers(bottles)}}, "parameters": [_ID]}
    one = {"get": {"responses": crate}, "put": {"summary": says, "responses": crate}, "parameters": [_ID]}
    document = described({"/crates/{id}": one, "/crates/{id}/bottles": get}, "3.1.0")
    now, exchanges = 0.0, []
    for after, *said in steps:
        read = [("GET", "", dict(zip(_CRATE, ("a", *said[:-1]), strict=False)))] if said else [("PUT", "", {})]
        read += [("GET", "/bottles", [{"id": str(n), "litres": n} for n in said[-1]])] if said else []
        for method, below, body in read:
            now += after
            exchanges.append(exchange(method, f"{BASE}/crates/a{below}", shown=body, at_s=now))
    return broken(contract_of(tmp_path, document), BASE, exchanges) & {TOTAL, "description/written-is-read"}


@pytest.mark.parametrize(
    ("says", "steps", "blamed"),
    [
        ("", [(1, 2, 3, [1, 2]), (1,), (4, 2, 3, [3])], {TOTAL}),
        ("", [(1, 2, 3, [1, 2]), (1,), (0.5, 2, 3, [3])], set()),
        ("", [(4, 1, 3, [1, 2]), (4, 1, 3, [1, 2])], set()),
        ("", [(4, 2, 2, [1, 2])], {TOTAL}),
        ("", [(4, 2, 3, 9, [1, 2])], set()),
        ("The bottles stay.", [(1, 2, 3, [1, 2]), (1,), (1, 0, 0, [])], {"description/written-is-read"}),
        ("The bottles stay.", [(1, 2, 3, [1, 2]), (1,), (1, 3, 6, [1, 2, 3])], set()),
        ("Empties the crate.", [(1, 2, 3, [1, 2]), (1,), (1, 0, 0, [])], set()),
    ],
)
def test_numbers_of_a_thing_agree_with_the_list_below_it(says, steps, blamed, tmp_path):
    assert _crate_faults(tmp_path, says, steps) == blamed


@pytest.mark.parametrize(
    ("says", "counts", "blamed"),
    [
        ("Number of crates", [2, 2], True),
        ("Number of crates", [2, 3], False),
        ("Number of crates", [1, 2], False),  # never right: it may count something else
        ("Number of crates that are open", [2, 2], False),
        ("", [2, 2], False),
    ],
)
def test_the_number_of_items_that_another_resource_tells(says, counts, blamed, tmp_path):
    count = {"type": "object", "properties": {"crates": {"type": "integer", "description": says}}}
    crates = {"type": "array", "items": {"type": "object", "properties": {"id": {"type": "string"}}}}
    made = {"post": {"responses": {"201": answers({"type": "object"})}}}
    paths = {"/stats": {"get": {"responses": {"200": answers(count)}}}}
    paths["/crates"] = {"get": {"responses": {"200": answers(crates)}}, **made}
    exchanges = []
    for turn, number in enumerate(counts):
        items, now = [{"id": str(one)} for one in range(2 + turn)], 10.0 * turn
        exchanges += [
            exchange("POST", f"{BASE}/crates", shown={}, at_s=now),
            exchange("GET", f"{BASE}/crates", shown=items, at_s=now + 5),
            exchange("GET", f"{BASE}/stats", shown={"crates": number}, at_s=now + 5),
        ]
    found = failed(contract_of(tmp_path, described(paths, "3.1.0")), BASE, exchanges)
    assert [case.doubt for case in found if case.requirement == TOTAL] == ["it may count only now and then"] * blamed
