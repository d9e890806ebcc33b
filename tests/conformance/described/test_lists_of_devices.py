"""Devices with lists in every style are certified: right ones are not blamed, and each fault is found at quick."""

import random
import re
import time
from urllib.parse import urlencode

import pytest
from aiohttp import web
from small_device import (
    REFUSED,
    answers,
    body_of,
    certified,
    constant,
    described,
    error,
    object_of,
    reading,
    small_device,
)  # fmt: skip

pytestmark = pytest.mark.side_by_side
LIMIT, FILTER, ORDER, TOTAL, PAGES = (
    f"description/list-{name}" for name in ("limit", "filter", "order", "total", "pages")
)
_STATES, _SORTED = ["open", "closed", "moving"], ["label", "-label", "flow", "-flow"]
_NEW = object_of("label", label={"type": "string", "maxLength": 20})
_VALVE = object_of(
    id={"type": "integer"}, label={"type": "string"}, state={"type": "string", "enum": _STATES}, flow={"type": "number"}
)
_SEARCH = {"in": "query", "name": "q", "description": "A text that the label contains, whatever the case."}
_SEARCH["schema"] = {"type": "string", "minLength": 1}
_BOUND = {"in": "query", "name": "minFlow", "description": "At least this flow.", "schema": {"type": "number"}}
_WHOLE, _ANY = {"type": "integer", "minimum": 0, "maximum": 100}, {"type": "object"}
_TOTALS = {"total": {"type": "integer"}, "count": {"type": "integer"}}
_VALVES = {"type": "array", "items": _VALVE}
# Names of the parameters of each style, the members around its lists, and how to make them of a part and the total.
_STYLES = {
    "offset": {"limit": "limit", "offset": "offset", "in": "items", "around": lambda _, of: {"total": of}},
    "page-1": {"limit": "per_page", "page": "page", "first": 1, "header": "X-Total-Count"},
    "page-0": {"limit": "size", "page": "page", "in": "content", "around": lambda _, of: {"p": {"totalElements": of}}},
    "cursor": {"limit": "limit", "cursor": "cursor", "most": 4, "in": "items", "around": lambda *_: {}},
    "next-page": {"limit": "pageSize", "cursor": "pageToken", "in": "valves", "around": lambda *_: {},
              "next": lambda _, end: {"nextPageToken": f"c{end}"}},
    "HAL": {"limit": "size", "cursor": "after", "in": "_embedded", "around": lambda *_: {"_links": {"self": {}}},
            "next": lambda path, end: {"links": {"next": {"href": f"{path}?after=c{end}"}}}},
    "OData": {"limit": "$top", "offset": "$skip", "in": "value", "around": lambda part, _: {"count": len(part)}},
    "JSON-API": {"limit": "page[size]", "page": "page[number]", "first": 1, "in": "data",
                 "around": lambda _, of: {"meta": {"total": of}}},
    "none": {"in": "results", "around": lambda _, of: {"count": of}},
    "shuffled": {"in": "results", "around": lambda _, of: {"count": of}},
    "sliding": {"limit": "limit", "offset": "offset", "in": "items", "around": lambda _, of: {"total": of}},
    "late": {"limit": "limit", "offset": "skip", "in": "items", "around": lambda _, of: {"total": of}},
    "newest": {"limit": "limit", "in": "items", "around": lambda *_: {}},
    "linked": {"limit": "limit", "offset": "offset", "header": "X-Total-Count"},
    "last": {"limit": "limit", "page": "page", "first": 1, "in": "items", "around": lambda _, of: {"total": of}},
}  # fmt: skip
_FAULTS = [
    ("offset", "limit off by one", LIMIT),
    ("page-1", "filter ignored for one value", FILTER),
    ("JSON-API", "order ignored after many reads", ORDER),
    ("none", "one order ignored", ORDER),
    ("offset", "total counts the deleted", TOTAL),
    ("page-1", "total counts the refused", TOTAL),
    ("cursor", "page repeated", PAGES),
    ("next-page", "the last page leads to the first", PAGES),
    ("next-page", "equal items skipped", PAGES),
    ("page-1", "item left out", PAGES),
    ("OData", "first page beyond the end", PAGES),
    ("offset", "last item lost under a large limit", PAGES),
    ("offset", "total wrong beside a limit", TOTAL),
    ("linked", "links without the filter", PAGES),
    ("page-1", "total of the page beside a filter, next names the same page", TOTAL),
    ("page-1", "total of the page beside a filter, next names the same page", PAGES),
    ("offset", "search finds all, first is the second", FILTER),
    ("offset", "search finds all, first is the second", PAGES),
    ("offset", "filter ignored beside a bound", FILTER),
    ("linked", "filter loses an item", FILTER),
    ("cursor", "order lost on later pages of one order", PAGES),
]


