"""Lists in every style: parameters that do what they say are never blamed, and those that do not are."""

import json
from urllib.parse import urlencode

import pytest
from small_device import answers, described

from conformance.api.rest.listing import items_of
from conformance.checkers.lists import is_before
from conformance.checkers.rest import RestCheckers
from conformance.contract.described import write_described_pack
from conformance.contract.pack import Contract
from conformance.transport.exchange import Exchange, Request, Response

BASE = "http://device:8000"
LIMIT, FILTER, ORDER, TOTAL, PAGES = (
    f"description/list-{name}" for name in ("limit", "filter", "order", "total", "pages")
)
_STATES, _LEVELS, _WAYS = ["open", "closed", "moving"], ["info", "warning", "error"], ["asc", "desc"]
_MEMBERS = {
    "id": {"type": "integer"},
    "name": {"type": "string"},
    "zone": {"type": ["string", "null"]},
    "state": {"type": "string", "enum": _STATES},
    "level": {"type": "string", "enum": _LEVELS},
    "active": {"type": "boolean"},
    "archived": {"type": "boolean"},
    "tags": {"type": "array", "items": {"type": "string", "enum": ["a", "b"]}},
    "opened": {"type": ["string", "null"], "format": "date-time"},
    "size": {"type": "number"},
}
_ITEM = {"type": "object", "properties": _MEMBERS}
_NAMES = ("id", "name", "zone", "state", "level", "active", "tags", "size", "opened")
VALVES = [
    dict(zip(_NAMES, row, strict=True))
    for row in (
        (1, "alpha", "north", "open", "info", True, ["a"], 3, "2026-01-02T00:00:00Z"),
        (2, "bravo", "south", "closed", "error", False, ["b"], 1, None),
        (3, "charlie", "north", "moving", "warning", True, ["a", "b"], 2.5, "2026-01-01T00:00:00+02:00"),
        (4, "delta", "south", "open", "info", False, [], 2, "2025-12-01T00:00:00Z"),
    )
]


def _whole(name, **schema):
    return {"name": name, "in": "query", "schema": {"type": "integer", **schema}}


def _text(name, **schema):
    return {"name": name, "in": "query", "schema": {"type": "string", **schema}}


def _bool(name, **schema):
    return {"name": name, "in": "query", "schema": {"type": "boolean", **schema}}


def _of(value):
    """Return a schema for an envelope whose innermost list has valves."""
    if isinstance(value, list):
        return {"type": "array", "items": _ITEM}
    inner = {name: _of(one) for name, one in value.items() if isinstance(one, dict | list)}
    inner |= {"total_items": {"type": "integer", "description": "How many, whatever the page."}}
    return {"type": "object", "properties": inner}


class Seen:
    """The requirements that are not met in a run of exchanges with one list."""

    def __init__(self, tmp_path, parameters, wrapped=lambda items: items, says=""):
        get = {"responses": {"200": answers(_of(wrapped([])))}, "parameters": list(parameters), "summary": says}
        document = described(
            {"/valves": {"get": get, "post": {"responses": {"201": {"description": "made"}}}}}, "3.1.0"
        )
        self.checkers = RestCheckers(Contract.load(write_described_pack(tmp_path, document, document)), BASE)
        self.wrapped, self.now, self.cases = wrapped, 1000.0, []

    def read(self, items, headers=(), after=1.0, body=None, **query):
        """Judge one list."""
        octets = json.dumps(self.wrapped(items) if body is None else body).encode()
        target = f"/valves?{urlencode(query, safe=',')}" if query else "/valves"
        return self._judge("GET", target, 200, (("Content-Type", "application/json"), *headers), octets, after)

    def write(self):
        """Judge a POST."""
        return self._judge("POST", "/valves", 201, (), b"", 0.1)

    def _judge(self, method, target, status, headers, octets, after):
        self.now += after
        request = Request(method, BASE + target, (("Host", "device:8000"),))
        exchange = Exchange(request, Response(status, headers, octets, 1.0, received_s=self.now))
        self.cases += [one for one in self.checkers(exchange) if one.requirement.startswith("description/list-")]
        return self

    @property
    def broken(self):
        return {one.requirement for one in self.cases if not one.holds}

    @property
    def judged(self):
        return {one.requirement for one in self.cases}


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
    seen = Seen(tmp_path, [_whole(name, **schema), _text("ids")])
    assert (LIMIT in seen.read(VALVES[:count], **query).broken) == blamed


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
    assert (_served(raised)(Seen(tmp_path, [_whole("limit")]), *limits) == {LIMIT}) == blamed


