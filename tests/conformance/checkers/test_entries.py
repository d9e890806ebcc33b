"""Entries that only their list shows: what was created, changed or deleted there, and nothing that was refused."""

import pytest
from exchanges import exchange, failed
from small_device import REFUSED, answers, contract_of, described

_BASE = "http://device:8000"
_NEW = {"type": "object", "properties": {"text": {"type": "string"}, "at": {"type": "string", "format": "date-time"}}}
_NOTE = {"type": "object", "properties": {"id": {"type": "string"}, **_NEW["properties"]}}
_LIST = {"type": "object", "properties": {"items": {"type": "array", "items": _NOTE}, "total": {"type": "integer"}}}
_LIMIT = {"name": "limit", "in": "query", "schema": {"type": "integer", "default": 2}}
_PATHS = {
    "/notes": {
        "get": {"parameters": [_LIMIT], "responses": {"200": answers(_LIST)}},
        "post": {
            "requestBody": {"required": True, "content": {"application/json": {"schema": _NEW}}},
            "responses": {"201": answers(_NOTE), "406": REFUSED},
        },
    }
}
_MARK = {"type": "object", "properties": {"x": {"type": "number"}}}
_MARKED = {"type": "object", "properties": {"id": {"type": "integer"}, **_MARK["properties"]}}
_WRITES = {"requestBody": {"required": True, "content": {"application/json": {"schema": _MARK}}}}
_PATHS |= {
    "/marks": {
        "get": {"responses": {"200": answers({"type": "array", "items": _MARKED})}},
        "post": {**_WRITES, "responses": {"201": answers(_MARKED)}},
    },
    "/flags": {
        "get": {"responses": {"200": answers({"type": "array", "items": _MARKED})}},
        "post": {**_WRITES, "responses": {"200": answers(_MARKED)}},
    },
    "/marks/{mark_id}": {
        "parameters": [{"name": "mark_id", "in": "path", "required": True, "schema": {"type": "integer"}}],
        "patch": {**_WRITES, "responses": {"200": answers(_MARKED), "409": REFUSED}},
        "delete": {"responses": {"204": {"description": "gone"}, "409": REFUSED}},
    },
}
_JOB = {"type": "object", "properties": {"id": {"type": "string"}, "state": {"enum": ["new", "old"]}}}
_JOBS = {"type": "object", "properties": {"items": {"type": "array", "items": _JOB}, "total": {"type": "integer"}}}
_PATHS |= {
    "/jobs": {"get": {"responses": {"200": answers(_JOBS)}}, "post": {"responses": {"201": answers(_JOB)}}},
    "/jobs/{id}": {
        "parameters": [{"name": "id", "in": "path", "required": True, "schema": {"type": "string"}}],
        "get": {"responses": {"200": answers(_JOB)}},
    },
}
_RANKS = {"type": "array", "items": {"type": "object", "properties": {"id": {}, "rank": {"type": "integer"}}}}
_SORT = {
    "name": "sort",
    "in": "query",
    "schema": {"enum": ["rank", "-rank"]},
    "description": "Equal ones in the order of their creation.",
}
_RANKED = {
    f"/{name}/{{id}}": {
        "parameters": _PATHS["/jobs/{id}"]["parameters"],
        "get": {"responses": {"200": answers(_RANKS["items"])}},
    }
    for name in ("aged", "ranked")
}
_RANKED |= {
    f"/{name}": {
        "get": {
            "summary": "In the order of their creation." * (not more),
            "parameters": more,
            "responses": {"200": answers(_RANKS)},
        },
        "post": {"responses": {"201": answers(_RANKS["items"])}},
    }
    for name, more in (("aged", []), ("ranked", [_SORT]))
}
_PATHS |= _RANKED
_THERE, _READ, _KEPT, _GONE = (
    f"description/{name}" for name in ("created-is-there", "written-is-read", "refused-keeps", "deleted-is-gone")
)


@pytest.fixture(name="contract", scope="module")
def _contract(tmp_path_factory):
    return contract_of(tmp_path_factory.mktemp("pack"), described(_PATHS, "3.1.0"))


def _made(id_, text, status=201):
    return "POST", "/notes", {"text": text}, status, {"id": id_, "text": text} if status == 201 else None


