"""A write between two reads: what it must and must not do, by method and media type; freedoms are not judged."""

import pytest
from exchanges import broken, exchange, failed
from small_device import answers, contract_of, described

BASE = "http://device:8000/api"
_PARTS = {
    "gain": {"type": "number"},
    "count": {"type": "integer", "format": "int64", "default": 5},
    "mode": {"type": "string", "enum": ["off", "on", "auto"], "default": "on"},
    "loud": {"type": "boolean", "default": False},
    "note": {"type": ["string", "null"], "maxLength": 500},
    "title": {"type": "string", "description": "Kept in lower case."},
    "email": {"type": "string"},
    "motto": {"type": "string", "description": "Kept as written."},
    "signs": {"type": "array", "items": {"type": "string"}, "description": "Kept as written."},
    "scheduled_at": {"type": "string", "format": "date-time"},
    "exact": {"type": "number", "format": "double"},
    "from": {"type": "string", "format": "date-time"},
    "path": {"type": "array", "items": {"type": "number"}},
    "words": {"type": "array", "items": {"type": "string"}},
    "stops": {
        "type": "array",
        "items": {"type": "object", "properties": {"x": {"type": "integer"}, "y": {"type": "number"}}},
    },
    "zone": {"type": "object", "properties": {"a": {"type": "integer"}, "b": {"type": ["integer", "null"]}}},
    "built": {"type": "string", "readOnly": True},
    "level": {"type": "integer", "readOnly": True},
    "uptime": {"type": "integer"},
    "version": {"type": "integer"},
    **{key: {"type": "string", "format": "date-time", "readOnly": True} for key in ("createdAt", "updatedAt")},
}
_SCHEMA = {"type": "object", "properties": _PARTS}
_STEPS = {"type": "array", "items": {"type": "object"}}
_OK = {
    "200": answers(_SCHEMA),
    "202": {"description": "later"},
    "204": {"description": "done"},
    "4XX": {"description": ""},
}
MERGE, STEPS = "application/merge-patch+json", "application/json-patch+json"
_KINDS = {"/merge": MERGE, "/kept": MERGE, "/needed": MERGE, "/steps": STEPS, "/things/1": MERGE}


def _item(kind, schema):
    body = {"required": True, "content": {kind: {"schema": schema}}}
    put = {"required": True, "content": {"application/json": {"schema": _SCHEMA}}}
    return {
        "get": {"responses": _OK},
        "put": {"requestBody": put, "responses": _OK},
        "patch": {"requestBody": body, "responses": _OK},
    }


_ID = {"name": "id", "in": "path", "required": True, "schema": {"type": "string"}}
_PATHS = {
    "/plain": _item("application/json", _SCHEMA),
    "/nulls": {
        **_item("application/json", _SCHEMA),
        "patch": {**_item("application/json", _SCHEMA)["patch"], "summary": "Changes what is given; null is a value."},
    },
    "/merge": _item(MERGE, _SCHEMA),
    "/steps": _item(STEPS, _STEPS),
    "/things/{id}": {"parameters": [_ID], **_item(MERGE, _SCHEMA)},
    "/said": {**_item(MERGE, _SCHEMA), "put": {**_item(MERGE, _SCHEMA)["put"], "summary": "What is not sent is gone."}},
    "/kept": {
        **_item(MERGE, _SCHEMA),
        "patch": {**_item(MERGE, _SCHEMA)["patch"], "summary": "Members left out keep their value."},
    },
    "/guarded": {
        **_item(MERGE, _SCHEMA),
        "put": {**_item(MERGE, _SCHEMA)["put"], "summary": "If version is not the present one, 409."},
    },
    "/needed": {
        **_item(MERGE, _SCHEMA),
        "get": {"responses": {**_OK, "200": answers({**_SCHEMA, "required": ["gain"]})}},
    },
    "/reset": {"post": {"responses": _OK}},
}
READ, KEPT, DEFAULTS = (f"description/{name}" for name in ("written-is-read", "refused-keeps", "defaults"))
PATCH, OWN, STATES = "description/patch", "description/read-only", "description/states"
_FIRST = {"gain": 1.5, "count": 7, "mode": "auto", "loud": True, "note": "a", "zone": {"a": 1, "b": 2}, "built": "2026"}