def test_a_short_list_may_be_shorter_than_the_least_limit(tmp_path):
    for count, doubts in ((4, [True]), (12, [False])):
        seen = Seen(tmp_path / str(count), [_whole("limit")]).read([{"id": one} for one in range(count)], limit=1)
        assert [bool(one.doubt) for one in seen.cases if not one.holds] == doubts


def test_a_default_that_is_not_applied(tmp_path):
    for default, blamed in ((4, {LIMIT}), (2, set())):
        seen = Seen(tmp_path / str(default), [_whole("limit", default=default)])
        for count, query in ((2, {}), (3, {"limit": 3}), (4, {"limit": 4})):
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
    assert Seen(tmp_path, [_whole("limit")], ENVELOPES[envelope]).read(VALVES, limit=1).broken == {LIMIT}


_XML_ITEM = {
    "type": "object",
    "xml": {"name": "valve"},
    "properties": {"id": _MEMBERS["id"], "state": _MEMBERS["state"]},
}
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
        "parameters": [_whole("limit"), _text("state", enum=_STATES)],
    }
    document = described({"/valves": {"get": get}}, "3.1.0")
    checkers = RestCheckers(Contract.load(write_described_pack(tmp_path, document, document)), BASE)
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


_EXACT = {**_text("level", enum=_LEVELS), "description": "Exactly this level."}


