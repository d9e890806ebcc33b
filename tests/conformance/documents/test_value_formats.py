"""Formats of numbers, bytes and texts, within recursive schemas too; nothing is fetched for a schema."""

import pytest

from conformance.documents.json_schema import modern, resolved
from conformance.documents.json_shape import has_formats, validator_of, wrong_formats

_RIGHT = {
    "int8": [-128, 127, 1.0],
    "uint16": [0, 65535],
    "int32": [-(2**31), 2**31 - 1, 1.0, "text"],
    "int64": [-(2**63), 2**63 - 1, "18446744073709551616"],
    "uint64": [2**64 - 1],
    "float": [0.1, -3.4e38, 1, -0.0, 1e-60],
    "double": [1.7e308, 5e-324, 0.1],
    "byte": ["", "AA==", "AA", "+/+/", "-_-_", "AAE=", "QUJD"],
    "date-time": [
        "1998-12-31T23:59:60Z",
        "1998-12-31t23:59:59.5z",
        "2020-02-29T00:00:00-00:00",
        "2020-01-01T00:00:00+23:59",
    ],
    "date": ["2020-02-29"],
    "time": ["23:59:60Z", "08:30:06z", "12:00:00.1+01:00"],
    "duration": ["P1W", "PT0S", "P3Y6M4DT12H30M5S", "PT36H", "P0D"],
    "uuid": ["3FA85F64-5717-4562-B3FC-2C963F66AFA6", "00000000-0000-0000-0000-000000000000"],
    "ipv4": ["127.0.0.1"],
    "ipv6": ["::1", "::ffff:1.2.3.4"],
    "uri": ["urn:x:y", "http://[::1]:80/"],
    "email": ["a+b@example.com"],
    "hostname": ["localhost"],
    "decimal128": ["what nobody knows", 1e300],
}
_WRONG = {
    "int8": [128],
    "uint16": [-1, 65536],
    "int32": [4294967295, -(2**31) - 1, 5e20, 1.5],
    "int64": [18446744073709551615, 2**63, 10**400],
    "uint64": [-1, 2**64],
    "float": [3.5e38, -1e39],
    "byte": ["not base64 at all!", "A", "A=", "AA=", "A===", "+_AA", "AAAA\n"],
    "date-time": ["2020-01-01T00:00:00", "2020-01-01 00:00:00Z", "2020-01-01T12:59:60Z"],
    "date": ["2021-02-29"],
    "time": ["12:00:00", "24:00:00Z"],
    "duration": ["1s", "P", "PT", "P1W1D"],
    "uuid": ["3fa85f6457174562b3fc2c963f66afa6"],
    "ipv4": ["1.2.3", "01.2.3.4"],
    "ipv6": ["1.2.3.4"],
    "uri": ["/relative"],
    "email": ["nobody"],
    "hostname": ["-a"],
}


@pytest.mark.parametrize(("name", "value"), [(name, value) for name, values in _RIGHT.items() for value in values])
def test_a_value_has_its_format(name, value):
    assert has_formats({"format": name}, value)
    assert not wrong_formats({"format": name}, value)


@pytest.mark.parametrize(("name", "value"), [(name, value) for name, values in _WRONG.items() for value in values])
def test_a_value_does_not_have_its_format(name, value):
    schema = {"properties": {"v": {"format": name}}}
    assert not has_formats(schema, {"v": value})
    assert wrong_formats(schema, {"v": value}) == [(value, "v", name)]


def test_each_place_without_its_format_is_told_in_a_recursive_schema_too():
    node = {"properties": {"t": {"format": "int32", "maximum": 2**40}, "kids": {"items": {"$ref": "#/node"}}}}
    schema = modern(resolved({"openapi": "3.0.3", "node": node}, {"$ref": "#/node"}))
    value = {"t": 1, "kids": [{"t": 2**32, "kids": [{"t": 2**33}, {"t": 2**34}]}]}
    assert wrong_formats(schema, value) == [(2**32, "kids/*/t", "int32"), (2**33, "kids/*/kids/*/t", "int32")]


@pytest.mark.parametrize("reference", ["file:///etc/hostname", "http://127.0.0.1:9/schema.json"])
def test_nothing_is_fetched_for_a_schema(reference):
    with pytest.raises(ValueError, match="is disabled"):
        validator_of({"$ref": reference})
