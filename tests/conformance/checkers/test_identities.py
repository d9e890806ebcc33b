"""Reads of items, one after another: the item of the path, under whatever other names, and other items in its place."""

import pytest
from exchanges import broken, exchange, failed
from small_device import contract_of, described

_BASE = "http://device:80"


def _paths(name, schema):
    item = {"parameters": [{"in": "path", "name": name, "required": True, "schema": schema}]}
    answered = {"200": {"description": "", "content": {"application/json": {"schema": {}}}}}
    each = {method: {"responses": answered} for method in ("get", "put", "patch", "delete")}
    return {"/things": {"get": {"responses": answered}}, f"/things/{{{name}}}": {**item, **each}}


@pytest.fixture(scope="module", params=[("id", {"type": "integer"}), ("thing_id", {}), ("name", {"type": "string"})])
def contract(request, tmp_path_factory):
    document = described(_paths(*request.param), "3.1.0")
    return contract_of(tmp_path_factory.mktemp("pack"), document), request.param[0]


def _wrong(contract, reads):
    """Return which of some exchanges is blamed, each given by its method, the end of its path, and the identifiers."""
    pack, name = contract
    member = "id" if name == "thing_id" else name
    numbers = {} if name == "name" else {letter: index for index, letter in enumerate("abcde")}

    def id_of(one):
        return numbers.get(one, one)

    exchanges = []
    for method, last, answered, *located in reads:
        body = [{member: id_of(one)} for one in answered] if not last else {member: id_of(answered[0]), "more": 1}
        path = f"/things/{id_of(last)}" if last else "/things"
        fields = [("Content-Location", f"/things/{id_of(one)}") for one in located]
        exchanges.append(exchange(method, _BASE + path, shown=body, asked=[("Accept", "*/*")], told=fields))
    cases = [case for case in failed(pack, _BASE, exchanges) if case.requirement == "description/own-identifier"]
    return [turn for turn, one in enumerate(exchanges) for case in cases if case.exchange is one]


_LIST = ("GET", "", ["a", "b", "c"])
_RIGHT = {
    "each its own": [_LIST, ("GET", "a", ["a"]), ("GET", "b", ["b"]), ("GET", "a", ["a"])],
    "another name": [_LIST, ("GET", "a", ["a"]), ("GET", "x-current", ["a"]), ("GET", "x-current", ["b"])],
    "never its own": [_LIST, ("GET", "a", ["c"]), ("GET", "b", ["c"])],
    "renamed": [_LIST, ("GET", "a", ["a"]), ("PATCH", "a", ["e"]), ("GET", "a", ["e"])],
    "HEAD and no identifier": [_LIST, ("GET", "a", ["a"]), ("HEAD", "a", ["b"]), ("GET", "a", [None])],
    "Content-Location": [
        _LIST,
        ("GET", "a", ["a"], "a"),
        ("GET", "a", ["a"], "a.json"),
        ("GET", "x-current", ["a"], "a"),
    ],
    "an identifier of another kind": [_LIST, ("GET", "a", ["a"]), ("GET", "b", ["x-17"])],
}
_WRONG = {
    "the first one later": ([("GET", "b", ["b"]), ("GET", "b", ["a"])], [1]),
    "always the first one": ([_LIST, ("GET", "a", ["a"]), ("GET", "b", ["a"]), ("GET", "c", ["a"])], [2, 3]),
    "one of those created later": ([("GET", "a", ["a"]), ("GET", "b", ["b"]), _LIST, ("GET", "c", ["b"])], [3]),
    "after a change of another": ([("GET", "a", ["a"]), ("PUT", "b", ["b"]), ("GET", "a", ["b"])], [2]),
    "another one as Content-Location": ([_LIST, ("GET", "a", ["a"], "b")], [1]),
    "after a deletion": ([_LIST, ("GET", "b", ["b"]), ("DELETE", "a", ["a"]), ("GET", "b", ["c"])], [3]),
}


@pytest.mark.parametrize("style", _RIGHT)
def test_a_right_device_is_not_blamed(style, contract):
    assert _wrong(contract, _RIGHT[style]) == []


@pytest.mark.parametrize("fault", _WRONG)
def test_another_item_is_found(fault, contract):
    reads, expected = _WRONG[fault]
    assert _wrong(contract, reads) == expected