@pytest.mark.parametrize(
    ("parameter", "query", "keep", "blamed"),
    [
        (_text("state", enum=_STATES), {"state": "open"}, lambda one: one["state"] != "closed", True),
        (_text("filter[state]", enum=_STATES), {"filter[state]": "open"}, lambda _: True, True),
        (_bool("active"), {"active": "true"}, lambda _: True, True),
        (_bool("active"), {"active": "false"}, lambda one: one["active"], True),
        (_text("tags", enum=["a", "b"]), {"tags": "a"}, lambda _: True, True),
        (_text("level", enum=_LEVELS), {"level": "warning"}, lambda _: True, True),
        (_text("state", enum=_STATES), {"state": "open"}, lambda one: one["state"] == "open", False),
        (_text("state", enum=[*_STATES, "all"]), {"state": "all"}, lambda _: True, False),
        (_text("level", enum=_LEVELS), {"level": "warning"}, lambda one: one["level"] != "info", False),
        (_EXACT, {"level": "warning"}, lambda one: one["level"] != "info", True),
        (_text("tags", enum=["a", "b"]), {"tags": "a"}, lambda one: "a" in one["tags"], False),
        (_bool("active", default=False), {"active": "false"}, lambda _: True, False),
        (_bool("archived"), {"archived": "true"}, lambda _: True, False),
        (_text("name"), {"name": "a"}, lambda _: True, False),
        (_text("state", enum=["OPEN"]), {"state": "OPEN"}, lambda _: True, False),
        (_text("zone"), {"zone": "north"}, lambda _: True, False),
        (_whole("size"), {"size": 2}, lambda one: one["size"] >= 2, False),
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


def test_a_filter_that_takes_a_list_allows_each_of_it(tmp_path):
    parameter = {**_text("state"), "schema": {"type": "array", "items": _MEMBERS["state"]}, "explode": False}
    seen = Seen(tmp_path, [parameter]).read(VALVES)
    assert not seen.read([one for one in VALVES if one["state"] != "moving"], state="open,closed").broken
    assert seen.read(VALVES, state="open,closed").broken == {FILTER}


def test_a_text_is_ignored_only_where_each_of_two_values_gives_the_others_items(tmp_path):
    seen = Seen(tmp_path, [_text("zone")]).read(VALVES)
    assert not seen.read(VALVES, zone="north").broken
    assert not seen.read([one for one in VALVES if one["zone"] == "south"], zone="south").broken
    assert seen.read(VALVES, zone="south").broken == {FILTER}


def test_an_item_that_changes_while_it_is_read_is_not_judged(tmp_path):
    seen = Seen(tmp_path, [_text("state", enum=_STATES)]).read(VALVES)
    turned = [{**VALVES[0], "state": "moving"}]
    assert not seen.read(turned, state="open").broken
    assert seen.read(turned, state="open").broken == {FILTER}


_SORT = _text("sort", enum=["name", "-name", "size", "opened:desc", "state", "id"])


@pytest.mark.parametrize(
    ("parameters", "query", "order", "blamed"),
    [
        ([_SORT], {"sort": "name"}, "2134", True),
        ([_SORT], {"sort": "-name"}, "1234", True),
        ([_SORT], {"sort": "size"}, "1234", True),
        ([_SORT], {"sort": "opened:desc"}, "4321", True),
        ([_text("order_by", enum=["size_desc"])], {"order_by": "size_desc"}, "2431", True),
        ([_text("sort", enum=["size"])], {"sort": "size"}, "3124", False),
        ([_text("sort", enum=["size"])], {"sort": "size"}, "1324", True),
        ([_text("sort", enum=["-size"])], {"sort": "-size"}, "1342", False),
        ([_text("sort", enum=["size"])], {"sort": "size"}, "4231", True),
        ([_text("sort", enum=["size"]), _text("order", enum=_WAYS)], {"sort": "size", "order": "desc"}, "2431", True),
        ([_text("sort", enum=["-id"], default="-id")], {}, "1234", True),
        ([_text("sortBy", enum=["id"]), _text("sortDir", enum=_WAYS, default="asc")], {"sortBy": "id"}, "1342", True),
        ([_SORT], {"sort": "name"}, "1234", False),
        ([_SORT], {"sort": "-name"}, "4321", False),
        ([_SORT], {"sort": "size"}, "1342", False),
        ([_SORT], {"sort": "id"}, "4321", False),
        ([_SORT], {"sort": "opened:desc"}, "1342", False),
        ([_SORT], {"sort": "opened:desc"}, "2134", False),
        ([_SORT], {"sort": "state"}, "1234", False),
        ([_text("sort", enum=["size"]), _bool("reverse")], {"sort": "size"}, "1234", False),
        ([_text("sort")], {"sort": "size"}, "1234", False),
    ],
)  # fmt: skip
def test_orders(parameters, query, order, blamed, tmp_path):
    items = [VALVES[int(number) - 1] for number in order]
    assert (ORDER in Seen(tmp_path, parameters).read(VALVES).read(items, **query).broken) == blamed


@pytest.mark.parametrize("told", [4, 2])
def test_a_total_of_all_pages(told, tmp_path):
    def wrapped(items, total=4):
        return {"items": items, "total_items": total, "next": "/valves?offset=2"}

    seen = Seen(tmp_path, [_whole("limit"), _whole("offset")], wrapped)
    seen.read(VALVES).read(VALVES[2:], body=wrapped(VALVES[2:3], told), limit=1, offset=2).read(VALVES)
    assert (TOTAL in seen.broken) == (told != 4)


@pytest.mark.parametrize(("count", "blamed"), [(2, False), (3, True)])
def test_a_limit_that_holds_on_the_first_page_holds_on_all(count, blamed, tmp_path):
    seen = Seen(tmp_path, [_whole("limit"), _whole("offset")]).read(VALVES).read(VALVES[:2], limit=2)
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
    parameters = [_bool("include_archived", default=False), _text("zone", enum=["north", "south"])]
    items = [{**VALVES[0], **shown}]
    seen = Seen(tmp_path, parameters).read(items, include_archived="true").read(items, **query)
    assert (FILTER in seen.broken) == blamed


@pytest.mark.parametrize(
    ("says", "order", "blamed"),
    [
        ("Valves, newest first.", "4321", True),
        ("Valves, newest first.", "1234", False),
        ("The oldest valves first.", "134", True),
        ("As they were opened, oldest first.", "4321", False),
        ("All valves.", "4321", False),
    ],
)
def test_an_order_that_the_description_tells(says, order, blamed, tmp_path):
    seen = Seen(tmp_path, [], says=says).read([VALVES[int(number) - 1] for number in order])
    assert (ORDER in seen.broken) == blamed
    assert all(case.doubt for case in seen.cases if case.requirement == ORDER)


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


def _totalled(name, of=len):
    return lambda items: {"items": items, name: of(items)}


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
    seen = Seen(tmp_path, [_whole("limit"), _whole("page"), _text("state", enum=_STATES)])
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
    seen = Seen(tmp_path, [_whole("limit"), _whole("offset")], lambda items: {"items": items, "links": around})
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
def test_searches(says, text, found, blamed, tmp_path):
    seen = Seen(tmp_path, [{**_text("q"), "description": says}])
    assert (FILTER in seen.read(VALVES).read(found, q=text).read(VALVES).broken) == blamed


def test_a_total_that_counts_what_was_deleted_is_noticed(tmp_path):
    for name in ("total", "totalElements", "count"):
        seen = Seen(tmp_path / name, [_whole("limit"), _whole("offset")], _totalled(name)).read(VALVES).write()
        assert not seen.read(VALVES[1:], body={"items": VALVES[1:], name: 4}).broken, "it may be late"
        assert seen.read(VALVES[1:], body={"items": VALVES[1:], name: 4}, after=4.0).broken == {TOTAL}


def test_a_total_that_is_wrong_now_and_then_is_noticed(tmp_path):
    seen = Seen(tmp_path, [], _totalled("total")).read(VALVES)
    for _ in range(2):
        seen.read(VALVES).read(VALVES, body={"items": VALVES, "total": 5}, after=4.0)
    assert seen.broken == {TOTAL}


def test_a_header_and_a_filtered_total_are_judged_alike(tmp_path):
    def many(number):
        return [("X-Total-Count", str(number))]

    seen = Seen(tmp_path, [_text("state", enum=_STATES)])
    seen.read(VALVES, many(4)).read([VALVES[1]], many(1), state="closed")
    assert not seen.broken
    seen.read([VALVES[1]], many(4), after=4.0, state="closed").read([VALVES[1]], many(4), after=4.0, state="closed")
    assert seen.broken == {TOTAL}


def test_a_total_that_is_wrong_beside_a_part_is_noticed(tmp_path):
    for name in ("total", "count"):
        seen = Seen(tmp_path / name, [_whole("limit"), _whole("offset")], _totalled(name)).read(VALVES)
        for number in (4, 5, 4, 3):
            assert not seen.broken
            seen.read(VALVES[:2], body={"items": VALVES[:2], name: number}, limit=2).read(VALVES)
        assert seen.broken == {TOTAL}


@pytest.mark.parametrize("query", [{}, {"state": "open"}], ids=["all", "filtered"])
def test_a_total_that_is_the_size_of_the_page_is_noticed(query, tmp_path):
    seen = Seen(tmp_path, [_whole("limit"), _text("state", enum=_STATES)], _totalled("total")).read(VALVES)
    every = [*VALVES, {**VALVES[0], "id": 9}]
    seen.read(every)
    of = [one for one in every if one["state"] == "open"] if query else every
    seen.read(of, **query).read(of[:1], limit=1, **query)
    assert not seen.broken, "once may be chance"
    assert seen.read(of[:2], limit=2, **query).broken == {TOTAL}


def test_a_list_that_grows_and_shrinks_by_itself_has_another_total(tmp_path):
    seen = Seen(tmp_path, [_whole("limit", default=3)], _totalled("total"))
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
        seen = Seen(tmp_path / str(size), [_text("state", enum=_STATES)], _totalled("count"))
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
    parameters = [_whole("limit"), _whole("offset"), _text("cursor"), _text("state", enum=_STATES)]
    seen = Seen(tmp_path, parameters, _totalled(name))
    play(seen)
    assert TOTAL not in seen.broken, [one for one in seen.cases if not one.holds]
