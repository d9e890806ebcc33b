"""An overlay changes a description as the OAI's specification says."""

import pytest

from conformance.documents.description import OverlayError, overlaid

_DOCUMENT = {"paths": {"/a": {"get": {"tags": ["x"]}, "post": {}}, "/b": {"post": {"tags": ["y"]}}}, "l": [1, 2, 3]}


@pytest.mark.parametrize(
    ("action", "place", "found"),
    [
        ({"target": "$.paths['/a'].get", "update": {"x-n": 1}}, ("paths", "/a", "get"), {"tags": ["x"], "x-n": 1}),
        ({"target": "$.paths['/a'].get", "update": {"tags": ["z"]}}, ("paths", "/a", "get", "tags"), ["x", "z"]),
        ({"target": "$.paths['/a'].get.tags", "update": "z"}, ("paths", "/a", "get", "tags"), ["x", "z"]),
        ({"target": "$.paths.*.post", "update": {"x-n": 1}}, ("paths", "/a", "post"), {"x-n": 1}),
        ({"target": "$.paths['/a'].post", "remove": True}, ("paths", "/a"), {"get": {"tags": ["x"]}}),
        ({"target": "$.l[?@ > 1]", "remove": True}, ("l",), [1]),
        ({"target": "$", "update": {"x-n": 1}}, ("x-n",), 1),
        ({"target": "$.gone", "update": {"x-n": 1}}, (), _DOCUMENT),
    ],
)
def test_actions(action, place, found):
    value = overlaid(_DOCUMENT, {"overlay": "1.0.0", "actions": [action]})
    for step in place:
        value = value[step]
    assert value == found
    assert _DOCUMENT["l"] == [1, 2, 3]


@pytest.mark.parametrize("target", ["$.l[?@ == 1e999]", f"$.l[{'9' * 5000}]", "$.o[?@ =~ /(/]", "$.l[1e400:]"])
def test_a_target_with_a_number_or_pattern_that_nothing_reads_says_why(target):
    with pytest.raises(OverlayError, match="is no JSONPath"):
        overlaid({"l": ["a"], "o": ["a"]}, {"overlay": "1.0.0", "actions": [{"target": target, "remove": True}]})


@pytest.mark.parametrize(
    "overlay", [{}, {"overlay": "1.0.0"}, *({"overlay": "1.0.0", "actions": [one]} for one in ({}, {"target": "$["}))]
)
def test_what_is_no_overlay_says_why(overlay):
    with pytest.raises(OverlayError):
        overlaid(_DOCUMENT, overlay)
