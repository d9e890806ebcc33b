"""Two descriptions in files."""

import json

import pytest

from conformance.documents.description import DescriptionError
from conformance.engine.comparing import compare

API = {"openapi": "3.1.0", "info": {}, "paths": {"/a": {"get": {"responses": {"200": {"$ref": "answers.yaml#/ok"}}}}}}
SWAGGER = {"swagger": "2.0", "info": {}, "paths": {"/a": {"get": {"responses": {"200": {"description": ""}}}}}}


def _written(folder, document):
    folder.mkdir()
    (folder / "api.json").write_text(json.dumps(document))
    (folder / "answers.yaml").write_text("ok: {description: Fine.}")
    return str(folder / "api.json")


def test_descriptions_of_several_files_and_versions(tmp_path):
    old, new = _written(tmp_path / "old", API), _written(tmp_path / "new", SWAGGER)
    assert compare(old, new) == []
    gone = _written(tmp_path / "gone", {**API, "paths": {}})
    assert [(one.breaking, one.operation, one.text) for one in compare(old, gone)] == [
        (True, "GET /a", "the operation is gone")
    ]


def test_what_cannot_be_read_is_not_compared(tmp_path):
    broken = {**API, "paths": {**API["paths"], "/b": []}}
    old, new = _written(tmp_path / "old", API), _written(tmp_path / "new", broken)
    assert [one.breaking for one in compare(old, new)] == [None]
    assert [one.breaking for one in compare(new, old)] == [None]


@pytest.mark.parametrize("document", [{}, {"openapi": "3.1.0"}])
def test_what_is_no_description_is_told(tmp_path, document):
    with pytest.raises(DescriptionError):
        compare(_written(tmp_path / "old", API), _written(tmp_path / "new", document))
