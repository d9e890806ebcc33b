"""Pairs of schemas that hypothesis makes up: "nothing breaks" is never said where a value shows that something does."""

import itertools
import json

import jsonschema_rs
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from conformance.documents.schema_compatibility import schema_changes
from conformance.documents.schema_sides import Side

_TREE = {"$ref": "#/components/schemas/Tree"}
_NAMES = ("a", "b", "ab")
_SCALARS = [
    None, True, False, 0, 1, 2, 3, -1, 5, 6, 0.5, 1.5, 2.5, -0.5, 2**31, 2**63, "", "a", "b", "ab", "aa", "xyz",
    "2024-02-29",
]  # fmt: skip
_FEW = [None, True, 0, 1, 1.5, 3, "", "a", "xyz", {}, {"a": 1}, {"b": "a"}, [], [1], ["a", 1]]


def _values():
    """Return values of all kinds, made without a look at any schema."""
    yield from _SCALARS
    for length in range(4):
        yield from (list(one) for one in itertools.product((None, 0, 1.5, "a", {"a": 1}, ["a"]), repeat=length))
    for name in (*_NAMES, "c"):
        yield from ({name: value} for value in _FEW)
    for pair in itertools.combinations((*_NAMES, "c"), 2):
        yield from (dict(zip(pair, values, strict=True)) for values in itertools.product(_FEW[:10], repeat=2))
    yield dict.fromkeys((*_NAMES, "c"), 1)
    yield dict.fromkeys((*_NAMES, "c"), "a")


VALUES = list(_values())

_numbers = st.sampled_from([-1, 0, 0.5, 1, 1.5, 2, 3])
_sizes = st.sampled_from([0, 1, 2, 3])
_names = st.lists(st.sampled_from(_NAMES), unique=True, max_size=2)
_word = st.one_of(
    st.tuples(st.just("type"), st.sampled_from(["string", "integer", "number", "object", "array", "null", "boolean"])),
    st.tuples(st.just("type"), st.sampled_from([["string", "null"], ["integer", "array"], ["object", "string"]])),
    st.tuples(st.sampled_from(["minimum", "maximum", "exclusiveMinimum", "exclusiveMaximum"]), _numbers),
    st.tuples(st.just("multipleOf"), st.sampled_from([0.5, 1, 2, 3])),
    st.tuples(
        st.sampled_from([
            "minLength", "maxLength", "minItems", "maxItems", "minProperties", "maxProperties", "minContains",
            "maxContains",
        ]), _sizes,
    ),
    st.tuples(st.just("pattern"), st.sampled_from(["^a", "a$", "^[a-b]+$", "^.$"])),
    st.tuples(st.just("format"), st.sampled_from(["int32", "int64", "date", "uuid", "float"])),
    st.tuples(
        st.just("enum"),
        st.lists(st.sampled_from([None, 0, 1, 1.5, "a", "ab", [], {}]), unique_by=json.dumps, min_size=1),
    ),
    st.tuples(st.just("const"), st.sampled_from([None, 1, "a", {"a": 1}])),
    st.tuples(st.just("required"), _names),
    st.tuples(st.just("uniqueItems"), st.booleans()),
    st.tuples(st.just("dependentRequired"), st.dictionaries(st.sampled_from(_NAMES), _names, max_size=1)),
)  # fmt: skip


def _wider(schemas):
    """Return a strategy for a word that has schemas."""
    named = st.dictionaries(st.sampled_from(_NAMES), schemas, max_size=2)
    listed = st.lists(schemas, min_size=1, max_size=2)
    return st.one_of(
        st.tuples(st.sampled_from(["properties", "properties", "dependentSchemas"]), named),
        st.tuples(st.just("patternProperties"), st.dictionaries(st.sampled_from(["^a", "b$"]), schemas, max_size=1)),
        st.tuples(
            st.sampled_from([
                "items", "additionalProperties", "contains", "not", "if", "then", "else", "propertyNames",
                "unevaluatedProperties", "unevaluatedItems",
            ]), schemas,
        ),
        st.tuples(st.sampled_from(["allOf", "anyOf", "oneOf", "prefixItems"]), listed),
    )  # fmt: skip


def _schema(words):
    return st.lists(words, max_size=4).map(dict)


