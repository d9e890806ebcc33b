"""What a description may hold: bombs are refused or left out with a reason; large right descriptions are read."""

import json
import time
from typing import Any

import pytest
from small_device import described, reading

from conformance.contract.document_text import parsed
from conformance.documents.description import Description, DescriptionError, read_description
from conformance.documents.json_schema import modern, resolved
from conformance.documents.json_shape import Shape, has_formats, shape_of
from conformance.documents.openapi import read_operations

_HEAD = "openapi: 3.0.3\ninfo: {title: a, version: '1'}\npaths: {}\n"
_LAUGHS = "".join(f"x{i}: &a{i} [{','.join([f'*a{i - 1}'] * 10)}]\n" for i in range(1, 15))
_DEEP = '{"openapi": "3.0.3", "paths": {}, "x": '

#: Texts, and what the error says.
UNREADABLE = {
    "aliases": (f"{_HEAD}x0: &a0 [lol]\n{_LAUGHS}", "1,000,000 values, with what its aliases repeat, at line 10"),
    "merge keys": (f"{_HEAD}x0: &a0 {{k: v}}\n{_LAUGHS.replace('[', '{<<: [').replace(']', ']}')}", "at line 10"),
    "aliases of a long text": (f"{_HEAD}x: &a {'a' * 10**6}\ny: [{'*a,' * 1000}]\n", "characters"),
    "an alias in itself": (f"{_HEAD}x: &a [*a]\n", "of what holds it, at line 4"),
    "deep JSON lists": (_DEEP + "[" * 100_000 + "]" * 100_000 + "}", "nested too deeply"),
    "deep JSON objects": (_DEEP + '{"a":' * 300 + "1" + "}" * 300 + "}", "100 levels, at #/x/a/a"),
    "deep YAML blocks": ("".join(" " * i + "a:\n" for i in range(1000)), "100 levels"),
    "deep YAML lists": ("a: " + "[" * 100_000, "100 levels"),
    "deep YAML dashes": ("- " * 100_000 + "a", "100 levels"),
    "complex YAML keys": ("? " * 50_000 + "a", "a key that is no text"),
    "many values": (_DEEP + "[" + "0," * 1_100_000 + "0]}", "1,000,000 values, at #/x"),
    "many octets": (_DEEP + '"' + "a" * 40_000_000 + '"}', "bytes; the limit is"),
    "a long name": (_DEEP + '{"' + "a" * 5_000_000 + '": 1}}', "a name has 5,000,000 characters"),
    "many paths": (json.dumps(described({f"/{i}": {} for i in range(11_000)})), "#/paths has 11,000 members"),
}  # fmt: skip

_LONG = "a" * 200_000
#: Places in a description where a text of any length is in every request, address or message, and what holds it.
LONG_WORDS: dict[str, dict[str, Any]] = {
    "get/parameters/0/name": {"parameters": [{"name": _LONG, "in": "query", "schema": {"type": "string"}}]},
    "get/parameters/0/example": {"parameters": [{"name": "a", "in": "query", "schema": {}, "example": _LONG}]},
    "parameters/0/schema/default": {"parameters": [{"name": "a", "in": "query", "schema": {"default": _LONG}}]},
    "parameters/0/schema/enum/0": {"parameters": [{"name": "a", "in": "header", "schema": {"enum": [_LONG]}}]},
    "get/operationId": {"operationId": _LONG},
    "get/tags/0": {"tags": [_LONG]},
    "variables/a/default": {"servers": [{"url": "/{a}", "variables": {"a": {"default": _LONG}}}]},
    "servers/0/url": {"servers": [{"url": f"http://{_LONG}"}]},
    "schema/type": {"requestBody": {"content": {"application/json": {"schema": {"type": _LONG}}}}},
    "schema/\\$ref": {"requestBody": {"content": {"application/json": {"schema": {"$ref": f"#/{_LONG}"}}}}},
    "schema/required/0": {"requestBody": {"content": {"application/json": {"schema": {"required": [_LONG]}}}}},
}
#: Long texts that have their place.
LONG_TEXTS: dict[str, dict[str, Any]] = {
    "description": {"description": _LONG, "summary": _LONG},
    "extensions": {"x-logo": _LONG, "x-samples": [{"source": _LONG}]},
    "example of a body": {"requestBody": {"content": {"application/json": {"schema": {}, "example": _LONG}}}},
    "default of a body": {"requestBody": {"content": {"application/json": {"schema": {"default": _LONG}}}}},
}