_WHOLE = {name: one for name, one in _FIRST.items() if name != "built"}
_LEFT = {name: one for name, one in _WHOLE.items() if name != "note"}


def _get(at="/plain", **values):
    return "GET", at, None, 200, {**_FIRST, **values}


def _put(at="/plain", status=200, *, told=None, **values):
    return "PUT", at, values, status, {**_FIRST, **values, **(told or {})}


def _patch(at, sent, status=200, **values):
    return "PATCH", at, sent, status, {**_FIRST, **values} if values else None


def _op(kind, path, value=None, **more):
    return {"op": kind, "path": path, **({"value": value} if kind in {"add", "replace", "test"} else {}), **more}


def _two_changes(**stamps):
    """Return two merge patches between reads, with stamps that a list has for each read."""
    at = [{name: values[number] for name, values in stamps.items()} for number in range(3)]
    steps = [_get("/merge", **at[0])]
    for number, gain in enumerate((2.5, 3.5), 1):
        steps += [_patch("/merge", {"gain": gain}, gain=gain, **at[number]), _get("/merge", gain=gain, **at[number])]
    return steps


def _patches_between(at, counts):
    """Return patches of a note, each of which shows a count, after one of the count; nothing reads between them."""
    steps = [_get(at)]
    for text, count in zip(("b", "c"), counts, strict=True):
        steps += [_patch(at, {"count": 9}, count=9), _patch(at, {"note": text}, note=text, count=count)]
    return steps


def _told_late(*gains):
    """Return two writes whose responses show the gain before them, and what the reads after them show."""
    puts = [_put(**{**_WHOLE, "gain": gain}, told={"gain": 1.5}) for gain in (2.5, 3.5)]
    return [_get(), *(one for put, gain in zip(puts, gains, strict=True) for one in (put, _get(gain=gain)))]


