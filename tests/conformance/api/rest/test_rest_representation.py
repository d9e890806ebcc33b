"""Formats: which of them Accept chooses, and that each of them reads as the same value."""

import json

import pytest

from conformance.api.rest.formats import quality
from conformance.contract.pack import Contract
from conformance.documents.json_shape import shape_of
from conformance.documents.json_text import read_json
from conformance.documents.openapi import operations_of
from conformance.documents.representation import UnreadableError, flattened, read

NUMBER = {"type": "number"}
PART = {"type": "object", "required": ["x"], "properties": {"x": NUMBER}}
FIELDS = {name: {"type": kind} for name, kind in (("name", "string"), ("on", "boolean"), ("count", "integer"))}
FIELDS |= {name: {"type": "array", "items": item} for name, item in (("values", NUMBER), ("parts", PART))}
SCHEMA = {"type": "object", "required": list(FIELDS), "properties": FIELDS}
VALUE = {"name": "12", "on": True, "count": 7, "values": [0.1, 1e-05], "parts": [{"x": 1.5}, {"x": -0.0}]}
FRONT = "<m><name>12</name><on>true</on><count>7</count>"


@pytest.mark.parametrize(
    ("media_type", "body"),
    [
        ("application/json", json.dumps({**VALUE, "more": [1]})),
        (
            "application/xml",
            (
                f"{FRONT}<values>0.1</values><values>1e-05</values>"
                "<parts><x>1.5</x></parts><parts><x>-0.0</x></parts><more>1</more></m>"
            ),
        ),
        (
            "application/xml",
            (
                f'<?xml version="1.0"?><!-- c -->{FRONT}<values><item>0.1</item><item>1e-05</item></values>'
                "<parts><part><x>1.5</x></part><part><x>-0.0</x></part></parts></m>"
            ),
        ),
        (
            "application/xml",
            (
                '<m xmlns="urn:x"><parts><x>1.5</x></parts><values> 0.1 </values><name><![CDATA[12]]></name>'
                "<parts><x>-0.0</x></parts><values>1e-05</values><on>1</on><count>+7</count></m>"
            ),
        ),
        ("text/plain", "name: '12'\non: true\ncount: 7\nvalues:\n- 0.1\n- 1e-05\nparts:\n- x: 1.5\n- x: -0.0\n---\n"),
        ("text/plain", "{name: 12, on: true, count: 7, values: [0.1, 1.0e-05], parts: [{x: 1.5}, {x: -0.0}]}"),
    ],
)
def test_every_format_reads_as_the_same_value(media_type, body):
    value = read(media_type, body.encode(), SCHEMA)
    assert not shape_of(SCHEMA).problem(value)
    assert flattened(value) == flattened(VALUE)


@pytest.mark.parametrize(
    ("media_type", "body"),
    [
        ("application/json", "{"),
        ("application/json", '{"a": NaN}'),
        ("application/json", '{"a": 1, "a": 1}'),
        ("application/xml", "<m>"),
        ("application/xml", '<!DOCTYPE m [<!ENTITY a "b">]><m>&a;</m>'),
        ("application/xml", "<m>ok<name>12</name></m>"),
        ("application/xml", "<m><parts><x>1</x>ok</parts></m>"),
        ("text/plain", "a: [1"),
        ("text/plain", "a: 1\n---\nb: 2\n"),
        ("application/json", "[" * 100_000),
    ],
)
def test_what_is_not_its_media_type_cannot_be_read(media_type, body):
    with pytest.raises(UnreadableError):
        read(media_type, body.encode(), SCHEMA)


@pytest.mark.parametrize(
    "body",
    [
        f"{FRONT}<values>0.1</values></m>".replace("<name>12</name>", ""),
        f"{FRONT}<count>8</count><values>0.1</values></m>",
        f"{FRONT}<values>fast</values></m>",
        f"{FRONT}<values>0.1 0.2</values></m>",
        f"{FRONT}<values>INF</values></m>",
        f"{FRONT}<values>0.1</values><parts><y>1</y></parts></m>",
    ],
)
def test_xml_of_another_shape_is_seen_as_such(body):
    assert shape_of(SCHEMA).problem(read("application/xml", body.encode(), SCHEMA))


def test_a_list_has_a_root_of_any_name():
    sensors = next(item for item in operations_of(Contract.load()) if item.id == "getSensors").shape
    one = {"name": "lidar", "topic": "/scan", "type": "sensor_msgs/msg/LaserScan"}
    inner = "".join(f"<{name}>{text}</{name}>" for name, text in one.items())
    assert read("application/xml", f"<list><sensor>{inner}</sensor></list>".encode(), sensors) == [one]
    assert read("application/xml", b"<list/>", sensors) == []


@pytest.mark.parametrize(
    ("body", "field"),
    [
        (b'{"a": Infinity}', "non_finite"),
        (b'{"a": 1e999}', "non_finite"),
        (b"[" + b"9" * 5000 + b"]", "non_finite"),
        (b'\xef\xbb\xbf{"a": 1}', "encoding"),
        (b'{"\xff": 1}', "encoding"),
        (b'{"a": {"b": 1, "b": 2}}', "twice"),
        (b"{'a': 1}", "malformed"),
        (b"", "malformed"),
    ],
)
def test_what_is_wrong_with_json(body, field):
    assert getattr(read_json(body), field)


@pytest.mark.parametrize(
    ("media_type", "accept", "expected"),
    [
        ("application/json", None, 1.0),
        ("application/json", "", 1.0),
        ("application/json", "*/*", 1.0),
        ("application/json", "text/plain", 0.0),
        ("application/json", "APPLICATION/JSON ; Q=0.3", 0.3),
        ("application/json", "*/*, application/json;q=0.1", 0.1),
        ("text/plain", "*/*;q=0.1, text/*;q=0.2", 0.2),
        ("text/plain", "text/plain;q=0, text/*", 0.0),
        ("application/xml", ", application/xml;version=1;q=0.5,", 0.5),
        ("application/json", "application/json;q=2", 0.0),
    ],
)
def test_the_most_specific_range_tells(media_type, accept, expected):
    assert quality(media_type, accept) == expected
