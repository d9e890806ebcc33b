"""Result files: the schemas, and what happens to files that break them."""

import json

import pytest
from jsonschema import Draft202012Validator

from reports.errors import (
    ResultFormatError,
    ResultGarbledError,
    ResultInvalidError,
    ResultMissingError,
    ResultUnreadableError,
)
from reports.reading import LATENCY_FORMAT, RESULT_FORMAT, SCHEMA_FILES, read_latency, read_result


@pytest.mark.parametrize("name", [RESULT_FORMAT, LATENCY_FORMAT])
def test_schema_is_a_schema(name):
    schema = json.loads(SCHEMA_FILES[name].read_text(encoding="utf-8"))
    Draft202012Validator.check_schema(schema)
    assert schema["properties"]["format"]["const"] == name


def written(tmp_path, document):
    path = tmp_path / "file.json"
    path.write_text(json.dumps(document), encoding="utf-8")
    return path


def test_examples_are_valid(tmp_path, result, latency):
    assert read_result(written(tmp_path, result)) == result
    assert read_latency(written(tmp_path, latency)) == latency


def test_keys_may_be_added(tmp_path, result):
    result["later"] = result["suite"]["later"] = result["requirements"][0]["later"] = 1
    assert read_result(written(tmp_path, result))["later"] == 1


@pytest.mark.parametrize(
    ("path", "value", "place"),
    [
        (["verdict"], "splendid", "$.verdict"),
        (["requirements", 3, "verdict"], "passed", "$.requirements[3].verdict"),
        (["requirements", 0, "cases"], -1, "$.requirements[0].cases"),
        (["classes", "http"], "ok", "$.classes.http"),
        (["seed"], "2026", "$.seed"),
        (["started"], "yesterday", "$.started"),
        (["requirements", 0, "failures"], [], "$.requirements[0].failures"),
    ],
)
def test_breach_is_told_with_file_place_and_value(tmp_path, result, path, value, place):
    parent = result
    for key in path[:-1]:
        parent = parent[key]
    parent[path[-1]] = value
    file = written(tmp_path, result)
    with pytest.raises(ResultInvalidError) as raised:
        read_result(file)
    assert str(file) in str(raised.value)
    assert place in str(raised.value)
    assert json.dumps(value) in str(raised.value)


@pytest.mark.parametrize("key", ["verdict", "suite", "requirements", "statement", "command", "class_reasons"])
def test_missing_key_is_named(tmp_path, result, key):
    del result[key]
    with pytest.raises(ResultInvalidError, match=key):
        read_result(written(tmp_path, result))


@pytest.mark.parametrize("found", [None, "roaas-result/2", "roaas-latency/1", 1])
def test_other_format(tmp_path, result, found):
    result["format"] = found
    with pytest.raises(ResultFormatError, match="roaas-result/1"):
        read_result(written(tmp_path, result))


@pytest.mark.parametrize(
    ("content", "kind", "told"),
    [
        (b"", ResultGarbledError, "line 1, column 1"),
        (b'{"format": "roaas-re', ResultGarbledError, "line 1"),
        (b'{"a": NaN}', ResultGarbledError, "NaN"),
        (b'{"a": 1' + b"0" * 5000 + b"}", ResultGarbledError, "5000|digits|limit"),
        (b'{"a":' * 100_000, ResultGarbledError, "deeply|line"),
        (b"\xff\xfe\x00", ResultUnreadableError, "0xff"),
        (b"[1, 2]", ResultInvalidError, "expected an object"),
    ],
)
def test_garbled_file(tmp_path, content, kind, told):
    (tmp_path / "result.json").write_bytes(content)
    with pytest.raises(kind, match=told) as raised:
        read_result(tmp_path / "result.json")
    assert str(tmp_path / "result.json") in str(raised.value)


@pytest.mark.parametrize(("name", "kind"), [("result.json", ResultMissingError), ("", ResultUnreadableError)])
def test_no_file_and_a_directory_for_a_file(tmp_path, name, kind):
    with pytest.raises(kind):
        read_result(tmp_path / name)
