"""Lists in every style: parameters that do what they say are never blamed, and those that do not are."""

import json

import pytest
from small_device import answers, contract_of, described
from valve_lists import (
    BASE,
    FILTER,
    LEVELS,
    LIMIT,
    MEMBERS,
    ORDER,
    PAGES,
    STATES,
    VALVES,
    WAYS,
    Seen,
    boolean,
    whole,
    word,
)  # fmt: skip

from conformance.api.rest.listing import items_of, page_of
from conformance.checkers.lists import is_before
from conformance.checkers.rest import RestCheckers
from conformance.documents.openapi import operations_of
from conformance.transport.exchange import Exchange, Request, Response


@pytest.mark.parametrize(
    ("name", "schema", "query", "count", "blamed"),
    [
        ("limit", {}, {"limit": 2}, 3, True),
        ("page[size]", {}, {"page[size]": 2}, 4, True),
        ("$top", {}, {"$top": 1}, 2, True),
        ("per_page", {"maximum": 3}, {"per_page": 3}, 4, True),
        ("pageSize", {"default": 2}, {}, 3, True),
        ("max", {}, {"max": 1}, 4, True),
        ("limit", {}, {"limit": 2}, 2, False),
        ("limit", {}, {"limit": 100}, 4, False),
        ("limit", {}, {"limit": 0}, 4, False),
        ("limit", {"minimum": 3}, {"limit": 1}, 3, False),
        ("limit", {}, {}, 4, False),
        ("limit", {"default": 2}, {"ids": "1,2,3"}, 3, False),
        ("size", {}, {"size": 1}, 4, False),
        ("depth", {}, {"depth": 1}, 4, False),
    ],
)
def test_limits(name, schema, query, count, blamed, tmp_path):
    seen = Seen(tmp_path, [whole(name, **schema), word("ids")])
    assert (LIMIT in seen.read(VALVES[:count], **query).broken) == blamed


@pytest.mark.parametrize(
    ("more", "counts", "blamed"),
    [
        ([], [1, 3, 8], True),
        ([whole("offset")], [1, 3, 8], False),
        ([], [1, 3, 7], False),
        ([], [2, 4, 8], False),
        ([], [2, 3, 8], False),
    ],
)
def test_a_limit_takes_away_what_is_beyond_it_alone(more, counts, blamed, tmp_path):
    seen = Seen(tmp_path, [whole("limit"), *more])
    seen.read(VALVES * 2)
    for limit, count in zip((2, 4, 100), counts, strict=True):
        seen.read((VALVES * 2)[:count], limit=limit)
    assert (LIMIT in seen.broken) == blamed


def _served(raised):
    """Return a device whose limit is raised by a function, and which has eight items."""

    def play(seen, *limits):
        seen.read(VALVES * 2)
        for limit in limits:
            seen.read((VALVES * 2)[: raised(limit)], limit=limit)
        return seen.broken

    return play