def _listed(*ids, total=None, target="/notes?limit=100", **texts):
    items = [{"id": id_, "text": texts.get(id_, f"text of {id_}")} for id_ in ids]
    return "GET", target, None, 200, {"items": items, "total": len(items) if total is None else total}


def _broken(contract, steps):
    exchanges = [
        exchange(method, _BASE + target, status, came, sent=sent, at_s=float(number))
        for number, (method, target, sent, status, came) in enumerate(steps)
    ]
    found = {case.requirement: bool(case.doubt) for case in failed(contract, _BASE, exchanges)}
    return {id_: found[id_] for id_ in found.keys() & {_THERE, _READ, _KEPT, _GONE}}


def _marks(**marks):
    return "GET", "/marks", None, 200, [{"id": int(name[1:]), "x": x} for name, x in marks.items()]


def _patched(x, status=200):
    return "PATCH", "/marks/1", {"x": x}, status, {"id": 1, "x": x} if status == 200 else None


def _deleted(status=204):
    return "DELETE", "/marks/1", None, status, None


def _flags(**flags):
    return "GET", "/flags", None, 200, [{"id": int(name[1:]), "x": x} for name, x in flags.items()]


_FLAG_MADE = ("POST", "/flags", {"x": 5}, 200, {"id": 1, "x": 5})
_MARK_MADE = ("POST", "/marks", {"x": 5}, 201, {"id": 1, "x": 5})
_MARK_MORE = [("POST", "/marks", {"x": x}, 201, {"id": x - 4, "x": x}) for x in (6, 7)]
_NEWER = [_made("n1", "text of n1"), _made("n2", "text of n2")]
_WRONG = {
    "the newer one of two is lost": ([*_NEWER, _listed("n1")], {_THERE: False}),
    "the only one is lost, as a list that keeps few may": ([_made("n1", "text of n1"), _listed()], {_THERE: True}),
    "another text": ([_made("n1", "text of n1"), _listed("n1", n1="other text")], {_READ: True}),
    "what was refused": (
        [_listed("n0"), _made("n1", "refused", 406), _listed("n0", "n1", n1="refused")],
        {_KEPT: False},
    ),
    "another number": ([_MARK_MADE, _marks(m1=0)], {_READ: False}),
    "a change that is lost": ([_marks(m1=5), _patched(7), *[_marks(m1=5)] * 3], {_READ: False}),
    "a refused change that was stored": ([_marks(m1=5), _patched(7, 409), _marks(m1=7)], {_KEPT: False}),
    "a refused deletion that was done": ([_marks(m1=5), _deleted(409), _marks()], {_KEPT: False}),
    "an identifier that is there": (
        [_MARK_MADE, ("POST", "/marks", {"x": 7}, 201, {"id": 1, "x": 7})],
        {_THERE: False},
    ),
    "a creation that is answered 200": ([_flags(), _FLAG_MADE, _flags(f1=0)], {_READ: False}),
    "made twice": ([_marks(), _MARK_MADE, _marks(m1=5, m2=5)], {_THERE: False}),
    "others are deleted too": (
        [_MARK_MADE, *_MARK_MORE, _marks(m1=5, m2=6, m3=7), _deleted(), _marks()],
        {_THERE: False},
    ),
    "another one is deleted": (
        [_MARK_MADE, *_MARK_MORE, _marks(m1=5, m2=6, m3=7), _deleted(), *[_marks(m1=5, m2=6)] * 3],
        {_THERE: False, _GONE: False},
    ),
    "a text that is cut": (
        [("POST", "/notes", {"text": "a long text"}, 201, {"id": "n1", "text": "a lon"}), _listed("n1", n1="a lon")],
        {_READ: False},
    ),
    "a text that is left empty": ([_made("n1", "text of n1"), _listed("n1", n1="")], {_READ: True}),
    "what was deleted stays": ([_marks(m1=5), _deleted(), *[_marks(m1=5)] * 3], {_GONE: False}),
}
_RIGHT = {
    "all are there": [*_NEWER, _listed("n2", "n1")],
    "a part of the list": [*_NEWER, _listed("n1", "n0", total=3, target="/notes")],
    "a later creation with the text of a refused one": [
        _listed("n0"), _made("n1", "refused", 406), _made("n1", "refused"), _listed("n0", "n1", n1="refused"),
    ],
    "another client's entry": [_listed("n0"), _made("n1", "refused", 406), _listed("n0", "n9", n9="another text")],
    "a change, and one that is refused": [_marks(m1=5), _patched(7), _marks(m1=7), _patched(9, 409), _marks(m1=7)],
    "a refused change, and then the same one": [_marks(m1=5), _patched(7, 409), _patched(7), _marks(m1=7)],
    "a change, and the same one that is refused": [_marks(m1=5), _patched(7), _patched(7, 409), _marks(m1=7)],
    "a change that is done a moment later": [_marks(m1=5), _patched(7), _marks(m1=5), _marks(m1=7)],
    "a deletion that is done a moment later": [_marks(m1=5, m2=1), _deleted(), _marks(m1=5, m2=1), _marks(m2=1)],
    "a creation that is answered with what is there": [_MARK_MADE, _marks(m1=5), _MARK_MADE, _marks(m1=5)],
    "another client's equal entry, before": [_marks(m2=5), _MARK_MADE, _marks(m1=5, m2=5)],
    "a search that is answered 200": [_flags(f1=9), _FLAG_MADE, _flags(f1=9)],
    "a number that is given again": [_marks(m1=5), _deleted(), _MARK_MADE, *[_marks(m1=5)] * 4],
    "a list of which nothing is known before": [_made("n1", "refused", 406), _listed("n1", n1="refused")],
}  # fmt: skip