def _ref(number: int) -> dict[str, str]:
    return {"$ref": f"#/components/schemas/s{number}"}


def _net(make: Any, last: int = 20) -> dict[str, Any]:
    """Return schemas, each of which is made from the number of the next one."""
    return {**{f"s{i}": make(i + 1) for i in range(last)}, f"s{last}": {"type": "string"}}


def _ten(part: Any) -> dict[str, Any]:
    return {f"p{i}": part for i in range(10)}


#: The first schema with the others, and what the remark says of it.
UNJUDGED: dict[str, tuple[Any, dict[str, Any], str]] = {
    "allOf": (_ref(0), _net(lambda n: {"allOf": [_ref(n)] * 10}), "bind one value"),
    "anyOf": (_ref(0), _net(lambda n: {"anyOf": [_ref(n)] * 10}), "bind one value"),
    "oneOf and not": (_ref(0), _net(lambda n: {"oneOf": [_ref(n), {"not": _ref(n)}] * 2}), "bind one value"),
    "allOf of all": (_ref(0), {f"s{i}": {"allOf": [_ref(k) for k in range(12)]} for i in range(12)}, "bind one value"),
    "required members": (_ref(0), _net(lambda n: {"required": [*_ten(0)], "properties": _ten(_ref(n))}), "smallest"),
    "minLength": ({"type": "string", "minLength": 10**9}, {}, "smallest value"),
    "minItems in minItems": (_ref(0), _net(lambda n: {"minItems": 1000, "items": _ref(n)}, 4), "smallest value"),
    "minProperties": ({"type": "object", "minProperties": 10**7}, {}, "smallest value"),
    "quantifiers": ({"type": "string", "pattern": "^(a{1000}){1000}$"}, {}, "nested quantifiers"),
    "quantifiers of names": ({"patternProperties": {"(((a{99}){99}){99})": {}}}, {}, "nested quantifiers"),
    "an enum of many": ({"enum": list(range(60_000))}, {}, "enum of 60,000 values"),
    "a long text in an enum": ({"enum": ["a", "a" * 2_000_000]}, {}, "a value of 2,000,000 characters in enum"),
    "a long text deep in a const": ({"const": [{"a": "a" * 2_000_000}]}, {}, "a value of 2,000,002 characters"),
    "a long default": ({"default": "a" * 2_000_000}, {}, "a value of 2,000,000 characters in enum, const or default"),
    "many examples": ({"examples": ["a"] * 20_000}, {}, "examples of 20,000 values; the limit is 10,000"),
    "a long pattern": ({"pattern": "a|" * 200_000}, {}, "a pattern of 400,000 characters"),
    "many patterns": (
        {"anyOf": [{"pattern": f"a{{99999}}b{{{i}}}"} for i in range(100)]}, {}, "the patterns of the document",
    ),
}  # fmt: skip


def _read(text: str) -> Description:
    return read_description("a.yaml", lambda _: text.encode())


@pytest.mark.parametrize("name", UNREADABLE)
def test_a_description_beyond_the_budget_is_refused_with_the_place(name: str) -> None:
    text, reason = UNREADABLE[name]
    started = time.process_time()

    with pytest.raises(DescriptionError, match=reason.replace("*", ".")):
        _read(text)

    assert time.process_time() - started < 8


@pytest.mark.parametrize("place", LONG_WORDS)
def test_a_long_text_in_every_request_is_refused_with_the_place(place: str) -> None:
    with pytest.raises(DescriptionError, match=rf"{place} has 200,0\d\d characters; the limit is 100,000"):
        _read(json.dumps(described({"/a": reading({}, **LONG_WORDS[place])})))


@pytest.mark.parametrize("name", LONG_TEXTS)
def test_a_long_text_for_people_or_in_a_body_is_read(name: str) -> None:
    assert _read(json.dumps(described({"/a": reading({}, **LONG_TEXTS[name])}))).unread == ()


@pytest.mark.parametrize("name", UNJUDGED)
def test_a_schema_beyond_the_budget_is_left_out_with_a_reason(name: str) -> None:
    schema, others, reason = UNJUDGED[name]
    document = described({"/a": reading(schema)}, "3.1.0", components={"schemas": others})
    started = time.process_time()

    found = _read(json.dumps(document))

    assert any(reason in line for line in found.unread), found.unread[:3]
    assert time.process_time() - started < 8


def _kind(number: int) -> dict[str, Any]:
    members = {"kind": {"const": f"s{number}"}, "child": _ref(0), "a": {"type": "integer"}}
    return {"type": "object", "required": ["kind"], "properties": members}