_OLD, _NEW = ["2026-03-01T00:00:00Z"] * 3, [f"2026-03-01T00:16:4{second}Z" for second in (0, 2, 4)]
_LONG, _ZONE = 2**53 + 1, {"a": 5, "b": 6}
_EAST = "2026-02-01T12:34:56+02:00"
_TWICE = [_op("test", "/mode", "off"), _op("replace", "/count", 9)]
_END = [_op("replace", "/count", 9), _op("test", "/mode", "off")]
#: Exchanges, and the requirement that they break.
BROKEN = {
    "words reversed": ([_get(), _put(**_WHOLE, words=["a", "b", "c"]), _get(words=["c", "b", "a"])], READ),
    "an earlier version is taken": (
        [_get("/guarded", version=2), _put("/guarded", **_WHOLE, version=1, told={"version": 3}),
         _get("/guarded", version=3)], STATES,
    ),
    "a patch resets what it does not name, against its words": (_patches_between("/kept", (3, 3)), PATCH),
    "responses that show what was before": (_told_late(2.5, 3.5), READ),
    "a number that is the same whatever is sent": (
        [_put(**{**_WHOLE, "count": count}, told={"count": 5}) for count in (1, 5, 9)], READ,
    ),
    "a text in lower case": ([_get(), _put(**{**_WHOLE, "motto": "Big Zoë"}), _get(motto="big zoë")], READ),
    "a text without accents": ([_get(), _put(**{**_WHOLE, "note": "Big Zoë"}), _get(note="Big Zoe")], READ),
    "items in lower case": ([_get(), _put(**_WHOLE, signs=["B", "a"]), _get(signs=["b", "a"])], READ),
    "a planned time in another zone": (
        [_get(), _put(**{**_WHOLE, "scheduled_at": _EAST}), _get(scheduled_at=_EAST.replace("+02:00", "Z"))], READ,
    ),
    "a text is cut": ([_get(), _put(note="é" * 300, told={"note": "é" * 255})], READ),
    "readOnly by PUT": ([_get(), _put(gain=2.5, built="roaas-own"), _get(gain=2.5, built="roaas-own")], OWN),
    "a JSON patch moves, and leaves what it moves": (
        [
            _get("/steps", words=["z", "b"]),
            _patch("/steps", [_op("move", "/note", **{"from": "/words/0"})], words=["z", "b"], note="z"),
            _get("/steps", words=["z", "b"], note="z"),
        ], PATCH,
    ),
    "a JSON patch that removes, and nothing goes": (
        [_get("/steps"), ("PATCH", "/steps", [_op("remove", "/note")], 200, {**_FIRST}), _get("/steps")], PATCH,
    ),
    "a test that takes a list in any order": (
        [
            _get("/steps", words=["a", "b"]),
            _patch("/steps", [_op("test", "/words", ["b", "a"]), _op("replace", "/gain", 2)], words=["a", "b"], gain=2),
            _get("/steps", words=["a", "b"], gain=2),
        ], KEPT,
    ),
    "readOnly by a merge patch": (
        [_get("/merge"), _patch("/merge", {"built": "roaas-own"}), _get("/merge", built="roaas-own")], OWN,
    ),
    "readOnly of a thing, by a short value, twice": (
        [
            *(_get("/things/1", level=1), _patch("/things/1", {"level": 9}), _get("/things/1", level=9)),
            *(_patch("/things/1", {"level": 4}), _get("/things/1", level=4)),
        ], OWN,
    ),
    "a default of PUT, a text": ([_get(), _put(gain=2.5), _get(gain=2.5)], DEFAULTS),
    "a default of PUT, a truth value": (
        [_get(), _put(gain=2.5, count=5, mode="on"), _get(gain=2.5, count=5, mode="on")], DEFAULTS,
    ),
    "a default of PUT, a number, of a thing, the response shows it": (
        [_get("/things/1"), _put("/things/1", gain=1.5, mode="on", loud=False, told={"count": 7}),
         _get("/things/1", mode="on", loud=False)], DEFAULTS,
    ),
    "doubles as single floats, twice": (
        [
            *(_get("/merge"), _patch("/merge", {"exact": 3.12345678901234}), _get("/merge", exact=3.1234567)),
            *(_patch("/merge", {"exact": 2.12345678901234}), _get("/merge", exact=2.1234567)),
        ], READ,
    ),
    "a double is rounded, as the response says": (
        [_get("/merge"), _patch("/merge", {"exact": 3.12345678901234}, exact=3.12), _get("/merge", exact=3.12)], READ,
    ),
    "an offset is lost": (
        [_get("/merge"), _patch("/merge", {"from": _EAST}), _get("/merge", **{"from": "2026-02-01T12:34:56Z"})], READ,
    ),
    "the time of the last change stays": (_two_changes(createdAt=_OLD, updatedAt=_OLD), READ),
    "null keeps what the thing need not have": (
        [_get("/needed"), _patch("/needed", {"note": None}, **_FIRST), _get("/needed")], PATCH,
    ),
    "null keeps": ([_get("/merge"), _patch("/merge", {"note": None}, **_FIRST), _get("/merge")], PATCH),
    "null keeps, seen by another change": (
        [_get("/merge"), ("PATCH", "/merge", {"note": None, "gain": 2.5}, 204, None), _get("/merge", gain=2.5)], PATCH,
    ),
    "a merge patch replaces an object": (
        [_get("/merge"), _patch("/merge", {"zone": {"a": 3}}), _get("/merge", zone={"a": 3})], PATCH,
    ),
    "a merge patch resets the rest of an object": (
        [
            *(_get("/merge", zone={"a": 9, "b": 8}), _patch("/merge", {"zone": {"a": 9}})),
            _get("/merge", zone={"a": 9, "b": 2}),
            *(_patch("/merge", {"zone": {"a": 9, "b": 8}}), _get("/merge", zone={"a": 9, "b": 8})),
            *(_patch("/merge", {"zone": {"b": 8}}), _get("/merge", zone={"a": 1, "b": 8})),
        ], PATCH,
    ),
    "PUT keeps what is gone by the description": (
        [_get("/said"), _put("/said", **{**_LEFT, "gain": 2.5}), _get("/said", gain=2.5)], DEFAULTS,
    ),
    "null keeps, although it is a value": (
        [_get("/nulls"), _patch("/nulls", {"note": None}, note="a"), _get("/nulls")],
        READ,
    ),
    "null within an object keeps": (
        [_get("/merge"), _patch("/merge", {"zone": {"a": 3, "b": None}}), _get("/merge", zone={"a": 3, "b": 2})], PATCH,
    ),
    "a merge patch adds to a list": (
        [_get("/merge", words=["a"]), _patch("/merge", {"words": ["b"]}), _get("/merge", words=["a", "b"])], PATCH,
    ),
    "a patch resets the others": (
        [
            *(_get("/merge"), _patch("/merge", {"gain": 2.5}), _get("/merge", gain=2.5, note=None)),
            *(_put("/merge", **_WHOLE), _get("/merge")),
            *(_patch("/merge", {"gain": 3.5}), _get("/merge", gain=3.5, note=None)),
        ], PATCH,
    ),
    "a patch sets the mode, whatever it names": (
        [
            *(_get("/merge"), _patch("/merge", {"gain": 2.5}), _get("/merge", gain=2.5, mode="off")),
            *(_put("/merge", **_WHOLE), _get("/merge")),
            *(_patch("/merge", {"note": "b"}), _get("/merge", note="b", mode="off")),
        ], PATCH,
    ),
    "a PATCH takes each gain but 0": (
        [
            *(_get("/merge"), _patch("/merge", {"gain": 2.5}), _get("/merge", gain=2.5)),
            *(_patch("/merge", {"gain": 0, "mode": "off"}), _get("/merge", gain=2.5, mode="off")),
            *(_patch("/merge", {"gain": 0, "mode": "auto"}), _get("/merge", gain=2.5)),
        ], READ,
    ),
    "refused, and the valid members taken, by PUT": (
        [_get(), _put(status=422, gain=9.5, mode="x"), _get(gain=9.5)],
        KEPT,
    ),
    "refused, and the last member taken": (
        [_get("/merge"), _patch("/merge", {"mode": "x", "count": 9}, 400), _get("/merge", count=9)], KEPT,
    ),
    "refused with 409, and taken, of a thing": (
        [_get("/things/1"), _patch("/things/1", {"loud": False}, 409), _get("/things/1", loud=False)], KEPT,
    ),
    "a test at the beginning is ignored": ([_get("/steps"), _patch("/steps", _TWICE), _get("/steps", count=9)], KEPT),
    "a test at the end is ignored": ([_get("/steps"), _patch("/steps", _END), _get("/steps", count=9)], KEPT),
    "a JSON patch in part": ([_get("/steps"), _patch("/steps", _END, 409), _get("/steps", count=9)], KEPT),
    "what is not there is removed": (
        [_get("/steps"), _patch("/steps", [_op("remove", "/none"), _TWICE[1]]), _get("/steps", count=9)], KEPT,
    ),
    "an item of a JSON patch replaces the list": (
        [_get("/steps", words=["a", "b"]), _patch("/steps", [_op("add", "/words/-", "c")], words=["c"]),
         _get("/steps", words=["c"])], PATCH,
    ),
    "an item of a JSON patch comes first": (
        [_get("/steps", words=["a", "b"]), _patch("/steps", [_op("add", "/words/-", "c")]),
         _get("/steps", words=["c", "a", "b"])], PATCH,
    ),
    "copy without effect": (
        [_get("/steps"), _patch("/steps", [_op("copy", "/note", **{"from": "/mode"}), _op("replace", "/count", 9)]),
         _get("/steps", count=9)], PATCH,
    ),
    "a JSON patch without effect": (
        [_get("/steps"), _patch("/steps", [_op("replace", "/count", 9)]), *[_get("/steps")] * 5], PATCH,
    ),
    "a default of PUT, at last": (
        [_get(), _put(gain=1.5, told={"count": 5, "mode": "on", "loud": False}), *[_get()] * 5], DEFAULTS,
    ),
    "fractions are cut off": (
        [_get(), _put(**{**_WHOLE, "gain": -72.5}), _get(gain=-72), _put(**{**_WHOLE, "gain": 3.25}), _get(gain=3)],
        READ,
    ),
    "fractions in a list of objects are cut off": (
        [_get(), _put(**_WHOLE, stops=[{"x": 1, "y": 62.5}]), _get(stops=[{"x": 1, "y": 62}]),
         _put(**_WHOLE, stops=[{"x": 1, "y": 73.25}]), _get(stops=[{"x": 1, "y": 73}])], READ,
    ),
    "fractions are rounded, by a patch": (
        [_get("/merge"), _patch("/merge", {"gain": 2.75}), _get("/merge", gain=3),
         _patch("/merge", {"gain": 6.5}), _get("/merge", gain=6)], READ,
    ),
    "an integer as a double": ([_get(), _put(**{**_WHOLE, "count": _LONG}), _get(count=_LONG - 1)], READ),
    "numbers in another order": ([_get(), _put(**_WHOLE, path=[3, 1, 3]), _get(path=[1, 3, 3])], READ),
    "equal numbers once": ([_get(), _put(**_WHOLE, path=[3, 1, 3]), _get(path=[3, 1])], READ),
    "an empty list by PUT is ignored": (
        [_get(words=["a"]), _put(**_WHOLE, words=[], told={"words": ["a"]}), _get(words=["a"])], READ,
    ),
    "a patch leaves what is in an object, which PUT changes": (
        [
            *(_get("/merge"), _put("/merge", **{**_WHOLE, "zone": _ZONE}), _get("/merge", zone=_ZONE)),
            *(_patch("/merge", {"zone": {"a": 7}}, zone=_ZONE), _get("/merge", zone=_ZONE)),
            *(_patch("/merge", {"zone": {"a": 8}}, zone=_ZONE), _get("/merge", zone=_ZONE)),
        ], READ,
    ),
    "an object of a list is lost": (
        [_get(), _put(**_WHOLE, stops=[{"x": 1}, {"x": 2}]), _get(stops=[{"x": 1}])], READ,
    ),
    "an object of a list is changed": (
        [_get(), _put(**_WHOLE, stops=[{"x": 1}, {"x": 2}]), _get(stops=[{"x": 1}, {"x": 1}])], READ,
    ),
}  # fmt: skip
#: The same for right devices.
RIGHT = {
    "a text in lower case where nothing is said": [_get(), _put(**{**_WHOLE, "note": "Big Zoë"}), _get(note="big zoë")],
    "items in lower case where nothing is said": [_get(), _put(**_WHOLE, words=["B", "a"]), _get(words=["b", "a"])],
    "a text in lower case, as is said": [_get(), _put(**{**_WHOLE, "title": "Big Zoë"}), _get(title="big zoë")],
    "what is compared without case": [_get(), _put(**{**_WHOLE, "email": "Zoe@X"}), _get(email="zoe@x")],
    "a text without blanks at its ends": [_get(), _put(**{**_WHOLE, "note": " Big  Zoë "}), _get(note="Big Zoë")],
    "a text in another form": [_get(), _put(**{**_WHOLE, "note": "Zoe\u0308"}), _get(note="Zo\u00eb")],
    "a planned time in UTC": [
        _get(), _put(**{**_WHOLE, "scheduled_at": _EAST}), _get(scheduled_at="2026-02-01T10:34:56Z")
    ],
    "an earlier version is taken, which no description forbids": [
        _get("/said", version=2), _put("/said", **_WHOLE, version=1, told={"version": 3}), _get("/said", version=3),
    ],
    "a JSON patch moves": [
        _get("/steps", words=["z", "b"]),
        _patch("/steps", [_op("move", "/note", **{"from": "/words/0"})], words=["b"], note="z"),
        _get("/steps", words=["b"], note="z"),
    ],
    "a JSON patch removes what has a default": [_get("/steps", count=5), _patch("/steps", [_op("remove", "/count")],
        count=5), _get("/steps", count=5)],
    "a double as it was, and once as another client wrote it": [
        *(_get("/merge"), _patch("/merge", {"exact": 3.12345678901234}), _get("/merge", exact=3.12345678901234)),
        *(_patch("/merge", {"exact": 2.5}), _get("/merge", exact=2.5000001)),
    ],
    "a number of no format, rounded": [
        *(_get("/merge"), _patch("/merge", {"gain": 3.123456789}), _get("/merge", gain=3.12)),
        *(_patch("/merge", {"gain": 2.123456789}), _get("/merge", gain=2.12)),
    ],
    "a time in another zone, the same instant": [
        _get("/merge"), _patch("/merge", {"from": _EAST}), _get("/merge", **{"from": "2026-02-01T10:34:56Z"}),
    ],
    "a time that is written later": [
        _get("/merge", **{"from": "2026-02-01T12:34:56Z"}),
        _patch("/merge", {"from": _EAST}), _get("/merge", **{"from": "2026-02-01T12:34:56Z"}),
    ],
    "a time without a zone": [
        _get("/merge"), _patch("/merge", {"from": _EAST}), _get("/merge", **{"from": "2026-02-01T12:34:56"}),
    ],
    "readOnly ignored": [_get(), _put(**{**_FIRST, "built": "x"}), _get()],
    "readOnly refused": [_get(), _put(status=422, built="roaas-own"), _get()],
    "a member of the device's that changes": [_get(level=1), _get(level=2), _put(**_FIRST, level=9), _get(level=9)],
    "defaults applied": [_get(), _put(gain=2.5), _get(gain=2.5, count=5, mode="on", loud=False)],
    "a PUT that acts later": [_get(), _put(gain=2.5, told={"count": 5, "mode": "on", "loud": False}), _get()],
    "a list of an earlier PUT that acts later": [
        *(_get(), _put(**_WHOLE, stops=[{"x": 1}]), _get()),
        *(_put(**_WHOLE, stops=[{"x": 1}, {"x": 2}]), _get(stops=[{"x": 1}])),
    ],
    "a PUT that is accepted": [_get(), _put(status=202, gain=2.5), _get(gain=2.5)],
    "a PUT that takes effect after a refused one": [
        _get(),
        _put(status=202, **{**_WHOLE, "mode": "on"}),
        _get(),
        _put(status=409, **{**_WHOLE, "mode": "on"}),
        _get(mode="on"),
    ],
    "a patch keeps what has a default": [_get(), _patch("/plain", {"gain": 2.5}), _get(gain=2.5)],
    "null removes": [_get("/merge"), _patch("/merge", {"note": None}), _get("/merge", note=None)],
    "the time of the last change moves": _two_changes(createdAt=_OLD, updatedAt=_NEW),
    "another time stays": _two_changes(updatedAt=_OLD),
    "a time in seconds stays": _two_changes(createdAt=[7.5] * 3, updatedAt=[7.5] * 3),
    "it has only just changed": _two_changes(createdAt=_OLD, updatedAt=[_NEW[0]] * 3),
    "null for what is readOnly": [_get("/merge"), _patch("/merge", {"built": None}), _get("/merge")],
    "null for what the thing always has": [_get("/needed"), _patch("/needed", {"gain": None}), _get("/needed")],
    "null sets the default": [_get("/merge"), _patch("/merge", {"mode": None}, mode="on"), _get("/merge", mode="on")],
    "null that is a value": [_get("/nulls"), _patch("/nulls", {"note": None}, note=None), _get("/nulls", note=None)],
    "null in plain JSON": [_get(), _patch("/plain", {"note": None}), _get()],
    "an object merged": [
        *(_get("/merge"), _patch("/merge", {"zone": {"a": 3}}), _get("/merge", zone={"a": 3, "b": 2})),
        *(_patch("/merge", {"zone": {"b": None}}), _get("/merge", zone={"a": 3})),
    ],
    "members of an object that follow each other": [
        *(_get("/merge"), _patch("/merge", {"zone": {"a": 3}}), _get("/merge", zone={"a": 3, "b": 6})),
        *(_patch("/merge", {"zone": {"b": 8}}), _get("/merge", zone={"a": 4, "b": 8})),
        *(_patch("/merge", {"zone": {"b": 8}}), _get("/merge", zone={"a": 4, "b": 8})),
    ],
    "a response that once shows what was before": [
        _get(), _put(**{**_WHOLE, "gain": 2.5}, told={"gain": 1.5}), _get(gain=2.5),
    ],
    "responses that show what is in effect later": _told_late(1.5, 1.5),
    "numbers above a limit that the response tells": [
        _put(**{**_WHOLE, "count": count}, told={"count": min(count, 5)}) for count in (5, 7, 9)
    ],
    "numbers within limits that the response tells": [
        _put(**{**_WHOLE, "count": count}, told={"count": min(max(count, 4), 5)}) for count in (1, 5, 9)
    ],
    "PUT keeps what it leaves out": [_get(), _put(**{**_LEFT, "gain": 2.5}), _get(gain=2.5)],
    "plain JSON replaces an object": [_get(), _patch("/plain", {"zone": {"a": 3}}), _get(zone={"a": 3})],
    "what counts by itself": [_get(uptime=1), _get(uptime=2), _patch("/plain", {"uptime": 3}, 422), _get(uptime=3)],
    "another write in between": [
        _get(), _put(status=422, gain=9.5, mode="x"), _put(**{**_WHOLE, "gain": 9.5}), _get(gain=9.5),
    ],
    "something else in between": [
        _get(), _put(status=422, gain=9.5, mode="x"), ("POST", "/reset", None, 204, None), _get(gain=9.5),
    ],
    "not acceptable, and done": [_get(), _put(status=406, gain=9.5), _get(gain=9.5)],
    "a test that holds": [
        _get("/steps"), _patch("/steps", [_op("test", "/gain", 1.5), _op("replace", "/mode", "off")]),
        _get("/steps", mode="off"),
    ],
    "a test of what changes by itself": [
        *(_get("/steps", uptime=1), _get("/steps", uptime=2)),
        *(_patch("/steps", [_op("test", "/uptime", 3)]), _get("/steps", uptime=4)),
    ],
    "a patch that is refused": [_get("/steps"), _patch("/steps", _END, 409), _get("/steps")],
    "one fraction is cut off": [_get(), _put(**{**_WHOLE, "gain": 2.5}), _get(gain=2)],
    "fractions of items that the device sorts": [
        *(_get(), _put(**_WHOLE, stops=[{"y": 90.5}, {"y": 90}]), _get(stops=[{"y": 90}, {"y": 90.5}])),
        *(_put(**_WHOLE, stops=[{"y": 97.25}, {"y": 97}]), _get(stops=[{"y": 97}, {"y": 97.25}])),
    ],
    "steps of a half": [
        *(_get(), _put(**{**_WHOLE, "gain": 2.375}), _get(gain=2.5), _put(**{**_WHOLE, "gain": 3.1}), _get(gain=3)),
        *(_put(**{**_WHOLE, "gain": 4.1}), _get(gain=4)),
    ],
    "a JSON patch that acts later": [
        *(_get("/steps"), _patch("/steps", [_op("replace", "/count", 9)], count=9), *[_get("/steps")] * 2),
        _get("/steps", count=9),
    ],
    "a patch of what shows the device": [
        *(_get("/merge"), _patch("/merge", {"zone": {"a": 7}}), _get("/merge")),
        *(_patch("/merge", {"zone": {"a": 8}}), _get("/merge")),
    ],
    "clamped": [
        _get(), _put(**{**_WHOLE, "gain": 50.5}), _get(gain=10), _put(**{**_WHOLE, "gain": 60.5}), _get(gain=10),
    ],
    "words sorted": [_get(), _put(**_WHOLE, words=["c", "a", "b"]), _get(words=["a", "b", "c"])],
    "words as a set": [_get(), _put(**_WHOLE, words=["b", "a", "b"]), _get(words=["a", "b"])],
    "a mode that follows the gain": [
        *(_get("/merge"), _patch("/merge", {"gain": 2.5}), _get("/merge", gain=2.5, mode="off")),
        *(_put("/merge", **_WHOLE), _get("/merge")),
        *(_patch("/merge", {"gain": 3.5}), _get("/merge", gain=3.5, mode="off")),
    ],
    "a text of which the response shows the beginning, as it may": [_get(), _put(note="é" * 600, told={"note": "é"})],
    "a count that follows the note": _patches_between("/merge", (3, 3)),
    "a count that moves by itself": _patches_between("/kept", (9, 8)),
    "one reset by another mode": [_get(), _patch("/plain", {"mode": "off"}), _get(mode="off", loud=False)],
}  # fmt: skip


