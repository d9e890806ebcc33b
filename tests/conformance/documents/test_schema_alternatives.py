"""Of several alternatives, the text on a value names what is wrong by the one that fits best."""

import pytest

from conformance.documents.json_schema import modern
from conformance.documents.json_shape import shape_of


def _object(**members):
    return {"type": "object", "required": sorted(members), "properties": members}


_DOG = _object(kind={"const": "dog"}, bark={"type": "string"})
_CAT = _object(kind={"enum": ["cat"]}, meow={"type": "integer"})
_SIZED = {"anyOf": [{"type": "null"}, _object(size=_object(w={"type": "number"}))]}
_NONE_FITS = "is not valid under any of the given schemas"
CASES = (
    # the alternatives, the value, what is said of it
    ([_DOG, _CAT], {"kind": "cat", "meow": "x"}, 'it.meow is "x", not of type integer'),
    ([_DOG, _CAT], {"kind": "cat"}, "it.meow is missing"),
    ([_CAT, _DOG], {"kind": "dog"}, "it.bark is missing"),
    ([_CAT, _DOG], {"kind": "dog", "bark": 1}, "it.bark is 1, not of type string"),
    ([_DOG, _CAT], {"kind": "bird"}, _NONE_FITS),
    ([_DOG, _CAT], {}, _NONE_FITS),
    ([_DOG, _CAT], 5, _NONE_FITS),
    ([{"type": "null"}, _CAT], {"kind": "cat"}, "it.meow is missing"),
    ([{"type": "string", "pattern": "^a"}, {"type": "integer", "minimum": 5}], 3, "less than the minimum of 5"),
    ([{"type": "string", "pattern": "^a"}, {"type": "integer", "minimum": 5}], "b", "does not match '^a'"),
    ([{"type": "string"}, _SIZED], {"size": {"w": "x"}}, 'it.size.w is "x", not of type number'),
)


@pytest.mark.parametrize("word", ["oneOf", "anyOf"])
@pytest.mark.parametrize(("alternatives", "value", "said"), CASES)
def test_the_alternative_that_fits_best_is_named(word, alternatives, value, said):
    assert said in shape_of(modern({word: alternatives})).problem(value, "it")


def test_a_discriminator_chooses_where_several_alternatives_allow_a_value():
    tool = _object(kind={"enum": ["gripper", "drill"]})
    chosen = {"oneOf": [tool, dict(tool)], "discriminator": {"propertyName": "kind"}}
    assert shape_of(modern(chosen)).problem({"kind": "drill"}, "it") == ""
    assert shape_of(modern({"oneOf": chosen["oneOf"]})).problem({"kind": "drill"}, "it")
