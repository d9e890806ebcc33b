"""The branches of a schema, and those that a value shows."""

import pytest

from conformance.api.rest.operation_log import branches_in, branches_of

POSE = {"type": "object", "properties": {"x": {"type": "number"}, "frame": {"type": "string"}}}


@pytest.mark.parametrize(
    ("schema", "value", "shown", "hidden"),
    [
        ({}, {"a": 1}, set(), set()),
        (POSE, {"x": 1}, {".x"}, {".frame"}),
        ({"type": "array", "items": POSE}, [{"x": 1}, {"frame": "map"}], {"[].x", "[].frame"}, set()),
        ({"anyOf": [POSE, {"type": "null"}]}, None, {"|anyOf 1"}, {"|anyOf 0", "|anyOf 0.x", "|anyOf 0.frame"}),
        ({"allOf": [POSE]}, {"frame": "map"}, {".frame"}, {".x"}),
        ({"properties": {"pose": POSE}}, {"pose": {"x": 1}}, {".pose", ".pose.x"}, {".pose.frame"}),
        (POSE, [1, 2], set(), {".x", ".frame"}),
        ({"oneOf": [{"pattern": "("}]}, "a", set(), {"|oneOf 0"}),
    ],
)
def test_a_value_shows_some_of_a_schemas_branches(schema, value, shown, hidden):
    assert set(branches_in(schema, value)) == shown
    assert set(branches_of(schema)) == shown | hidden
