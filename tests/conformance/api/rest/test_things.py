"""What differs between what was written and what is read."""

import pytest

from conformance.api.rest.things import differences

_SCHEMA = {
    "type": "object",
    "properties": {
        "positions": {"type": "array", "items": {"type": "number"}},
        "names": {"type": "array", "items": {"type": "string"}},
        "count": {"type": "integer"},
        "level": {"type": "number"},
        "flag": {"type": "boolean"},
    },
}


@pytest.mark.parametrize(
    ("sent", "seen", "differs"),
    [
        ({"positions": [1, 2]}, {"positions": [1.0, 2.0]}, False),
        ({"positions": [0.1 + 0.2]}, {"positions": [0.3]}, False),
        ({"positions": [1, 2]}, {"positions": [1.0, -2.0]}, True),
        ({"positions": [1, 2]}, {"positions": [1.0]}, True),
        ({"names": ["b", "A"]}, {"names": ["a", "b "]}, False),
        ({"names": ["b"]}, {"names": ["c"]}, True),
        ({"count": 3}, {"count": 3.0}, False),
        ({"count": 3}, {"count": 4}, True),
        ({"level": 1}, {"level": 1.0000001}, False),
        ({"flag": True}, {"flag": False}, True),
        ({"flag": True}, {}, False),
    ],
)
def test_numbers_are_compared_as_numbers_and_texts_without_their_form(sent, seen, differs):
    assert bool(list(differences(sent, seen, _SCHEMA, _SCHEMA, frozenset()))) is differs