_CODE = {"type": "object", "properties": {"code": {"type": "string"}, "size": {"type": "integer"}}}
_TAKEN = ("POST", "", {"code": "A", "size": 2}, 409)
_MADE = [("POST", "", {"code": "A", "size": 1}, 201), _TAKEN, ("POST", "", {"code": "B", "size": 2}, 201)]
_A, _B = ("GET", "1", {"code": "A", "size": 1}, 200), ("GET", "2", {"code": "B", "size": 2}, 200)
_TWICE = [*_MADE, _A, _B, ("PUT", "2", {"code": "A", "size": 2}, 200), ("GET", "2", {"code": "A", "size": 2}, 200), _A]
_UNIQUE = {
    "by PUT": (_TWICE, True),
    "by PATCH": ([*_MADE, ("PATCH", "2", {"code": "A"}, 200), _A, ("GET", "2", {"code": "A"}, 200)], True),
    "by a second creation": (
        [*_MADE, ("POST", "", {"code": "A", "size": 3}, 201), _A, ("GET", "3", {"code": "A"}, 200)], True,
    ),
    "refused": ([*_MADE, ("PUT", "2", {"code": "A"}, 409), _A, _B], False),
    "never refused": ([_MADE[0], ("PUT", "2", {"code": "A"}, 200), ("GET", "2", {"code": "A"}, 200), _A], False),
    "given to another one": ([*_TWICE[:-1], ("GET", "1", {"code": "C", "size": 1}, 200)], False),
    "gone": ([*_TWICE[:-1], ("DELETE", "2", None, 204), _A], False),
    "a full collection": (
        [_MADE[0], _TAKEN, ("DELETE", "7", None, 204), ("POST", "", {"code": "B", "size": 2}, 201), *_TWICE[-2:]],
        False,
    ),
    "two of one kind before": ([_MADE[0], _MADE[0], *_TWICE[1:]], False),
    "refused for two reasons": (
        [_MADE[0], _TAKEN, ("POST", "", {"code": "B", "size": 3}, 201), *_TWICE[-2:]], False,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", _UNIQUE)
def test_what_is_unique_stays_unique(name, tmp_path):
    steps, blamed = _UNIQUE[name]
    paths = _paths("id", {"type": "integer"})
    body = {"content": {"application/json": {"schema": _CODE}}}
    paths["/things"]["post"] = {"requestBody": body, **paths["/things"]["get"]}
    exchanges = [
        exchange(
            method, f"{_BASE}/things/{last}".rstrip("/"), status, value,
            sent=value if method in {"POST", "PUT", "PATCH"} else None,
        )
        for method, last, value, status in steps
    ]  # fmt: skip
    cases = failed(contract_of(tmp_path / "pack", described(paths, "3.1.0")), _BASE, exchanges)
    assert any("another code" in case.expected for case in cases) == blamed


_MADE = ("POST", "/notes", 201, {"id": "1", "made": 1, "created_at": "a"})
_READ = ("GET", "/notes/1", 200, _MADE[3])
_PUT = ("PUT", "/notes/1", 200, {"id": "1", "made": 1, "created_at": "b"})
_FIELD = "Responses are never stored: all have `Cache-Control: no-store`."


@pytest.mark.parametrize(
    ("says", "steps", "blamed"),
    [
        (_FIELD, [_READ], "description/headers"),
        (_FIELD, [("GET", "/notes/1", 404, {})], None),
        ("Requests have `Cache-Control: no-store`, all of them.", [_READ], None),
        ("Ids are given by the shuttle, and never twice.", [_MADE, ("DELETE", "/notes/1", 204, None), _MADE],
         "description/created-is-there"),
        ("Ids are given by the shuttle.", [_MADE, ("DELETE", "/notes/1", 204, None), _MADE], None),
        ("", [_READ, _PUT, ("GET", "/notes/1", 200, _PUT[3])], "description/read-only"),
        ("", [_READ, ("PUT", "/notes/1", 200, {}), _READ], None),
        ("", [_READ, _PUT, ("GET", "/notes/1", 200, {**_READ[3], "made": 2})], None),
    ],
)  # fmt: skip
def test_what_the_head_of_a_description_and_names_of_members_promise(says, steps, blamed, tmp_path):
    note = {"type": "object", "properties": {name: {} for name in ("id", "made", "created_at")}}
    own = {"description": "", "content": {"application/json": {"schema": note}}}
    body = {"content": {"application/json": {"schema": {"type": "object", "properties": {"text": {}}}}}}
    put = {"requestBody": body, "responses": {"200": own}}
    item = {"get": {"responses": {"200": own, "404": own}}, "put": put, "delete": {"responses": {"204": own}}}
    id_ = {"in": "path", "name": "id", "required": True, "schema": {"type": "string"}}
    paths = {"/notes": {"post": {"responses": {"201": own}}}, "/notes/{id}": {"parameters": [id_], **item}}
    document = {"openapi": "3.1.0", "info": {"title": "t", "version": "1", "description": says}, "paths": paths}
    exchanges = [
        exchange(method, _BASE + path, status, told, at_s=9.0 * number)
        for number, (method, path, status, told) in enumerate(steps)
    ]
    judged = {"description/headers", "description/created-is-there", "description/read-only"}
    assert broken(contract_of(tmp_path, document), _BASE, exchanges) & judged == {*filter(None, [blamed])}


@pytest.mark.parametrize(("reads", "blamed"), [("12 21 12", 0), ("1122 12", 1), ("13 11 13 23", 0)])
def test_a_response_shows_the_parameters_that_were_asked_for(reads, blamed, tmp_path):
    """Each read is what is asked for and what is shown; a value counts once it was shown as it was asked for."""
    slot = {"name": "slot", "in": "query", "required": True, "schema": {"type": "integer"}}
    answered = {"200": {"description": "", "content": {"application/json": {"schema": {}}}}}
    pack = contract_of(
        tmp_path, described({"/weight": {"get": {"parameters": [slot], "responses": answered}}}, "3.1.0")
    )
    exchanges = [
        exchange("GET", f"{_BASE}/weight?slot={asked}", shown={"slot": int(shown)}, asked=[("Accept", "*/*")])
        for asked, shown in zip(*[iter(reads.replace(" ", ""))] * 2, strict=True)
    ]
    cases = failed(pack, _BASE, exchanges)
    assert sum(case.requirement == "description/own-identifier" for case in cases) == blamed