@pytest.fixture(name="contract", scope="module")
def _contract(tmp_path_factory):
    document = described(_PATHS, "3.1.0")
    return contract_of(tmp_path_factory.mktemp("pack"), document)


def _broken(contract, steps):
    exchanges = []
    for now, (method, path, sent, status, seen) in enumerate(steps, 1001):
        kind = _KINDS.get(path, "application/json") if method == "PATCH" else "application/json"
        shown, date = seen if status < 300 else None, f"Sun, 01 Mar 2026 00:{now // 60:02}:{now % 60:02} GMT"
        exchanges.append(
            exchange(
                method, BASE + path, status, shown, sent=sent or None, kind=kind, told=[("Date", date)], at_s=float(now)
            )
        )
    return broken(contract, BASE, exchanges) & {READ, KEPT, DEFAULTS, PATCH, OWN, STATES}


@pytest.mark.parametrize("name", BROKEN)
def test_a_wrong_write_is_blamed(contract, name):
    steps, requirement = BROKEN[name]
    assert _broken(contract, steps) == {requirement}


@pytest.mark.parametrize("name", RIGHT)
def test_a_right_write_is_not_blamed(contract, name):
    assert _broken(contract, RIGHT[name]) == set()


def test_a_text_that_is_lost_has_the_cause_of_a_value_that_is_lost(contract):
    note, lost = "Gr\u00f6\u00dfe 5 \u00b5m", {**_FIRST, "note": "Gr??e 5 ?m"}
    steps = (("GET", None, _FIRST), ("PUT", {**_WHOLE, "note": note}, lost), ("GET", None, lost))
    exchanges = [exchange(method, f"{BASE}/plain", 200, shown, sent=body) for method, body, shown in steps]
    (found,) = (case for case in failed(contract, BASE, exchanges) if case.requirement == READ)
    assert found.cause == "PUT /plain note value"