@pytest.mark.parametrize("key", ["oneOf", "anyOf"])
def test_alternatives_that_all_refer_to_each_other_are_judged(key: str) -> None:
    kinds = {f"s{i}": _kind(i) for i in range(1, 301)}
    document = {"components": {"schemas": {"s0": {key: [_ref(i) for i in range(1, 301)]}, **kinds}}}
    shape = Shape(modern(resolved(document, _ref(0))))
    right: dict[str, Any] = {"kind": "s300", "a": 1}
    wrong: dict[str, Any] = {"kind": "s300", "a": "1"}
    for number in range(1, 6):
        right, wrong = ({"kind": f"s{number}", "child": value} for value in (right, wrong))
    started = time.process_time()

    assert (shape.problem(right), shape.holds(right), shape.holds(wrong)) == ("", True, False)
    assert shape.problem(wrong)

    assert time.process_time() - started < 8


#: What jsonschema-rs reads otherwise than ECMA-262 in the schema of each item, so Python has to judge the item.
_INEXACT: dict[str, Any] = {"patternProperties": {r"^\p{Lu}+$": {"type": "integer"}}, "additionalProperties": False}


@pytest.mark.parametrize("words", [{}, _INEXACT], ids=["exact", "inexact"])
@pytest.mark.parametrize("count", [1, 3_000])
def test_a_long_list_of_valid_items_is_valid(words: dict[str, Any], count: int) -> None:
    node = {"type": "object", "properties": {"next": _ref(0), "price": {"multipleOf": 1e-5}}, **words}
    shape = Shape(resolved({"components": {"schemas": {"s0": node}}}, {"type": "array", "items": _ref(0)}))
    right: list[Any] = [{"next": {"price": 7e-5, **({"A": number} if words else {})}} for number in range(count)]

    assert (shape.problem(right), shape.holds(right), shape.broken_rule(right)) == ("", True, ("", False))

    right[-1]["next"]["next"] = "wrong"
    assert not shape.holds(right)
    assert "next.next" in shape.problem(right)


@pytest.mark.parametrize("leaf", ["a" * 20_000, float("inf"), "\ud800"], ids=["long", "infinite", "surrogate"])
def test_alternatives_are_judged_once_whatever_the_value_has(leaf: Any) -> None:
    kinds = {f"s{i}": {"properties": {"child": _ref(0), "a": {"type": "integer"}}} for i in range(1, 301)}
    document = {"components": {"schemas": {"s0": {"anyOf": [_ref(i) for i in range(1, 301)]}, **kinds}}}
    shape = Shape(modern(resolved(document, _ref(0))))
    wrong: dict[str, Any] = {"a": "1", "b": leaf}
    for _ in range(5):
        wrong = {"child": wrong}
    started = time.process_time()

    assert not shape.holds(wrong)
    assert shape.problem(wrong)

    assert time.process_time() - started < 8