class _Collection:
    """One collection of valves, in one style and with one fault."""

    def __init__(self, path, style, fault=""):
        self.path, self.style, self.fault, self.manner = path, _STYLES[style], fault, style
        self.told, self.told_s = 7, 0.0
        self.valves = [
            {"id": one, "label": f"valve {'gcafbde'[one]}", "state": _STATES[one % 3], "flow": one * 7 % 5 / 2}
            for one in range(7)
        ]
        self.reads, self.created, self.deleted, self.refused = 0, 7, 0, 0

    def described(self):
        """Return its paths."""
        given = [(self.style[role], _WHOLE) for role in ("limit", "offset", "page") if role in self.style]
        given += [("state", {"type": "string", "enum": _STATES}), ("sort", {"type": "string", "enum": _SORTED})]
        search = [_SEARCH, _BOUND] if self.manner == "offset" else []
        given += [(self.style["cursor"], {"type": "string"})] if "cursor" in self.style else []
        shown = (
            {"type": "object", "properties": {self.style["in"]: _VALVES, **_TOTALS}} if "in" in self.style else _VALVES
        )
        key = {"in": "path", "name": "id", "required": True, "schema": {"type": "integer"}}
        bad, body = {"4XX": REFUSED}, body_of(_NEW)
        return {
            self.path: {
                "get": {
                    "parameters": [{"in": "query", "name": name, "schema": schema} for name, schema in given] + search,
                    "responses": {"200": answers(shown), **bad},
                },
                "post": {"requestBody": body, "responses": {"201": answers(_VALVE), **bad}},
            },
            f"{self.path}/{{id}}": {
                "parameters": [key],
                "get": {"responses": {"200": answers(_VALVE), **bad}},
                "delete": {"responses": {"204": {"description": "gone"}, **bad}},
            },
        }

    def routes(self):
        """Return its handlers."""
        return {
            self.path: {"GET": self._list, "POST": self._post},
            f"{self.path}/{{id}}": {"GET": self._get, "DELETE": self._delete},
        }

    def _number(self, request, role, default):
        text = request.query.get(self.style.get(role, ""), str(default)).removeprefix("c")
        return int(text) if text.isascii() and text.isdigit() and int(text) <= 100 else None

    async def _list(self, request):
        self.reads += 1
        query, first = request.query, self.style.get("first", 0)
        known = {*(one for one in self.style.values() if isinstance(one, str)), "state", "sort"}
        known |= {"q", "minFlow"} if self.manner == "offset" and query.get("q") != "" else set()
        least = query.get("minFlow", "-1")
        if re.fullmatch(r"-?\d+(\.\d+)?", least) is None:
            return self._refusal()
        limit, *where = (self._number(request, role, 0) for role in ("limit", "offset", "cursor"))
        page = self._number(request, "page", first)
        is_right = query.get("state", "open") in _STATES and query.get("sort", "label") in _SORTED
        if not is_right or not query.keys() <= known or None in {limit, page, *where} or page < first:
            return self._refusal()
        size = min(limit or (5 if self.manner == "newest" else 50), self.style.get("most", 50))
        found = self._chosen(query)
        found = [one for one in found if one["flow"] >= float(least)]
        found = found[-size:] if self.manner == "newest" else found
        begin = self._begin(sum(where) + (page - first) * size, len(found))
        while self.fault == "equal items skipped" and "flow" in query.get("sort", "") and 0 < begin < len(found):
            if found[begin]["flow"] != found[begin - 1]["flow"]:
                break
            begin += 1
        end = begin + size + (self.fault == "limit off by one" and limit > 0)
        total = self._counted(len(found)) if "state" not in query else len(found)
        total += self.deleted if self.fault == "total counts the deleted" else 0
        total += self.fault == "total counts the refused" and self.refused > 9
        part = self._altered(found[begin:end], query, limit)
        total += self.fault == "total wrong beside a limit" and limit > 0
        if "total of the page" in self.fault and "state" in query:
            total = len(part)
        headers = {self.style["header"]: str(total)} if "header" in self.style else {}
        if self.manner == "linked" and end < len(found):
            kept = {} if self.fault == "links without the filter" else query
            following = f"{self.path}?{urlencode({**kept, 'limit': size, 'offset': end})}"
            headers["Link"] = f'<{self.path}>; rel="first", <{following}>; rel="next"'
        headers |= self._links(query, end - size, end, len(found))
        if "in" not in self.style:
            return web.json_response(part, headers=headers)
        following = self.style.get("next", lambda _, end: {"next": f"c{end}"}) if "cursor" in self.style else None
        following = following(self.path, end) if following is not None and end < len(found) else {}
        if "leads to the first" in self.fault and begin and not following:
            following = {"nextPageToken": "c0"}
        shown = {self.style["in"]: part, **self.style["around"](part, total), **following}
        return web.json_response(shown, headers=headers)

    def _links(self, query, begin, end, total):
        """Return the field Link, of the styles with a number of the page or of the first item."""
        if self.manner not in {"offset", "page-1"}:
            return {}
        size, first = end - begin, self.style.get("first", 0)
        role, step = ("page", size) if "page" in self.style else ("offset", 1)
        places = {"first": 0, "last": (total - 1) // size * size}
        places |= {"next": end} if end < total else {}
        places |= {"prev": max(0, begin - size)} if begin else {}
        if "next names" in self.fault and begin and "next" in places:
            places["next"] = begin
        if "first is" in self.fault:
            places["first"] = size
        links = (
            f'<{self.path}?{urlencode({**query, self.style[role]: place // step + first})}>; rel="{name}"'
            for name, place in places.items()
        )
        return {"Link": ", ".join(links)}

    def _counted(self, total):
        """Return the total, which one device counts anew each second only."""
        if self.manner != "late" or time.monotonic() - self.told_s > 1:
            self.told, self.told_s = total, time.monotonic()
        return self.told

    def _changing(self):
        """Return all valves: one device shows events, which come and go, and another one has no order."""
        if self.manner == "sliding" and self.reads % 3 == 0:
            gone = self.valves.pop(0)
            self.valves.append({**gone, "id": self.created})
            self.created += 1
        return random.sample(self.valves, len(self.valves)) if self.manner == "shuffled" else list(self.valves)

    def _chosen(self, query):
        found, state, sort = self._changing(), query.get("state"), query.get("sort")
        ignores = {
            "filter ignored for one value": state == "moving",
            "order ignored after many reads": self.reads > 60,
            "filter ignored beside a bound": "minFlow" in query,
            "one order ignored": sort == "-flow",
        }.get(self.fault, False)
        if state and not (ignores and self.fault.startswith("filter")):
            found = [one for one in found if one["state"] == state]
            found = found[1:] if self.fault == "filter loses an item" else found
        if (term := query.get("q", "").casefold()) and "search finds" not in self.fault:
            found = [one for one in found if term in one["label"].casefold()]
        if sort and not (ignores and "order" in self.fault):
            found.sort(key=lambda one: one[sort.strip("-")], reverse=sort[0] == "-")
        return found

    def _altered(self, part, query, limit):
        if self.fault == "last item lost under a large limit" and len(part) < limit:
            return part[:-1]
        is_later = query.get(self.style.get("cursor", ""), "c0") != "c0"
        lost = self.fault.endswith("of one order") and query.get("sort") == "-label" and is_later
        return [*part[1:], *part[:1]] if lost else part

    def _begin(self, begin, end):
        if self.manner == "last" and begin >= end > 0:
            return end - 1
        begin -= self.fault == "page repeated" and begin >= 2
        begin += self.fault == "item left out" and begin > 0
        return 0 if self.fault == "first page beyond the end" and begin > end else begin

    def _refusal(self):
        self.refused += 1
        return error(422, "no such value")

    async def _post(self, request):
        try:
            label = (await request.json())["label"]
        except (ValueError, TypeError, LookupError):
            return self._refusal()
        if not isinstance(label, str) or len(label) > 20:
            return self._refusal()
        self.valves.append({"id": self.created, "label": label, "state": "open", "flow": 0.5})
        self.created += 1
        return web.json_response(self.valves[-1], status=201)

    def _found(self, request):
        return next((one for one in self.valves if str(one["id"]) == request.match_info["id"]), None)

    async def _get(self, request):
        found = self._found(request)
        return error(404, "no such valve") if found is None else web.json_response(found)

    async def _delete(self, request):
        found = self._found(request)
        if found is None:
            return error(404, "no such valve")
        self.valves.remove(found)
        self.deleted += 1
        return web.Response(status=204)


_JUDGED = (LIMIT, FILTER, ORDER, TOTAL, PAGES)


def _certified(collections, out):
    """Certify a device with these collections by its description."""
    paths = {path: item for one in collections for path, item in one.described().items()}
    routes = {path: methods for one in collections for path, methods in one.routes().items()}
    calls = [
        f"--call={method} {path}" for path in paths for method in ("POST", "DELETE") if method.lower() in paths[path]
    ]
    with small_device(described(paths, "3.1.0"), routes) as url:
        return certified(url, out, *calls, "--class", "description")


def test_right_lists_of_every_style_are_not_blamed(tmp_path):
    done = _certified([_Collection(f"/{style}/valves", style) for style in _STYLES], tmp_path / "out")
    assert [done.requirement(id_)["verdict"] for id_ in _JUDGED] == ["pass"] * 5, done.text


def test_each_fault_is_found(tmp_path):
    faulty = [(f"/{fault.replace(' ', '-')}/{style}", style, fault) for style, fault, _ in _FAULTS]
    done = _certified([_Collection(*one) for one in dict.fromkeys(faulty)], tmp_path / "out")
    blamed = {
        (shown["operation"].removeprefix("GET "), id_)
        for id_ in _JUDGED
        for failure in done.requirement(id_)["failures"]
        for shown in failure["operations"]
    }
    expected = {(path, id_) for (path, *_), (*_, id_) in zip(faulty, _FAULTS, strict=True)}
    assert expected <= blamed, expected - blamed
    # What is lost or out of order on a page is so in its total and order too; no limit or filter is blamed for it.
    assert {id_ for _, id_ in blamed - expected} <= {PAGES, ORDER, TOTAL}, blamed - expected


def test_a_list_at_the_root_is_none_of_what_is_beside_it(tmp_path):
    entry = object_of("id", id={"type": "string"})
    description = described({"/": reading({"type": "array", "items": entry}), "/health": reading(object_of())})
    routes = {"/": constant([{"id": "health"}]), "/health": constant({"ok": True})}
    with small_device(description, routes) as url:
        assert certified(url, tmp_path).blamed == {}