_BASE = "http://device"
_KEY = {"type": ["string", "null"], "writeOnly": True}
_USER = {"type": "object", "properties": {"name": {"type": "string"}, "key": _KEY}}
_SCHEMAS = {
    "plain": _USER,
    "list": {"type": "array", "items": _USER},
    "page": {"type": "object", "properties": {"items": {"type": "array", "items": _USER}}},
    "composed": {"allOf": [{"type": "object", "properties": {"id": {"type": "integer"}}}, _USER]},
    "inner": {"type": "object", "properties": {"owner": _USER}},
}


def _wrapped(kind, user):
    return {"list": [{}, user], "page": {"items": [user]}, "inner": {"owner": user}}.get(kind, user)


def _blamed(kind, user, folder):
    document = described({"/it": {"get": {"responses": {"200": answers(_SCHEMAS[kind])}}}}, "3.1.0")
    contract = contract_of(folder, document)
    cases = failed(contract, _BASE, [exchange("GET", f"{_BASE}/it", shown=_wrapped(kind, user))])
    return [one.observed for one in cases if one.requirement == "description/read-only"]


@pytest.mark.parametrize("kind", _SCHEMAS)
def test_a_value_that_is_shown_is_blamed(kind, tmp_path):
    assert _blamed(kind, {"name": "a", "key": "s3cret"}, tmp_path) == ["key in the response"]


@pytest.mark.parametrize("kind", _SCHEMAS)
@pytest.mark.parametrize("user", [{"name": "a"}, {"key": None}, {"key": "********"}, {"key": ""}])
def test_what_is_left_out_or_masked_is_not(kind, user, tmp_path):
    assert _blamed(kind, user, tmp_path) == []