_NODE = {"type": "object", "properties": {"value": {"type": "string"}, **_ten(_ref(0))}}
_KINDS = [f"s{i}" for i in range(1, 50)]
#: Schemas that real descriptions have, with the others that they name.
JUDGED: dict[str, tuple[Any, dict[str, Any]]] = {
    "a tree": (_ref(0), {"s0": {**_NODE, "required": ["value"]}}),
    "a net of optional members": (_ref(0), {f"s{i}": {**_NODE, "properties": _ten(_ref(i // 2))} for i in range(30)}),
    "a parent and its kinds": (
        _ref(0),
        {"s0": {"oneOf": [_ref(i) for i in range(1, 50)]}} | {k: {"allOf": [_ref(0), _NODE]} for k in _KINDS},
    ),
    "long texts": ({"type": "string", "pattern": "^[\\s\\S]{0,131072}$", "maxLength": 2147483647}, {}),
    "usual patterns": ({"type": "string", "pattern": r"^(?:[a-z0-9]{1,63}\.){1,10}[a-z]{2,63}$"}, {}),
    "a matrix": ({"type": "array", "minItems": 36, "maxItems": 36, "items": {"type": "number"}}, {}),
}  # fmt: skip


@pytest.mark.parametrize("name", JUDGED)
def test_a_usual_schema_is_judged(name: str) -> None:
    schema, others = JUDGED[name]

    found = _read(json.dumps(described({"/a": reading(schema)}, components={"schemas": others})))

    assert found.unread == ()


def _large() -> dict[str, Any]:
    """Return a description of 1,000 operations and 900 schemas that refer to each other, 9 MB with white space."""
    field = {"type": "string", "description": "A field that has a description, and so on. " * 2, "example": "abc"}
    schemas = {
        f"s{i}": {
            "type": "object",
            "required": ["id"],
            "properties": {
                **{f"field_{k}": field for k in range(30)},
                "id": {"type": "integer"},
                "next": _ref((i + 1) % 900),
                "others": {"type": "array", "items": _ref(i * 7 % 900)},
            },
        }
        for i in range(900)
    }
    example = {f"key {i}": {"a": i, "b": "text"} for i in range(30)}
    paths = {
        f"/repos/{{owner}}/{i}": reading(
            _ref(i % 900),
            description="A long text, " * 60,
            parameters=[{"name": "owner", "in": "path", "required": True, "schema": {"type": "string"}}],
            **{"x-example": example},
        )
        for i in range(500)
    }
    return described(paths, components={"schemas": schemas})


def test_a_large_description_is_read_as_json_and_as_yaml() -> None:
    document = _large()
    written = "# YAML, of which JSON is a part\n" + json.dumps(document, indent=1)

    assert len(written) > 6_000_000
    assert parsed(written.encode()) == document
    assert _read(json.dumps(document)).unread == ()


def test_schemas_that_refer_to_each_other_are_compiled_once() -> None:
    operations = read_operations(_read(json.dumps(_large())).document, closed=True)
    schemas = [operation.responses["200"]["application/json"] for operation in operations[:100]]
    right = {"id": 1, "next": {"id": 2, "others": [{"id": 3, "field_1": "a"}]}}
    wrong = {"id": 1, "next": {"id": 2, "others": [{"id": 3, "field_1": 4}]}}
    started = time.process_time()

    assert all(shape_of(schema).holds(right) for schema in schemas)
    assert all(has_formats(schema, right) for schema in schemas)
    assert not any(shape_of(schema).holds(wrong) for schema in schemas[:3])
    assert "next.others[0].field_1 is 4" in shape_of(schemas[0]).problem(wrong)
    assert time.process_time() - started < 30  # once for each operation: minutes, and 25 MB each


def test_a_schema_that_thousands_of_paths_share_is_copied_once() -> None:
    shared = {"s0": {"type": "object", "properties": {f"p{i}": {"type": "string"} for i in range(1_900)}}}
    document = described({f"/{i}": reading(_ref(0)) for i in range(5_000)}, components={"schemas": shared})
    started = time.process_time()

    operations = read_operations(document, closed=True)
    shapes = [shape_of(operation.responses["200"]["application/json"]) for operation in operations[:50]]

    assert [(shape.holds({"p1899": "a"}), shape.holds({"p1899": 1})) for shape in shapes] == [(True, False)] * 50
    assert time.process_time() - started < 8  # copied for each path: 30 s, and 5 GB


def test_the_files_of_a_description_have_one_budget() -> None:
    def load(source: str) -> bytes:
        number = int(source.removesuffix(".json")) if source != "a.json" else 0
        following = {"$ref": f"{number + 1}.json"}
        document = described({"/a": reading(following)}) if source == "a.json" else {"allOf": [following]}
        return json.dumps({**document, "x-filler": "a" * 5_000_000}).encode()

    found = read_description("a.json", load)

    assert any("the limit of a description's files is" in line for line in found.unresolved)


_OVERLAYS = {
    "doubling": [{"target": "$.paths..*", "update": {"a": {}, "b": {}, "c": {}, "d": {}}}] * 40,
    "large updates": [{"target": "$.paths.*", "update": {"x": [0] * 60_000}}],
    "places of places": [{"target": "$..*..*..*..*..*..*", "update": {}}],
}


@pytest.mark.parametrize("name", _OVERLAYS)
def test_the_actions_of_an_overlay_have_one_budget(name: str) -> None:
    document = described({f"/{i}": reading(_NODE) for i in range(20)}, components={"schemas": {"s0": _NODE}})
    files = {"a.json": document, "o.json": {"overlay": "1.0.0", "actions": _OVERLAYS[name]}}

    with pytest.raises(DescriptionError, match=r"beyond the limit of an overlay"):
        read_description("a.json", lambda source: json.dumps(files[source]).encode(), ["o.json"])


def test_a_reference_to_definitions_of_its_own_is_followed() -> None:
    shape = Shape({"$ref": "#/$defs/name", "$defs": {"name": {"type": "string"}, "1": {"type": "integer"}}})
    assert (shape.problem("a"), shape.holds(1)) == ("", False)
    assert shape.problem(1)