_leaf = st.one_of(st.booleans(), _schema(_word), st.just(_TREE))
_inner = st.one_of(_leaf, _schema(st.one_of(_word, _wider(_leaf))))
SCHEMAS = _schema(st.one_of(_word, _wider(_inner)))


@st.composite
def pairs(draw):
    """Draw two schemas: two of their own, or one and the same with a word that is other, gone or new."""
    old = draw(SCHEMAS)
    how = draw(st.sampled_from(["other", "changed", "changed", "inside", "gone"]))
    if how == "other" or (how != "changed" and not old):
        return old, draw(SCHEMAS)
    if how == "changed":
        return old, {**old, **dict([draw(st.one_of(_word, _wider(_inner)))])}
    word = draw(st.sampled_from(sorted(old)))
    if how == "inside" and isinstance(old[word], dict) and old[word]:
        name = draw(st.sampled_from(sorted(old[word])))
        return old, {**old, word: {**old[word], name: draw(_inner)}} if word in {
            "properties",
            "dependentSchemas",
        } else old
    return old, {key: value for key, value in old.items() if key != word}


TREES = st.sampled_from([
    {"type": "object", "properties": {"a": _TREE, "b": {"type": "string"}}},
    {"type": "object", "properties": {"a": _TREE, "b": {"type": "string"}}, "required": ["b"]},
    {"anyOf": [{"type": "array", "items": _TREE}, {"type": "integer"}]},
    {"anyOf": [{"type": "array", "items": _TREE}, {"type": "number"}]},
    {"oneOf": [{"type": "array", "items": _TREE}, {"type": ["integer", "null"]}]},
])  # fmt: skip


def _document(tree):
    return {"openapi": "3.1.0", "components": {"schemas": {"Tree": tree}}}


def _names_in(schema):
    if isinstance(schema, list):
        return set().union(*map(_names_in, schema))
    if not isinstance(schema, dict):
        return set()
    own = set(schema["properties"]) if isinstance(schema.get("properties"), dict) else set()
    return own.union(*map(_names_in, schema.values()))


def _reached(whole):
    """Return the names of members in a schema, and in the tree if it refers to that."""
    own = {key: value for key, value in whole.items() if key != "components"}
    return _names_in(whole if "#/components" in json.dumps(own) else own)


def _has_member(value, names):
    if isinstance(value, list):
        return any(_has_member(item, names) for item in value)
    return isinstance(value, dict) and (
        bool(names & value.keys()) or any(_has_member(one, names) for one in value.values())
    )


def _closed(schema):
    text = json.dumps(schema)
    return '"additionalProperties": false' in text or '"unevaluatedProperties": false' in text


def answer(old, new, documents, *, request):
    """Return whether something breaks; None if that is not known."""
    sides = [Side(name, one, request=request) for name, one in zip(("old", "new"), documents, strict=True)]
    placed = [(side.schema(schema), side) for side, schema in zip(sides, (old, new), strict=True)]
    found = {one.breaks for one in schema_changes(*placed, request=request)}
    return True if True in found else None if None in found else False


def counterexample(old, new, documents, *, request):
    """Return a value that is sent and not taken, or None.

    A client that sends values sends no member of a name that only the newer schema has; one that receives them takes
    members that are not described.
    """
    wholes = [{**schema, **document} for schema, document in zip((old, new), documents, strict=True)]
    inner, outer = wholes if request else wholes[::-1]
    introduced = (_reached(outer) - _reached(inner)) if request else set()
    if not request and _closed(outer):
        return None
    sent, taken = (jsonschema_rs.Draft202012Validator(one, validate_formats=True) for one in (inner, outer))
    return next(
        (
            value
            for value in VALUES
            if not (introduced and _has_member(value, introduced))
            and sent.is_valid(value)
            and not taken.is_valid(value)
        ),
        None,
    )


@settings(max_examples=250, derandomize=True, deadline=None, database=None, suppress_health_check=list(HealthCheck))
@given(pair=pairs(), trees=st.tuples(TREES, TREES), is_same_tree=st.booleans(), request_=st.booleans())
def test_nothing_breaks_is_never_said_where_a_value_shows_that_it_does(pair, trees, is_same_tree, request_):
    documents = [_document(trees[0]), _document(trees[0] if is_same_tree else trees[1])]
    shown = counterexample(*pair, documents, request=request_)
    if shown is not None:
        assert answer(*pair, documents, request=request_) is not False, shown