@pytest.mark.parametrize("name", _WRONG)
def test_a_wrong_list_is_blamed(contract, name):
    steps, broken = _WRONG[name]
    assert _broken(contract, steps) == broken


@pytest.mark.parametrize("name", _RIGHT)
def test_a_right_list_is_not(contract, name):
    assert _broken(contract, _RIGHT[name]) == {}


def _job(number, state="new"):
    return {"id": f"j{number}", "state": state}


def _read_around(listed, *missing):
    """Return reads of jobs with a list of some between them, after three were created."""
    made = [("POST", "/jobs", None, 201, _job(number)) for number in (1, 2, 3)]
    quiet = [("GET", "/jobs/j1", None, 200, _job(1))] * 5
    reads = [("GET", f"/jobs/j{number}", None, 200, _job(number)) for number in missing]
    items = [_job(*one) for one in listed]
    return [*made, *quiet, *reads, ("GET", "/jobs", None, 200, {"items": items, "total": len(items)}), *reads]


@pytest.mark.parametrize(
    ("listed", "blamed"),
    [([(1,)], True), ([(1,), (2,), (3,)], False), ([(1,), (2,)], False), ([(1, "old")], False), ([], False)],
    ids=["the first alone", "all", "one is missing", "those of another state", "none"],
)
def test_a_whole_list_has_what_reads_find(contract, listed, blamed):
    assert _broken(contract, _read_around(listed, 2, 3)) == ({_THERE: False} if blamed else {})


def test_a_list_may_leave_out_the_oldest(contract):
    assert _broken(contract, _read_around([(3,)], 1, 2)) == {}


@pytest.mark.parametrize(
    ("target", "order", "blamed"),
    [
        ("/aged", [1, 2, 3], False),
        ("/aged", [3, 2, 1], True),
        ("/ranked", [3, 2, 1], False),
        ("/ranked?sort=rank", [3, 2, 1], True),
        ("/ranked?sort=rank", [2, 3, 1], False),
        ("/ranked?sort=-rank", [1, 2, 3], False),
    ],
)
def test_an_order_of_creation_that_is_promised(contract, target, order, blamed):
    path = target.partition("?")[0]
    things = {number: {"id": f"t{number}", "rank": number // 2} for number in (1, 2, 3)}
    made = [exchange("POST", _BASE + path, 201, things[number], at_s=float(number)) for number in things]
    shown = [things[number] for number in order]
    found = failed(contract, _BASE, [*made, exchange("GET", _BASE + target, 200, shown, at_s=9.0)])
    assert {case.requirement for case in found if case.cause.endswith(" creation")} == (
        {"description/list-order"} if blamed else set()
    )