@pytest.mark.parametrize(
    ("raised", "limits", "blamed"),
    [
        (lambda limit: max(limit, 3), (1, 3), False),
        (lambda limit: -(-limit // 5) * 5, (1, 5), False),
        (lambda limit: limit + 1, (1, 2), True),
        (lambda _: 8, (1,), True),
        (lambda limit: 2 * limit, (2, 4), True),
    ],
    ids=["to a least one", "to a step", "one more", "ignored", "twice"],
)
def test_a_limit_that_is_raised(raised, limits, blamed, tmp_path):
    assert (_served(raised)(Seen(tmp_path, [whole("limit")]), *limits) == {LIMIT}) == blamed


def test_a_short_list_may_be_shorter_than_the_least_limit(tmp_path):
    for count, doubts in ((4, [True]), (12, [False])):
        seen = Seen(tmp_path / str(count), [whole("limit")]).read([{"id": one} for one in range(count)], limit=1)
        assert [bool(one.doubt) for one in seen.cases if not one.holds] == doubts


def test_a_default_that_is_not_applied(tmp_path):
    for default, last, blamed in ((4, 2, {LIMIT}), (4, 3, set()), (2, 2, set())):
        seen = Seen(tmp_path / f"{default} {last}", [whole("limit", default=default)])
        for count, query in ((2, {}), (3, {"limit": 3}), (4, {"limit": 4}), (last, {})):
            seen.read(VALVES[:count], (("X-Total-Count", "4"),), **query)
        assert seen.broken == blamed


ENVELOPES = {
    "plain": lambda items: items,
    "data": lambda items: {"data": items, "meta": {"x": []}},
    "HAL": lambda items: {"_links": {"self": {"href": "/valves"}}, "_embedded": {"valves": items}, "page": {"size": 5}},
    "OData": lambda items: {"@odata.context": "x", "value": items},
    "nested": lambda items: {"data": {"results": items, "kinds": {"a": 1}}, "errors": []},
    "facets": lambda items: {"facets": [1], "items": items},
}


@pytest.mark.parametrize("envelope", ENVELOPES)
def test_a_list_is_found_in_its_envelope(envelope, tmp_path):
    assert items_of(ENVELOPES[envelope](VALVES)) == VALVES
    assert Seen(tmp_path, [whole("limit")], ENVELOPES[envelope]).read(VALVES, limit=1).broken == {LIMIT}


def test_things_by_their_identifiers_are_a_list(tmp_path):
    places = {"type": "object", "additionalProperties": {"type": "object", "properties": {"joints": {}}}}
    paths = {"/places": {"get": {"responses": {"200": answers(places)}}}}
    (read,) = operations_of(contract_of(tmp_path, described(paths, "3.1.0")))
    body = json.dumps({"home": {"joints": [0]}, "park": {"joints": [1]}, "none": 3}).encode()
    page = page_of(Response(200, (("Content-Type", "application/json"),), body, 1.0), read)
    assert [(one["id"], one["joints"]) for one in page.items] == [("home", [0]), ("park", [1])]


_XML_ITEM = {"type": "object", "xml": {"name": "valve"}, "properties": {"id": MEMBERS["id"], "state": MEMBERS["state"]}}
_XML_LISTS = {
    "plain": ({"type": "array", "items": _XML_ITEM, "xml": {"name": "valves"}}, "<valves>{}</valves>"),
    "wrapped": (
        {"type": "object", "xml": {"name": "answer"}, "properties": {
            "total": {"type": "integer"}, "valves": {"type": "array", "items": _XML_ITEM, "xml": {"wrapped": True}},
        }},
        "<answer><total>4</total><valves>{}</valves></answer>",
    ),
}  # fmt: skip


@pytest.mark.parametrize("style", _XML_LISTS)
@pytest.mark.parametrize(("count", "blamed"), [(2, set()), (4, {LIMIT, FILTER})])
def test_a_list_in_xml_is_judged_by_the_names_of_its_schema(style, count, blamed, tmp_path):
    schema, text = _XML_LISTS[style]
    get = {
        "responses": {"200": answers(schema, "application/xml")},
        "parameters": [whole("limit"), word("state", enum=STATES)],
    }
    document = described({"/valves": {"get": get}}, "3.1.0")
    checkers = RestCheckers(contract_of(tmp_path, document), BASE)
    rows = [
        f"<valve><id>{number}</id><state>{state}</state></valve>"
        for number, state in enumerate(["open"] * 3 + ["closed"])
    ]
    broken = set()
    for target, shown in (("/valves", rows), ("/valves?limit=2&state=open", rows[:count])):
        content = text.format("".join(shown)).encode()
        answer = Response(200, (("Content-Type", "application/xml"),), content, 1.0, received_s=1.0)
        exchange = Exchange(Request("GET", BASE + target, (("Host", "device:8000"),)), answer)
        broken |= {one.requirement for one in checkers(exchange) if not one.holds}
    assert {one for one in broken if one.startswith("description/list-")} == blamed


_EXACT = {**word("level", enum=LEVELS), "description": "Exactly this level."}


@pytest.mark.parametrize(
    ("parameter", "query", "keep", "blamed"),
    [
        (word("state", enum=STATES), {"state": "open"}, lambda one: one["state"] != "closed", True),
        (word("filter[state]", enum=STATES), {"filter[state]": "open"}, lambda _: True, True),
        (boolean("active"), {"active": "true"}, lambda _: True, True),
        (boolean("active"), {"active": "false"}, lambda one: one["active"], True),
        (word("tags", enum=["a", "b"]), {"tags": "a"}, lambda _: True, True),
        (word("level", enum=LEVELS), {"level": "warning"}, lambda _: True, True),
        (word("state", enum=STATES), {"state": "open"}, lambda one: one["state"] == "open", False),
        (word("state", enum=[*STATES, "all"]), {"state": "all"}, lambda _: True, False),
        (word("level", enum=LEVELS), {"level": "warning"}, lambda one: one["level"] != "info", False),
        (_EXACT, {"level": "warning"}, lambda one: one["level"] != "info", True),
        (word("tags", enum=["a", "b"]), {"tags": "a"}, lambda one: "a" in one["tags"], False),
        (boolean("active", default=False), {"active": "false"}, lambda _: True, False),
        (boolean("archived"), {"archived": "true"}, lambda _: True, False),
        (word("name"), {"name": "a"}, lambda _: True, False),
        (word("state", enum=["OPEN"]), {"state": "OPEN"}, lambda _: True, False),
        (word("zone"), {"zone": "north"}, lambda _: True, False),
        (whole("size"), {"size": 2}, lambda one: one["size"] >= 2, False),
    ],
)  # fmt: skip
def test_filters(parameter, query, keep, blamed, tmp_path):
    seen = Seen(tmp_path, [parameter]).read([{**one, "archived": False} for one in VALVES])
    assert (FILTER in seen.read([{**one, "archived": False} for one in VALVES if keep(one)], **query).broken) == blamed


def _bound(name, says="", **schema):
    return {"name": name, "in": "query", "description": says, "schema": {"type": "number", **schema}}


_NOON = "2026-01-01T12:00:00Z"
_WHEN = {"type": "string", "format": "date-time"}


@pytest.mark.parametrize(
    ("parameter", "value", "keep", "blamed"),
    [
        (_bound("min_size", "At least this size."), 2, lambda _: True, True),
        (_bound("since", "Only valves with a greater size."), 2, lambda one: one["size"] >= 2, True),
        (_bound("since", "Only valves with a greater size."), 2, lambda one: one["size"] > 2, False),
        (_bound("since", "Not those with a size greater than this."), 2, lambda one: one["size"] <= 2, False),
        (
            _bound("min_size", "No size greater than or equal to it is left out."),
            2,
            lambda one: one["size"] >= 2,
            False,
        ),
        (_bound("sizeMax", "Sizes up to this."), 2, lambda _: True, True),
        (_bound("size[lte]", "Size <= value."), 2, lambda one: one["size"] >= 2, True),
        (_bound("since", "Only those at or after this time.", **_WHEN), _NOON, lambda one: one["opened"], True),
        (_bound("opened_before", "Only those before.", **_WHEN), _NOON, lambda one: one["opened"], True),
        (_bound("until", "Until then.", **_WHEN), "2025-12-24T00:00:00+02:00", lambda one: one["opened"], True),
        (_bound("min_size", "At least this size."), 2, lambda one: one["size"] >= 2, False),
        (_bound("min_size", "More than this."), 2, lambda one: one["size"] > 2, False),
        (_bound("max_size"), 2, lambda _: True, False),
        (_bound("max_size", "How large a preview is."), 2, lambda _: True, False),
        (_bound("min_width", "At least this width."), 2, lambda _: True, False),
        (_bound("since", "Since then.", **_WHEN), "2026-01-01T00:00:00+02:00", lambda one: one["id"] in {1, 3}, False),
        (_bound("from", "From this item on.", type="string"), "3", lambda one: one["id"] > 3, False),
    ],
)
def test_bounds(parameter, value, keep, blamed, tmp_path):
    kept = [one for one in VALVES if keep(one)]
    seen = Seen(tmp_path, [parameter]).read(VALVES).read(kept, **{parameter["name"]: value})
    assert seen.broken == ({FILTER} if blamed else set())


@pytest.mark.parametrize(
    ("counts", "blamed"), [([(1, 4), (2, 3), (3, 2)], True), ([(1, 2), (2, 4), (3, 3)], False), ([(1, 4)], False)]
)
def test_a_bound_that_nobody_describes_shows_by_its_effect(counts, blamed, tmp_path):
    seen = Seen(tmp_path, [_bound("min_size")]).read(VALVES)
    for bound, count in counts:
        seen.read(sorted(VALVES, key=lambda one: -one["size"])[:count], min_size=bound)
    assert seen.broken == ({FILTER} if blamed else set())


@pytest.mark.parametrize(
    ("name", "kept", "blamed"),
    [
        ("min_level", lambda asked, own: own == asked, True),
        ("min_level", lambda asked, own: own >= asked, False),
        ("levelMax", lambda asked, own: own <= asked, False),
        ("begin_level", lambda asked, own: own == asked, False),
    ],
)
@pytest.mark.parametrize("changes", [True, False])
def test_a_list_from_a_level_on_has_those_above_it(name, kept, blamed, changes, tmp_path):
    seen = Seen(tmp_path, [word(name, enum=LEVELS)]).read(VALVES)
    for level in LEVELS:
        there = [one for one in VALVES if kept(LEVELS.index(level), LEVELS.index(one["level"]))]
        seen.read(there, **{name: level})
        if changes:
            seen.write()
    assert seen.broken == ({FILTER} if blamed and not changes else set())


def test_a_filter_that_takes_a_list_allows_each_of_it(tmp_path):
    parameter = {**word("state"), "schema": {"type": "array", "items": MEMBERS["state"]}, "explode": False}
    seen = Seen(tmp_path, [parameter]).read(VALVES)
    assert not seen.read([one for one in VALVES if one["state"] != "moving"], state="open,closed").broken
    assert seen.read(VALVES, state="open,closed").broken == {FILTER}


def test_a_text_is_ignored_only_where_each_of_two_values_gives_the_others_items(tmp_path):
    seen = Seen(tmp_path, [word("zone")]).read(VALVES)
    assert not seen.read(VALVES, zone="north").broken
    assert not seen.read([one for one in VALVES if one["zone"] == "south"], zone="south").broken
    assert seen.read(VALVES, zone="south").broken == {FILTER}


def test_an_item_that_changes_while_it_is_read_is_not_judged(tmp_path):
    seen = Seen(tmp_path, [word("state", enum=STATES)]).read(VALVES)
    turned = [{**VALVES[0], "state": "moving"}]
    assert not seen.read(turned, state="open").broken
    assert seen.read(turned, state="open").broken == {FILTER}


_SORT = word("sort", enum=["name", "-name", "size", "opened:desc", "state", "id"])


@pytest.mark.parametrize(
    ("parameters", "query", "order", "blamed"),
    [
        ([_SORT], {"sort": "name"}, "2134", True),
        ([_SORT], {"sort": "-name"}, "1234", True),
        ([_SORT], {"sort": "size"}, "1234", True),
        ([_SORT], {"sort": "opened:desc"}, "4321", True),
        ([word("order_by", enum=["size_desc"])], {"order_by": "size_desc"}, "2431", True),
        ([word("sort", enum=["size"])], {"sort": "size"}, "3124", False),
        ([word("sort", enum=["size"])], {"sort": "size"}, "1324", True),
        ([word("sort", enum=["-size"])], {"sort": "-size"}, "1342", False),
        ([word("sort", enum=["size"])], {"sort": "size"}, "4231", True),
        ([word("sort", enum=["size"]), word("order", enum=WAYS)], {"sort": "size", "order": "desc"}, "2431", True),
        ([word("sort", enum=["-id"], default="-id")], {}, "1234", True),
        ([word("sortBy", enum=["id"]), word("sortDir", enum=WAYS, default="asc")], {"sortBy": "id"}, "1342", True),
        ([_SORT], {"sort": "name"}, "1234", False),
        ([_SORT], {"sort": "-name"}, "4321", False),
        ([_SORT], {"sort": "size"}, "1342", False),
        ([_SORT], {"sort": "id"}, "4321", False),
        ([_SORT], {"sort": "opened:desc"}, "1342", False),
        ([_SORT], {"sort": "opened:desc"}, "2134", False),
        ([_SORT], {"sort": "state"}, "1234", False),
        ([word("sort", enum=["size"]), boolean("reverse")], {"sort": "size"}, "1234", False),
        ([word("sort")], {"sort": "size"}, "1234", False),
    ],
)  # fmt: skip
def test_orders(parameters, query, order, blamed, tmp_path):
    items = [VALVES[int(number) - 1] for number in order]
    assert (ORDER in Seen(tmp_path, parameters).read(VALVES).read(items, **query).broken) == blamed


@pytest.mark.parametrize(("count", "blamed"), [(2, False), (3, True)])
def test_a_limit_that_holds_on_the_first_page_holds_on_all(count, blamed, tmp_path):
    seen = Seen(tmp_path, [whole("limit"), whole("offset")]).read(VALVES).read(VALVES[:2], limit=2)
    assert (LIMIT in seen.read(VALVES[1 : 1 + count], limit=2, offset=1).broken) == blamed


@pytest.mark.parametrize(
    ("query", "shown", "blamed"),
    [
        ({}, {"archived": True}, True),
        ({"include_archived": "false"}, {"archived": True}, True),
        ({"include_archived": "true"}, {"archived": True}, False),
        ({}, {"archived": False}, False),
        ({"zone": "north"}, {"zone": None}, True),
        ({"zone": "north"}, {"zone": "north"}, False),
    ],
)
def test_what_a_list_leaves_out(query, shown, blamed, tmp_path):
    parameters = [boolean("include_archived", default=False), word("zone", enum=["north", "south"])]
    items = [{**VALVES[0], **shown}]
    seen = Seen(tmp_path, parameters).read(items, include_archived="true").read(items, **query)
    assert (FILTER in seen.broken) == blamed


@pytest.mark.parametrize(
    ("says", "text", "blamed"),
    [
        ("400 if it is none.", "roaas", True),
        ("400 if it is none.", "b2", False),
        ("Of the page before.", "roaas", False),
    ],
)
def test_a_cursor_that_no_page_has_named(says, text, blamed, tmp_path):
    seen = Seen(tmp_path, [{**word("cursor"), "description": says}]).read(VALVES, cursor=text)
    assert ("description/invalid-refused" in seen.broken) == blamed
    assert all(case.doubt for case in seen.cases if not case.holds)


@pytest.mark.parametrize(
    ("says", "order", "blamed"),
    [
        ("Valves, newest first.", "4321", True),
        ("Valves, newest first.", "1234", False),
        ("The oldest valves first.", "134", True),
        ("As they were opened, oldest first.", "4321", False),
        ("All valves.", "4321", False),
        ("All valves, ordered by name.", "2134", True),
        ("All valves, ordered by name.", "1234", False),
        ("All valves, sorted by `name`.", "4321", False),
        ("All valves, sorted by state.", "2134", False),
        ("All valves, ordered by use.", "2134", False),
    ],
)
def test_an_order_that_the_description_tells(says, order, blamed, tmp_path):
    seen = Seen(tmp_path, [], says=says).read([VALVES[int(number) - 1] for number in order])
    assert (ORDER in seen.broken) == blamed
    assert all(case.doubt for case in seen.cases if case.requirement == ORDER)


@pytest.mark.parametrize(
    ("says", "asked", "blamed"),
    [
        ("Only valves of this zone.", "nor", True),
        ("Only valves of this zone.", "North", False),
        ("Only valves of zones that begin with this text.", "nor", False),
        ("Zone.", "nor", False),
    ],
)
def test_a_filter_that_goes_by_the_whole_value(says, asked, blamed, tmp_path):
    seen = Seen(tmp_path, [{**word("zone"), "description": says}]).read(VALVES).read(VALVES[:1], zone=asked)
    assert (FILTER in seen.broken) == blamed
    assert all(case.doubt for case in seen.cases if not case.holds)


@pytest.mark.parametrize(
    ("one", "other", "said"),
    [
        (1, 2.5, True),
        (3, 3.0, None),
        ("2026-01-01T00:00:00Z", "2026-01-01T00:30:00+01:00", False),
        ("2026-01-01", "2026-02-01", True),
        ("alpha", "bravo", True),
        ("Alpha", "bravo", True),
        ("alpha", "Bravo", None),
        ("item10", "item9", None),
        ("a_b", "ab", None),
        ("é", "f", None),
        ("high", "low", None),
        ("Monday", "Tuesday", None),
        ("10.0.0.9", "10.0.1.0", None),
        (True, False, None),
        ("a", 1, None),
    ],
)
def test_two_values_are_compared_only_where_every_order_agrees(one, other, said):
    assert is_before(one, other) is said


@pytest.mark.parametrize(
    ("query", "links", "blamed"),
    [
        ({"page": 2}, {"next": "page=3", "prev": "page=1", "first": "page=1", "last": "page=9"}, False),
        ({"page": 2}, {"first": "page=0", "prev": "page=1", "last": "page=1"}, False),
        ({"page": 2}, {"next": "page=2"}, True),
        ({"page": 2}, {"next": "page=4"}, True),
        ({"page": 2}, {"prev": "page=2"}, True),
        ({"page": 2}, {"first": "page=2"}, True),
        ({"page": 2}, {"next": "page=3", "last": "page=1"}, True),
        ({"state": "open", "page": 2}, {"next": "state=open&page=3"}, False),
        ({"state": "open", "page": 2}, {"next": "page=3"}, True),
        ({}, {"next": "page=2", "last": "page=4"}, False),
    ],
)
def test_links_to_pages(query, links, blamed, tmp_path):
    field = ", ".join(f'<{BASE}/valves?limit=2&{text}>; rel="{name}"' for name, text in links.items())
    seen = Seen(tmp_path, [whole("limit"), whole("page"), word("state", enum=STATES)])
    assert (PAGES in seen.read(VALVES[:2], [("Link", field)], limit=2, **query).broken) == blamed


@pytest.mark.parametrize(
    ("query", "links", "blamed"),
    [
        ({"limit": 2, "offset": 1}, {"next": "limit=2&offset=3", "prev": "limit=2&offset=0"}, False),
        ({"limit": 2, "offset": 1}, {"first": "limit=2", "last": "limit=2&offset=0"}, False),
        ({"limit": 2}, {"next": "limit=2&offset=4"}, True),
        ({"limit": 2}, {"next": "limit=2&offset=1"}, True),
        ({"limit": 100}, {"next": "limit=100&offset=2"}, False),
        ({"offset": 2}, {"next": "offset=50"}, False),
        ({"offset": 2}, {"next": "offset=2"}, True),
    ],
)
def test_links_by_offset(query, links, blamed, tmp_path):
    around = {name: f"{BASE}/valves?{text}" for name, text in links.items()}
    seen = Seen(tmp_path, [whole("limit"), whole("offset")], lambda items: {"items": items, "links": around})
    assert (PAGES in seen.read(VALVES[:2], **query).broken) == blamed


@pytest.mark.parametrize(
    ("says", "text", "found", "blamed"),
    [
        ("A text that the name contains.", "lph", VALVES[:1], False),
        ("A text that the name contains.", "lph", VALVES[:2], True),
        ("A text that the name contains.", "lph", [], True),
        ("A text that the name contains.", "LPH", [], False),
        ("A text that the name contains, in any case.", "LPH", [], True),
        ("Words that the name contains.", "lph", [], False),
        ("Searches the names.", "lph", VALVES[1:], False),
    ],
)
@pytest.mark.parametrize("name", ["q", "nameContains"])
def test_searches(says, text, found, blamed, name, tmp_path):
    seen = Seen(tmp_path, [{**word(name), "description": says}])
    blamed |= name != "q" and says.startswith("Searches")
    assert (FILTER in seen.read(VALVES).read(found, **{name: text}).read(VALVES).broken) == blamed
